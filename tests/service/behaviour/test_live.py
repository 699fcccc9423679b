"""Controllers that run on the server: a target is moved, the robot follows, nothing runs on unseen."""

import json
import math
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.problem.load import load_problem
from optiplan.service.execution.live import LiveLoop
from optiplan.service.execution.solver_pool import SolverJob
from optiplan.service.routes import live
from optiplan.service.sessions import live_sessions
from tests.waiting import PATIENCE, answer_of, wait_until


@pytest.fixture(scope="module")
def reach(problems):
    return (problems / "01_reach.yaml").read_text()


def start(server, text, **given):
    """Start a controller, once the last one has ended."""
    wait_until(lambda: not server.http.get("/api/live").json())
    answer = server.http.post("/api/live", json={"problem": text, **given})
    assert answer.status_code == 201, answer.text
    return answer.json()


def states(server, session):
    """Events of a controller as they come."""
    with server.http.stream("GET", f"/api/live/{session}/events") as lines:
        for line in lines.iter_lines():
            if line.startswith("data:"):
                yield json.loads(line[5:])


def test_the_robot_follows_a_target_that_is_moved(server, reach):
    session = start(server, reach)
    assert session["engine"] == "own"
    assert len(session["joint_names"]) == 7
    seen, wanted = [], None
    for event in states(server, session["id"]):
        if event["type"] == "end":
            break
        seen.append(event)
        if wanted is None:
            wanted = [event["tool"][0], event["tool"][1] + 0.15, event["tool"][2] + 0.05, *event["tool"][3:]]
            assert server.http.post(f"/api/live/{session['id']}/target", json={"pose": wanted}).status_code == 204
            assert server.http.get(f"/api/live/{session['id']}").json()["target"] == session["target"]  # for who comes
        elif len(seen) > 20 and max(event["error"].values()) < 1e-3:
            server.http.delete(f"/api/live/{session['id']}")
        assert len(seen) < 1000
    assert event == {"type": "end", "reason": "stopped"}
    last = seen[-1]
    np.testing.assert_allclose(last["tool"][:3], wanted[:3], atol=1e-3)
    np.testing.assert_allclose(last["target"], wanted, atol=1e-9)
    assert max(one["error"]["position"] for one in seen) > 0.1
    np.testing.assert_allclose(session["target"], seen[0]["tool"], atol=1e-4)
    assert np.ptp([one["q"] for one in seen], axis=0).max() > 0.05
    times = [one["t"] for one in seen]
    assert times == sorted(times)


def test_one_more_than_may_run_is_refused_and_the_id_is_gone_when_it_ends(server, reach):
    session = start(server, reach, engine="ideal")
    assert session["engine"] == "ideal"
    again = server.http.post("/api/live", json={"problem": reach})
    assert again.status_code == 429
    assert "Retry-After" in again.headers
    assert server.service.live.get(session["id"])._job.wall == math.inf  # it goes on as long as it is watched
    listed = server.http.get("/api/live").json()
    assert [one["id"] for one in listed] == [session["id"]]
    heard = []
    watcher = threading.Thread(target=lambda: heard.extend(states(server, session["id"])))
    watcher.start()
    wait_until(lambda: heard)
    assert server.http.delete(f"/api/live/{session['id']}").status_code == 204
    watcher.join(PATIENCE)
    assert heard[-1]["type"] == "end"
    answers = [server.http.post(f"/api/live/{session['id']}/target", json={"pose": [0, 0, 0, 0, 0, 0, 1]})]
    answers.append(server.http.get(f"/api/live/{session['id']}/events"))
    assert [answer.status_code for answer in answers] == [404, 404]
    assert (
        server.http.get(f"/api/live/{session['id']}/recording.zip").status_code == 200
    )  # what was seen of the last one


def test_who_comes_to_watch_as_it_ends_hears_so():
    session = live_sessions.LiveSession({}, SolverJob({"problem": "{}"}, math.inf))
    service = SimpleNamespace(live=SimpleNamespace(get=lambda _: session))

    async def watched():
        stream = await live.events(session.id, service)
        session.publish({"type": "end", "reason": "stopped"})
        return [event async for event in stream.body_iterator]

    (event,) = answer_of(watched())
    assert json.loads(event["data"]) == {"type": "end", "reason": "stopped"}


def test_nothing_runs_on_unseen(server, reach, monkeypatch):
    monkeypatch.setattr(live_sessions, "UNSEEN", 0.5)
    start(server, reach)
    wait_until(lambda: not server.http.get("/api/live").json())


@pytest.mark.parametrize(
    ("given", "word"),
    [({"problem": "version: 1\nrobot: nobody\n"}, "nobody"), ({"problem": "{}", "engine": "steam"}, "engine")],
)
def test_what_cannot_run_says_why(server, given, word):
    answer = server.http.post("/api/live", json=given)
    assert answer.status_code == 422
    assert word in answer.text


@pytest.mark.parametrize("pose", [[0] * 6, [0] * 7, ["x"] * 7, [1e9, 0, 0, 0, 0, 0, 1]])
def test_a_target_is_a_pose(server, pose):
    answer = server.http.post(f"/api/live/{'0' * 32}/target", json={"pose": pose})
    assert answer.status_code == 422


def test_a_target_behind_an_obstacle_is_not_reached_and_nothing_is_touched(problems):
    loop = LiveLoop(load_problem(problems / "02_shelf.yaml"))
    x, y, z, *rotation = loop.state()["tool"]
    loop.aim(np.array([x + 0.1, y + 0.2, z - 0.1, *rotation]))
    nearest = []
    for _ in range(300):
        loop.advance()
        nearest.append(loop.state()["nearest"])
    found = loop.state()
    assert found["status"] in ("limited", "nearest")
    assert found["error"]["position"] > 0.05
    assert found["active"]
    assert min(one["distance"] for one in nearest if one) > 0.004
    assert not np.allclose(found["q"], loop.problem.start)


def test_a_task_is_refused(problems):
    with pytest.raises(InputError, match="task"):
        LiveLoop(load_problem(problems / "40_panda_sorts_cubes.yaml"))
