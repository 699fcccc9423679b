"""Runs over HTTP: submitted, watched, fetched, cancelled, deleted; the same submission is the same run."""

import csv
import io
import json
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from xml.etree import ElementTree

import numpy as np
import pytest
from ruamel.yaml import YAML

import optiplan as op
from optiplan.problem.load import load_problem
from optiplan.robot.frames import frame_pose
from optiplan.runs.run_folder import load_run
from optiplan.runs.stored_runs import judged
from optiplan.service.execution import run_queue
from optiplan.service.refusals import Refusal
from optiplan.service.routes.runs import exported
from optiplan.trajectory.trajectory import Trajectory
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import PATIENCE, answer_of


def test_a_submission_wakes_who_takes_it(server, monkeypatch):
    for wait in ("AWAKE", "ASLEEP"):
        monkeypatch.setattr(run_queue, wait, 2 * PATIENCE)
    for seed in (970, 971):  # before the second, nothing was to be looked for
        assert server.ended(server.submit(seed=seed)["id"])["verified"]


def test_a_submission_becomes_a_verified_run(server):
    answer = server.submit(seed=1)
    assert answer["status"] in ("queued", "running", "done")
    assert len(answer["id"]) == 32
    done = server.ended(answer["id"])
    assert done["status"] == "done"
    assert done["verified"] is True
    assert done["failure"] is None
    assert done["timings"]["plan"] > 0.0
    assert done["duration"] > 0.0
    assert done["submitted"] <= done["started"] <= done["finished"]


def test_the_run_folder_verifies_offline(server, tmp_path):
    done = server.ended(server.submit(seed=2)["id"])
    with zipfile.ZipFile(io.BytesIO(server.http.get(f"/api/runs/{done['id']}/run.zip").content)) as archive:
        assert sorted(archive.namelist()) == ["run.json", "trajectory.json"]
        archive.extractall(tmp_path / "run")
    (tmp_path / "problem.yaml").write_text(QUICK)
    problem = load_problem(tmp_path / "problem.yaml")
    assert done["problem"] == problem.hash
    assert judged(problem, load_run(tmp_path / "run")).verified


def test_the_files_of_a_run_are_those_of_the_command_line(server, tmp_path):
    """A platform on mecanum wheels, whose rates stand beside the samples of the joints."""
    problem = {"version": 1, "name": "drive", "robot": "delbot", "group": "base", "planner": "quintic"}
    problem |= {"start": {"configuration": "home"}, "goal": {"joints": [0.3, 0.1, 0.2]}}
    op.plan(op.load_problem(problem)).save(tmp_path)
    given = {"problem": problem, "budget": 5.0, "rate": 50}
    waited = server.http.post("/api/plan", json=given).json()
    queued = server.ended(server.submit(problem=problem)["id"])
    own = {name: json.loads((tmp_path / name).read_text()) for name in ("run.json", "trajectory.json")}
    assert len(own["trajectory.json"]["wheels"]) == len(own["trajectory.json"]["t"])
    for run in (waited["id"], queued["id"]):
        for name, wanted in own.items():
            found = server.http.get(f"/api/runs/{run}/{name}").json()
            assert found.keys() == wanted.keys()
            assert name == "run.json" or found == wanted
    assert waited["trajectory"].keys() == own["trajectory.json"].keys()
    assert len(waited["trajectory"]["wheels"]) == len(waited["trajectory"]["t"]) < len(own["trajectory.json"]["t"])


def test_a_program_is_not_written_where_it_would_be_late(server):
    """Its motion runs slower, to end on a cycle, and is proved again; what moves does not wait for that."""
    ball = {"name": "ball", "shape": {"sphere": 0.05}, "pose": {"position": [-0.8, 0.8, 1.5]}}
    harmless = ball | {"motion": {"polynomial": [[0], [0], [0, -0.1]], "until": 1.0}}
    start, goal = ([pan, -1.5, 1.5, -1.5, -1.5, 0] for pan in (0.0, 0.1))
    alone = op.plan(op.Problem("ur5", start, goal), "quintic").duration
    x, y, z = frame_pose(op.load_robot("ur5"), np.array(goal), "tool0").translation
    # It falls onto the place where the arm ends, 0.5 s after the arm has come; at 0.5 Hz the arm is there at 2 s.
    late = {"polynomial": [[0], [0], [0, -0.9 / (alone + 0.5)]], "until": alone + 0.5}
    falling = {"name": "ball", "shape": {"sphere": 0.05}, "pose": {"position": [x, y, z + 1.0]}, "motion": late}
    for body, status in ((ball, 200), (harmless, 200), (falling, 422)):
        problem = {
            "version": 1,
            "robot": "ur5",
            "start": {"joints": start},
            "goal": {"joints": goal},
            "scene": {"obstacles": [body]},
            "planner": "quintic",
        }
        run = server.submit(problem=problem)["id"]
        assert server.ended(run)["verified"]
        assert server.http.get(f"/api/runs/{run}/export.urscript").status_code == 200
        answer = server.http.get(f"/api/runs/{run}/export.urscript?rate=0.5")
        assert answer.status_code == status, answer.text
        assert ("not verified when it is slowed down" in answer.text) is (status == 422)
        assert server.http.get(f"/api/runs/{run}/export.csv").status_code == 200


def test_exports(server):
    run = server.ended(server.submit(seed=2)["id"])["id"]
    motion = server.http.get(f"/api/runs/{run}/trajectory.json").json()
    rows = list(csv.reader(io.StringIO(server.http.get(f"/api/runs/{run}/export.csv?rate=50").text)))
    assert rows[0][0] == "t"
    assert float(rows[-1][0]) == motion["t"][-1]
    arrays = np.load(io.BytesIO(server.http.get(f"/api/runs/{run}/export.npz").content))
    assert arrays["q"].shape[1] == 2
    unknown = server.http.get(f"/api/runs/{run}/export.doc")
    assert unknown.status_code == 404
    assert "csv" in unknown.json()["error"]


def test_the_same_submission_is_answered_from_the_store(server):
    first = server.ended(server.submit(seed=3)["id"])
    again = server.submit(seed=3)
    assert (again["id"], again["status"], again["finished"]) == (first["id"], "done", first["finished"])
    as_data = json.loads(json.dumps(load_problem_data()))
    assert server.submit(problem=as_data, seed=3)["id"] == first["id"]
    others = [server.submit(seed=4)["id"], server.submit(seed=3, budget=4.0)["id"]]
    others.append(server.submit(seed=3, planner="cubic")["id"])
    assert len({first["id"], *others}) == 4


class Unverified:
    """A service, and its archive, whose one run has a motion that is not verified."""

    @property
    def archive(self):
        return self

    async def run(self, run):
        return {"id": run, "status": "done", "verified": False}

    async def content(self, record, name):
        motion = Trajectory(("a",), np.array([0.0, 1.0]), np.array([[[0.0], [1.0]]]))
        return json.dumps(
            motion.to_dict() if name == "trajectory.json" else {"problem": {"start": {}, "goal": {}}}
        ).encode()

    async def read(self, made):
        return made()


def test_a_motion_that_is_not_verified_is_no_program():
    with pytest.raises(Refusal, match="not verified"):
        answer_of(exported("one", "csv", Unverified()))
    written = answer_of(exported("one", "csv", Unverified(), unverified=True))
    assert written.body.decode().startswith("t,")


def load_problem_data():
    """The quick problem as data."""
    return YAML(typ="safe").load(QUICK)


def test_no_plan_is_failed_with_a_reason_and_kept(server):
    answer = server.submit(problem=NO_WAY, budget=1.0)
    failed = server.ended(answer["id"])
    assert failed["status"] == "failed"
    assert failed["verified"] is False
    assert failed["failure"]["kind"]
    assert failed["failure"]["detail"]
    assert server.http.get(f"/api/runs/{failed['id']}/run.json").json()["failure"]["kind"] == failed["failure"]["kind"]
    assert server.http.get(f"/api/runs/{failed['id']}/trajectory.json").status_code == 404
    assert server.submit(problem=NO_WAY, budget=1.0)["status"] == "failed"  # the planner's answer: not tried again


def test_events_of_a_run_end_with_its_end(server):
    run = server.submit(problem=NO_WAY, budget=1.5)["id"]
    with server.http.stream("GET", f"/api/runs/{run}/events") as lines:
        assert lines.headers["content-type"].startswith("text/event-stream")
        events = [json.loads(line[5:]) for line in lines.iter_lines() if line.startswith("data:")]
    assert events[0]["type"] == "status"
    assert any(event["type"] == "stage" for event in events)
    assert events[-1] == {"type": "end", "status": "failed", "verified": False}


@pytest.mark.parametrize("planner", ["trajopt", "rrtconnect"])
def test_best_so_far_is_verified_and_ends_with_the_answer(server, problems, planner):
    run = server.submit(problem=(problems / "01_reach.yaml").read_text(), planner=planner)["id"]
    with server.http.stream("GET", f"/api/runs/{run}/events") as lines:
        events = [json.loads(line[5:]) for line in lines.iter_lines() if line.startswith("data:")]
    best = [event["duration"] for event in events if event["type"] == "best"]
    assert best
    assert best == sorted(best, reverse=True)
    assert server.ended(run)["duration"] == best[-1]
    with server.http.stream("GET", f"/api/runs/{run}/events") as lines:
        again = [json.loads(line[5:]) for line in lines.iter_lines() if line.startswith("data:")]
    assert [event["duration"] for event in again if event["type"] == "best"] == best, "who comes late sees it too"
    assert again[-1] == {"type": "end", "status": "done", "verified": True}
    assert sum(event["type"] == "end" for event in again) == 1


def test_a_running_run_is_cancelled_within_a_second(server):
    run = server.submit(problem=NO_WAY, budget=60.0, seed=5)["id"]
    with server.http.stream("GET", f"/api/runs/{run}/events") as lines:
        assert any('"stage"' in line for line in lines.iter_lines()), "it has begun to plan"
    began = time.monotonic()
    assert server.http.post(f"/api/runs/{run}/cancel").status_code == 200
    assert server.ended(run)["status"] == "cancelled"
    assert time.monotonic() - began < 20.0  # of the 60 that it had, on a busy machine
    again = server.submit(problem=NO_WAY, budget=60.0, seed=5)
    assert again["id"] == run
    assert again["status"] == "queued"
    server.http.post(f"/api/runs/{run}/cancel")
    assert server.ended(run)["status"] == "cancelled"


def test_cancelling_a_shared_run_does_not_end_that_of_another(server):
    given = {"problem": NO_WAY, "budget": 60.0, "seed": 41}
    first, second = (server.submit(**given) for _ in range(2))
    run = first["id"]
    assert second["id"] == run
    assert second["submission"] != first["submission"]
    cancel = f"/api/runs/{run}/cancel"
    refused = server.http.post(cancel)
    assert refused.status_code == 409
    assert "submitted 2 times" in refused.json()["error"]
    for _ in range(2):  # also when it is asked for again
        left = server.http.post(cancel, params={"submission": first["submission"]})
        assert left.json()["status"] in ("queued", "running")
    time.sleep(0.5)
    assert server.http.get(f"/api/runs/{run}").json()["status"] in ("queued", "running")
    server.http.post(cancel, params={"submission": second["submission"]})
    assert server.ended(run)["status"] == "cancelled"
    for _ in range(2):
        server.submit(**given)
    server.http.post(cancel, params={"everyone": True})
    assert server.ended(run)["status"] == "cancelled"
    alone = server.submit(**given)["submission"]
    assert server.http.post(cancel, params={"submission": alone}).status_code == 200
    assert server.ended(run)["status"] == "cancelled", "those of a former try want nothing any more"


def test_clients_and_benches_cancel_their_own(server):
    with op.Client(server.url) as ours, op.Client(server.url) as theirs:
        shared = op.load_problem({**YAML(typ="safe").load(NO_WAY), "seed": 42})
        run = ours.submit(shared, budget=60.0)
        assert ours.submit(shared, budget=60.0) == theirs.submit(shared, budget=60.0) == run
        ours.cancel(run)
        assert ours.status(run)["status"] in ("queued", "running")
        asked = {"problems": [dict(shared.source)], "planners": ["rrtconnect"], "seeds": [42], "budget": 60.0}
        bench = server.http.post("/api/benches", json=json.loads(json.dumps(asked))).json()
        assert [cell["runs"] for cell in bench["cells"]] == [[run]]
        theirs.cancel(run)
        assert ours.status(run)["status"] in ("queued", "running")
        server.http.post(f"/api/benches/{bench['id']}/cancel")
        assert server.ended(run)["status"] == "cancelled"


def test_a_queued_run_is_cancelled_at_once(server):
    long = server.submit(problem=NO_WAY, budget=60.0, seed=6)["id"]
    waiting = server.submit(problem=NO_WAY, budget=60.0, seed=7)["id"]
    assert server.http.post(f"/api/runs/{waiting}/cancel").json()["status"] == "cancelled"
    server.http.post(f"/api/runs/{long}/cancel")
    assert server.ended(long)["status"] == "cancelled"


def test_a_deadline_passes_also_while_no_process_is_free(server, monkeypatch):
    monkeypatch.setattr(server.service.pool, "submit", lambda lane, job: job.future)
    answer = server.http.post("/api/plan", json={"problem": QUICK, "deadline": 0.2})
    assert (answer.status_code, answer.json()["error"]) == (504, "deadline")


def test_a_deadline_ends_a_run(server):
    run = server.submit(problem=NO_WAY, budget=60.0, deadline=1.0)["id"]
    began = time.monotonic()
    failed = server.ended(run)
    planned = failed["failure"]["kind"] == "no-path"  # the planner said so in time; else its process was ended
    assert planned or failed["failure"]["kind"] == "deadline"
    assert (failed["status"], failed["page"]) == ("failed", planned)
    assert server.http.get(f"/runs/{run}").status_code == (200 if planned else 404)
    assert time.monotonic() - began < 30.0  # of the 60 that it had, on a busy machine


def test_only_ended_runs_are_deleted(server):
    run = server.submit(problem=NO_WAY, budget=60.0, seed=8)["id"]
    assert server.http.delete(f"/api/runs/{run}").status_code == 409
    server.http.post(f"/api/runs/{run}/cancel")
    server.ended(run)
    assert server.http.delete(f"/api/runs/{run}").status_code == 204
    assert server.http.get(f"/api/runs/{run}").status_code == 404
    assert server.http.delete(f"/api/runs/{run}").status_code == 404


def test_runs_are_listed_with_the_last_first(server):
    first, second = server.submit(seed=11)["id"], server.submit(seed=12)["id"]
    server.ended(first)
    server.ended(second)
    listed = server.http.get("/api/runs?limit=500").json()
    ids = [run["id"] for run in listed["runs"]]
    assert ids.index(second) < ids.index(first)
    assert listed["counts"]["done"] >= 2


def test_plan_waits_and_gives_the_motion(server):
    answer = server.http.post("/api/plan", json={"problem": QUICK, "seed": 21})
    assert answer.status_code == 200
    run = answer.json()
    assert run["status"] == "done"
    assert run["verified"] is True
    assert len(run["trajectory"]["joint_names"]) == 2
    stored = server.http.get(f"/api/runs/{run['id']}").json()  # waits for what is being kept
    assert stored["status"] == "done"
    assert server.http.get(f"/api/runs/{run['id']}/trajectory.json").json() == run["trajectory"]


def test_what_is_kept_under_an_id_is_what_was_answered_with_it(server, problems):
    """Each attempt is a run of its own: a plan within a budget of time is another one the next time."""
    given = {"problem": (problems / "05_cage.yaml").read_text(), "budget": 0.25, "seed": 0}
    with ThreadPoolExecutor(2) as callers:  # also while the one before is being kept
        answers = list(callers.map(lambda _: server.http.post("/api/plan", json=given), range(6)))
    runs = [answer.json() for answer in answers]
    assert len({run["id"] for run in runs}) == len(runs)
    for run in runs:
        kept = server.http.get(f"/api/runs/{run['id']}").json()
        assert [kept[key] for key in ("status", "duration", "page")] == [run["status"], run["duration"], True]
        assert run["page"]
        motion = server.http.get(f"/api/runs/{run['id']}/trajectory.json")
        assert (motion.json() if motion.status_code == 200 else None) == run["trajectory"]
    queued = server.submit(**given)
    assert queued["id"] not in {run["id"] for run in runs}
    server.ended(queued["id"])


def test_plan_without_an_answer_says_why(server):
    run = server.http.post("/api/plan", json={"problem": NO_WAY, "budget": 0.5}).json()
    assert run["status"] == "failed"
    assert run["trajectory"] is None
    assert run["failure"]["detail"]


def test_the_run_page_draws_what_was_planned(server):
    run = server.ended(server.submit(seed=1)["id"])["id"]
    page = server.http.get(f"/runs/{run}")
    assert page.status_code == 200
    assert "free" in page.text
    assert "frame-ancestors" in page.headers["content-security-policy"]


def test_pictures_show_the_scene_and_the_path_within_it(server, problems):
    text = (problems / "01_reach.yaml").read_text()
    run = server.submit(problem=text, planner="rrtconnect")["id"]
    server.ended(run)
    answer = server.http.get(f"/api/runs/{run}/thumbnail.svg")
    assert answer.headers["content-type"] == "image/svg+xml"
    root = ElementTree.fromstring(answer.text)
    width, height = (float(x) for x in root.get("viewBox").split()[2:])
    line = np.array([pair.split(",") for pair in root.find("{*}polyline").get("points").split()], float)
    assert len(line) > 30
    assert np.ptp(line, axis=0).max() > 20.0
    assert (line >= 0.0).all()
    assert (line <= [width, height]).all()
    assert root.find("{*}image").get("href").startswith("data:image/png;base64,")
    assert server.http.get(f"/api/runs/{run}/thumbnail.svg").content == answer.content
    stored = server.http.post("/api/problems", json={"problem": text}).json()["hash"]
    scene = server.http.get(f"/api/problems/{stored}/thumbnail.svg")
    assert scene.status_code == 200
    assert "polyline" not in scene.text
    assert server.http.get(f"/api/problems/{'0' * 64}/thumbnail.svg").status_code == 404


@pytest.mark.parametrize(("rate", "least", "most"), [(0, 0, 0), (20, 20, 25), (None, 190, 10_000)])
def test_who_waits_says_how_many_samples_and_the_stored_file_has_all(server, rate, least, most):
    given = {"problem": QUICK, "seed": 70 + least, "budget": 5.0, "rate": rate}
    answer = server.http.post("/api/plan", json=given).json()
    motion = answer["trajectory"]
    per_second = len(motion.get("t", [])) / answer["duration"]
    assert least <= per_second <= most
    stored = server.http.get(f"/api/runs/{answer['id']}/trajectory.json").json()
    assert stored["pieces"] == motion["pieces"]
    assert len(stored["t"]) / answer["duration"] > 190
    assert server.http.post("/api/plan", json={**given, "rate": -1}).status_code == 422
    assert server.http.post("/api/runs", json={**given, "rate": 5}).status_code == 422


def test_a_bug_is_told_as_data(server, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("secret")

    monkeypatch.setattr(server.service.archive.runs, "newest", broken)
    answer = server.http.get("/api/runs")
    assert answer.status_code == 500
    assert answer.json()["issues"] == []
    assert answer.headers["X-Request-Id"] in answer.json()["error"]
    assert "secret" not in answer.text
