"""Benches over HTTP: problems by planners by seeds, as runs of the queue."""

import html
import re
import threading
from contextlib import suppress
from urllib.parse import urljoin

import pytest

from optiplan.service.models import BenchRequest
from optiplan.service.refusals import Refusal, busy
from tests.service.routes.test_pages import NAMES
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import wait_until


def finished(server, bench):
    where = f"/api/benches/{bench}"
    wait_until(lambda: server.http.get(where).json()["status"] != "running")
    return server.http.get(where).json()


@pytest.fixture(scope="module")
def bench(server):
    planners = ["quintic", {"name": "rrtconnect", "label": "rrt"}, "cubic"]
    given = {"name": "small", "problems": [QUICK, NO_WAY], "planners": planners, "seeds": [7, 8], "budget": 1.0}
    answer = server.http.post("/api/benches", json=given)
    assert answer.status_code == 202, answer.text
    assert sum(answer.json()["counts"].values()) == 12
    again = server.http.post("/api/benches", json=given).json()
    assert again["id"] == answer.json()["id"]
    return finished(server, answer.json()["id"])


def test_every_problem_meets_every_planner_with_every_seed(server, bench):
    assert bench["status"] == "done"
    cells = {(cell["problem"], cell["planner"]): cell for cell in bench["cells"]}
    assert set(cells) == {
        (problem, planner) for problem in ("free", "shut-in") for planner in ("quintic", "rrt", "cubic")
    }
    good = cells["free", "quintic"]
    assert (good["ended"], good["verified"]) == (2, 2)
    assert good["ratio"] >= 1.0
    assert cells["shut-in", "rrt"]["verified"] == 0
    planner = next(one for one in bench["planners"] if one["planner"] == "quintic")
    assert (planner["ended"], planner["verified"]) == (4, 2)
    run = server.http.get(f"/api/runs/{good['runs'][1]}").json()
    assert (run["planner"], run["seed"], run["name"], run["budget"]) == ("quintic", 8, "free", 1.0)
    assert bench["id"] in [one["id"] for one in server.http.get("/api/benches").json()]


def test_the_report_is_that_of_a_suite(server, bench):
    answer = server.http.get(f"/api/benches/{bench['id']}/report.html")
    assert answer.status_code == 200, answer.text
    page = answer.text
    for word in ("small", "quintic", "rrt", "shut-in", "<polyline", "/compare?run="):
        assert word in page
    assert "script-src" in answer.headers["content-security-policy"]
    assert re.findall(r'(?:href|data-page)="(/[^"]*)"', page) == []  # a proxy may have put the server below a path
    shown = re.findall(r'data-page="([^"]*)"', page)
    assert len(shown) == 2
    for address in shown:
        compared = server.http.get(urljoin(str(answer.url), html.unescape(address)))
        assert NAMES.findall(compared.text) == ["quintic", "rrt", "cubic"]
    scene = next(address for address in re.findall(r'href="([^"#]*)"', page) if "runs/" in address)
    assert server.http.get(urljoin(str(answer.url), scene)).status_code == 200


def test_the_database_is_queried_beside_the_event_loop(server, monkeypatch):
    runs, threads = server.service.archive.runs, []
    waiting = runs.waiting
    monkeypatch.setattr(runs, "waiting", lambda: threads.append(threading.current_thread().name) or waiting())
    given = {"problems": [QUICK], "planners": ["quintic"], "seeds": [51]}
    finished(server, server.http.post("/api/benches", json=given).json()["id"])
    assert threads
    assert all(name.startswith(("read", "write")) for name in threads)


def test_a_bench_is_cancelled_and_forgotten_but_not_its_runs(server):
    given = {
        "name": "long",
        "problems": [NO_WAY],
        "planners": ["rrtconnect"],
        "seeds": list(range(20, 30)),
        "budget": 30.0,
    }
    bench = server.http.post("/api/benches", json=given).json()
    same = server.http.post("/api/benches", json=given | {"planners": [{"name": "rrtconnect", "label": "rrtconnect"}]})
    assert same.json()["id"] == bench["id"]
    assert server.http.post(f"/api/benches/{bench['id']}/cancel").status_code == 200
    found = finished(server, bench["id"])
    assert found["counts"]["cancelled"] >= 9
    assert server.http.delete(f"/api/benches/{bench['id']}").status_code == 204
    assert server.http.get(f"/api/benches/{bench['id']}").status_code == 404
    assert server.http.delete(f"/api/benches/{bench['id']}").status_code == 404
    assert server.http.get(f"/api/runs/{bench['cells'][0]['runs'][0]}").status_code == 200


@pytest.mark.parametrize("how", ["refused", "cancel", "delete"])
def test_a_bench_that_is_not_queued_to_its_end(server, monkeypatch, how):
    """While runs are being queued it is running; then those that never were are told, and none is queued any more."""
    queued, calls, seen = server.service.benches._queued, [], []
    submit = queued.submit

    async def on_the_way(submission, name):
        if len(calls) == 2 and how == "refused":
            raise busy("full", 1.0)
        calls.append(name)
        if len(calls) == 2:
            seen.append(await server.service.benches.one(name))
            if how != "refused":
                await getattr(server.service.benches, how)(name)
        return await submit(submission, name)

    monkeypatch.setattr(queued, "submit", on_the_way)
    seeds = {"refused": [61, 62, 63], "cancel": [64, 65, 66], "delete": [67, 68, 69]}[how]
    given = {"name": how, "problems": [NO_WAY], "planners": ["rrtconnect"], "seeds": seeds, "budget": 30.0}
    answer = server.http.post("/api/benches", json=given)
    assert answer.status_code == {"refused": 429, "cancel": 202, "delete": 404}[how]
    assert len(calls) == 2
    assert seen[0]["status"] == "running"
    assert "deleted" not in seen[0]["counts"]
    bench = seen[0]["id"]
    if how != "delete":
        found = server.http.get(f"/api/benches/{bench}").json()
        assert found["counts"]["not queued"] == 1
        assert "deleted" not in found["counts"]
        server.http.post(f"/api/benches/{bench}/cancel")
        assert finished(server, bench)["counts"] == {"cancelled": 2, "not queued": 1}
        monkeypatch.setattr(queued, "submit", submit)
        server.http.post("/api/benches", json=given)
        assert "not queued" not in server.http.get(f"/api/benches/{bench}").json()["counts"]
        server.http.post(f"/api/benches/{bench}/cancel")
        finished(server, bench)
    for run in seen[0]["cells"][0]["runs"]:  # those of a deleted bench go on
        server.http.post(f"/api/runs/{run}/cancel?everyone=true")


@pytest.mark.parametrize("how", ["queued", "refused"])
def test_a_bench_that_is_submitted_twice_at_once_is_queued(server, monkeypatch, how):
    """The second one is queued, or refused, while the first one queues its last run but one."""
    service, calls = server.service, []
    submit = service.queued.submit
    seeds = {"queued": [71, 72, 73], "refused": [74, 75, 76]}[how]
    given = {"name": "twice", "problems": [QUICK], "planners": ["quintic"], "seeds": seeds}

    async def on_the_way(submission, name):
        calls.append(name)
        number = len(calls)
        if number == 2:
            with suppress(Refusal):
                await service.benches.submit(BenchRequest(**given))
        if number == 3 and how == "refused":
            raise busy("full", 1.0)
        return await submit(submission, name)

    monkeypatch.setattr(service.benches._queued, "submit", on_the_way)
    answer = server.http.post("/api/benches", json=given)
    assert answer.status_code == 202, answer.text
    assert len(calls) == {"queued": 6, "refused": 4}[how]
    assert finished(server, answer.json()["id"])["counts"] == {"done": 3}


def test_a_bench_whose_server_died_while_it_queued_is_not_running(server, bench):
    table = server.service.archive.benches
    content = table.get(bench["id"])["content"]
    table.add("d" * 32, "dead", {**content, "runs": [["free", "rrt", 7, "f" * 32]]}, "0" * 32)
    found = server.http.get(f"/api/benches/{'d' * 32}").json()
    assert (found["status"], found["counts"]) == ("done", {"not queued": 1})
    assert server.http.delete(f"/api/benches/{'d' * 32}").status_code == 204


def test_runs_that_were_deleted_are_counted_as_such(server):
    given = {"name": "gone", "problems": [QUICK], "planners": ["quintic"], "seeds": [41, 42]}
    bench = finished(server, server.http.post("/api/benches", json=given).json()["id"])
    assert server.http.delete(f"/api/runs/{bench['cells'][0]['runs'][0]}").status_code == 204
    found = server.http.get(f"/api/benches/{bench['id']}").json()
    (cell,) = found["cells"]
    assert (cell["kept"], cell["ended"], cell["pages"]) == (1, 1, cell["runs"][1:])
    assert found["counts"] == {"done": 1, "deleted": 1}
    assert server.http.get(f"/api/benches/{bench['id']}/report.html").status_code == 200


@pytest.mark.parametrize(
    ("change", "status", "word"),
    [
        ({"planners": ["nobody"]}, 422, "nobody"),
        ({"planners": ["quintic", {"name": "trajopt", "options": {"nonsense": 1}}]}, 422, "nonsense"),
        ({"planners": ["quintic", "quintic"]}, 422, "twice"),
        ({"problems": [QUICK, QUICK]}, 422, "twice"),
        ({"problems": []}, 422, "problems"),
        ({"problems": ["version: 1\nrobot: none\n"]}, 422, "none"),
        ({"problems": ["0" * 64]}, 404, "problem"),
        ({"seeds": list(range(100)), "problems": [{"version": 1}]}, 422, "robot"),
        ({"budget": 1e9}, 422, "budget"),
    ],
)
def test_what_is_wrong_with_a_bench_is_said(server, change, status, word):
    given = {"problems": [QUICK], "planners": ["quintic"], **change}
    answer = server.http.post("/api/benches", json=given)
    assert answer.status_code == status, answer.text
    assert word in answer.text


def test_more_than_may_wait_is_refused_before_any_is_queued(server, monkeypatch):
    monkeypatch.setattr("optiplan.service.benches.MOST", 3)
    before = server.http.get("/api/runs?limit=1").json()["counts"]
    given = {"problems": [QUICK], "planners": ["quintic"], "seeds": [901, 902, 903, 904]}
    assert server.http.post("/api/benches", json=given).status_code == 422
    monkeypatch.setattr("optiplan.service.benches.MOST", 2000)
    with monkeypatch.context() as patch:
        patch.setattr(server.service.archive.runs, "waiting", lambda: 998)
        answer = server.http.post("/api/benches", json=given)
    assert answer.status_code == 429
    assert "Retry-After" in answer.headers
    finished(server, server.http.post("/api/benches", json=given | {"seeds": [901, 902]}).json()["id"])
    before = server.http.get("/api/runs?limit=1").json()["counts"]
    object.__setattr__(server.service.settings, "queue", 1)
    try:
        answer = server.http.post("/api/benches", json=given)
        assert server.http.post("/api/benches", json=given | {"seeds": [901, 902]}).status_code == 202, "they are there"
    finally:
        object.__setattr__(server.service.settings, "queue", 1000)
    assert answer.status_code == 422
    assert "2 new runs; expected at most 1" in answer.text
    assert server.http.get("/api/runs?limit=1").json()["counts"] == before
