"""Motions that are executed on a server by the driver `file`, which does as it is told."""

import asyncio
import json
import os
import signal
import time

import anyio
import numpy as np
import pytest

import optiplan as op
from optiplan.api import driving
from optiplan.problem.load import load_problem
from optiplan.robot.robot import load_robot
from optiplan.service.execution.executing import Executing
from optiplan.service.execution.solver_pool import SolverJob
from optiplan.service.refusals import Refusal
from optiplan.service.sessions import execution_sessions
from optiplan.service.sessions.execution_sessions import ExecutionSession
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import PATIENCE, answer_of, wait_until

ROUTE = "/api/executions"
AWAY = [-1, 0.18, 1, 0, 0, 0, 1]
SLOW = {"override": 0.1}
"""The quick motion takes ten seconds then, in which a test does what it does."""


def events(server, execution):
    """Events of an execution as they come."""
    with server.http.stream("GET", f"{ROUTE}/{execution}/events") as lines:
        for line in lines.iter_lines():
            if line.startswith("data:"):
                yield json.loads(line[5:])


def start(server, **given):
    """Start the quick problem, or another motion, once the driver is free."""
    wait_until(lambda: all(one["ended"] is not None for one in server.http.get(ROUTE).json()["executions"]))
    asked = {
        "driver": "paper",
        **({} if {"run", "execution"} & set(given) else {"problem": QUICK, "budget": 5.0}),
        **given,
    }
    answer = server.http.post(ROUTE, json=asked)
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def post(server, execution, what, **given):
    answer = server.http.post(f"{ROUTE}/{execution}/{what}", json=given)
    assert answer.status_code == 200, answer.text
    return answer.json()


def view(server, execution):
    return server.http.get(f"{ROUTE}/{execution}").json()


def phase(server, execution):
    return (view(server, execution)["state"] or {}).get("phase")


def process_of(server):
    """The process that moves the robot."""
    (slot,) = [one for one in server.service.pool._slots if one._lane == "execution"]
    return slot._worker.pid


@pytest.fixture(scope="module")
def planned(server):
    """A run of the quick problem, from its start to its goal."""
    return server.ended(server.submit(seed=71)["id"])


def test_a_motion_is_steered_to_its_end(server, planned):
    execution = start(server, run=planned["id"], **SLOW)
    listed = server.http.get(ROUTE).json()
    assert listed["executions"][0] | {"duration": 0.0, "rate": 0.0} == {
        "id": execution,
        "run": planned["id"],
        "name": "free",
        "robot": "planar2r",
        "driver": "paper",
        "duration": 0.0,
        "rate": 0.0,
        "joint_names": ["shoulder", "elbow"],
        "velocity_limits": [2.0, 2.0],
        "lease": None,
        "ended": None,
        "clean": None,
    }
    assert listed["drivers"] == ["paper"]
    again = server.http.post(ROUTE, json={"run": planned["id"], "driver": "paper"})
    assert again.status_code == 409
    assert execution in again.json()["error"]
    post(server, execution, "pause")
    wait_until(lambda: phase(server, execution) == "paused")
    place = view(server, execution)["state"]["place"]
    post(server, execution, "resume")
    wait_until(lambda: view(server, execution)["state"]["place"] > place + 0.02)
    post(server, execution, "reverse")
    wait_until(lambda: view(server, execution)["state"]["speed"] < 0.0)
    drawn = server.http.get(f"{ROUTE}/{execution}/scene").json()
    assert drawn["scene"]["runs"][0]["duration"] == pytest.approx(planned["duration"])
    post(server, execution, "resume")
    assert post(server, execution, "override", speed=1.0)["q"]
    seen = list(events(server, execution))
    assert seen[-1] == {"type": "end", "reason": "done", "clean": True}
    assert seen[-2]["phase"] == "done"
    assert seen[-2]["q"] == pytest.approx([-0.5, 1.2])
    assert list(events(server, execution)) == seen[-1:]
    refused = server.http.post(f"{ROUTE}/{execution}/pause")
    assert refused.status_code == 409
    assert "has ended: done" in refused.json()["error"]
    assert view(server, execution)["clean"] is True


def test_an_obstacle_in_the_way_is_waited_for(server, planned):
    execution = start(server, run=planned["id"], **SLOW)
    wrong = server.http.post(f"{ROUTE}/{execution}/obstacles", json={"poses": {"near": AWAY}})
    assert wrong.status_code == 422
    assert wrong.json()["issues"][0]["expected"] == "an obstacle of the scene: far"
    at = [*load_robot("planar2r").fk([-0.5, 1.2]).position, 0, 0, 0, 1]
    post(server, execution, "obstacles", poses={"far": at})
    wait_until(lambda: phase(server, execution) == "waiting")
    state = view(server, execution)["state"]
    assert "would meet 'far'" in state["reason"]
    assert state["obstacles"] == {"far": pytest.approx(at)}
    post(server, execution, "obstacles", poses={"far": AWAY})
    wait_until(lambda: phase(server, execution) == "running")
    post(server, execution, "stop", reason="the shift is over")
    assert list(events(server, execution))[-1] == {"type": "end", "reason": "the shift is over", "clean": True}


def test_a_motion_takes_over_on_the_way(server, planned):
    execution = start(server, run=planned["id"], override=0.3)
    state = post(server, execution, "state", latency=1.0)
    assert set(state) == {"joints", "velocity", "acceleration"}
    given = {"problem": QUICK, "planner": "trajopt", "budget": 0.3, "start": state, "goal": {"joints": [0.2, 0.6]}}
    better = server.http.post("/api/plan", json=given).json()
    assert better["verified"], better
    assert post(server, execution, "splice", run=better["id"]) == {"taken": True, "reason": ""}
    *states, end = events(server, execution)
    assert end["clean"]
    assert states[-1]["motion"] == 1
    assert states[-1]["q"] == pytest.approx([0.2, 0.6])
    execution = start(server, run=planned["id"], override=0.3)
    assert "not on the way" in post(server, execution, "splice", run=better["id"])["reason"]
    assert not list(events(server, execution))[-1]["clean"]


def test_a_motion_that_takes_over_after_its_caller_gave_up_is_drawn():
    first, second = {"problem": "first"}, {"problem": "second"}
    session = execution_sessions.ExecutionSession({}, SolverJob(first, 1.0))
    with pytest.raises(Refusal, match="did not answer within"):
        answer_of(session.ask("splice", 0.01, request=second))
    session.take({"state": {"t": 0.0, "q": [0.0], "v": [0.0], "motion": 1}})
    assert session.motion == first  # until its process says which one that is
    session.take({"reply": 1, "taken": True})
    assert session.motion == second


def test_without_its_client_a_lease_ends_in_a_stop(server, planned):
    execution = start(server, run=planned["id"], lease=0.5, **SLOW)
    for _ in range(4):
        time.sleep(0.2)
        post(server, execution, "alive")
    *_, end = events(server, execution)
    assert end == {"type": "end", "reason": "no client has renewed its lease for 0.5 s", "clean": False}


def test_a_process_that_dies_is_reported(server, planned, caplog):
    execution = start(server, run=planned["id"], **SLOW)
    metrics = server.http.get("/metrics").text
    assert "optiplan_executions_running 1" in metrics
    os.kill(process_of(server), signal.SIGKILL)
    *_, end = events(server, execution)
    assert not end["clean"]
    assert "its process ended: crashed" in end["reason"]
    assert view(server, execution)["ended"] == end["reason"]
    assert f"the execution {execution}" in caplog.text
    assert server.service.executions.unclean > 0


def test_a_process_that_hangs_makes_the_server_unready_and_is_ended(server, planned, monkeypatch):
    monkeypatch.setattr(execution_sessions, "LOST", 2.0)
    execution = start(server, run=planned["id"], **SLOW)
    os.kill(process_of(server), signal.SIGSTOP)
    wait_until(lambda: server.http.get("/readyz").status_code == 503)
    assert execution in server.http.get("/readyz").json()["error"]
    *_, end = events(server, execution)
    assert "said nothing" in end["reason"]
    wait_until(lambda: server.http.get("/readyz").status_code == 200)


def test_a_process_that_is_asked_to_end_stops_the_robot_first(server, planned):
    execution = start(server, run=planned["id"], **SLOW)
    os.kill(process_of(server), signal.SIGTERM)
    *states, end = events(server, execution)
    assert end["reason"] == "the process was asked to end"
    assert states[-1]["phase"] == "stopped"
    assert states[-1]["speed"] == 0.0


@pytest.mark.parametrize(
    ("given", "status", "word"),
    [
        ({}, 422, "either run, problem or execution"),
        ({"run": "0" * 32, "problem": QUICK}, 422, "either run, problem or execution"),
        ({"run": "0" * 32}, 404, "there is no run"),
        ({"execution": "0" * 32}, 404, "there is no execution"),
        ({"run": "0" * 32, "trajectory": {}}, 422, "a problem beside the trajectory"),
        ({"problem": QUICK, "driver": "papers"}, 422, "did you mean 'paper'"),
        ({"problem": QUICK, "override": 1.5}, 422, "body.override"),
        ({"problem": QUICK, "lease": 1e9}, 422, "body.lease"),
        ({"problem": QUICK, "trajectory": {"joint_names": ["a"]}}, 422, "trajectory"),
        ({"problem": "version: 1\nrobot: nobody\n"}, 422, "nobody"),
        ({"problem": NO_WAY, "budget": 0.3}, 422, "no verified motion was found"),
    ],
)
def test_what_cannot_be_executed_says_why(server, given, status, word):
    answer = server.http.post(ROUTE, json={"driver": "paper", **given})
    assert (answer.status_code, word in answer.text) == (status, True), answer.text


@pytest.mark.parametrize(
    ("what", "given"),
    [
        ("override", {"speed": -0.1}),
        ("override", {}),
        ("obstacles", {"poses": {}}),
        ("obstacles", {"poses": {"far": [0] * 7}}),
        ("obstacles", {"poses": {"far": [1e9, 0, 0, 0, 0, 0, 1]}}),
        ("obstacles", {"poses": {"far": [0, 0, 0, 0, 0, 0, 1]}, "velocities": {"far": [0]}}),
        ("obstacles", {"poses": {"far": [0, 0, 0, 0, 0, 0, 1]}, "velocities": {"near": [0, 0, 0]}}),
        ("splice", {"problem": QUICK}),
        ("state", {"latency": -1}),
        ("stop", {"reason": ""}),
    ],
)
def test_bad_words_to_an_execution_are_refused(server, what, given):
    answer = server.http.post(f"{ROUTE}/{'0' * 32}/{what}", json=given)
    assert answer.status_code == 422
    assert answer.json()["issues"]


def test_a_motion_that_breaks_a_limit_is_not_executed(server, planned):
    motion = server.http.get(f"/api/runs/{planned['id']}/trajectory.json").json()
    slow = QUICK + "limits: {velocity: 0.05}\n"
    refused = server.http.post(ROUTE, json={"driver": "paper", "problem": slow, "trajectory": motion})
    assert (refused.status_code, "not verified: velocity" in refused.text) == (422, True), refused.text
    first = start(server, problem=QUICK, trajectory=motion)
    assert list(events(server, first))[-1]["clean"]
    execution = start(server, execution=first)
    assert list(events(server, execution))[-1]["clean"]


class WithoutSensors:
    """A robot whose states lack positions after a while; it waits for set-points."""

    def __init__(self, run, *, state, rate=500.0):
        self.names, self.rate, self.given, self.q = tuple(run.problem.robot.joint_names), rate, state, run.problem.start
        self.sent = 0

    def capabilities(self):
        return op.Capabilities("without sensors", self.names, self.rate, measures=True, waits=True)

    def state(self):
        q = np.array(self.given) if self.sent > 20 else self.q
        return op.Measurement(q, np.zeros(2), self.sent / self.rate)

    def send(self, tick):
        self.q, self.sent = tick.q, self.sent + 1

    def stop(self, reason):
        pass


class Channel:
    """Keeps what a process would tell the server, as text."""

    def __init__(self):
        self.states = []

    def answered(self, answer, files):
        self.about = answer

    def heard(self, patience):
        time.sleep(patience)
        return []

    def state(self, message):
        self.states.append(json.loads(json.dumps(message, allow_nan=False))["state"])


@pytest.fixture
def requested(tmp_path, monkeypatch):
    """The run of the quick problem, and a request to execute it by `WithoutSensors`."""
    monkeypatch.setitem(driving.DRIVERS, "test", f"{__name__}:WithoutSensors")
    (tmp_path / "quick.yaml").write_text(QUICK)
    run = op.plan(load_problem(tmp_path / "quick.yaml"))
    request = {"motion": json.dumps(run.trajectory.to_dict()), "driver": "test", "rate": 100.0, "patience": 0.1}
    return run, request | {"override": 0.5, "clearance": 0.0, "deviation": None, "paused": False, "lease": None}


def test_why_another_motion_does_not_take_over_is_answered_before_the_next_tick(requested):
    run, request = requested
    executing = Executing(lambda _: run.problem, {**request, "driver_options": {"state": [0.0, 0.0]}})
    executing._execution._loop.tick = executing._executor.tick(0.01)
    refused = executing.do_splice({"request": request})
    assert (refused["taken"], "not on the way" in refused["reason"]) == (False, True)


@pytest.mark.parametrize("state", [[np.nan, 1.0], [1.0]])
def test_a_state_without_positions_ends_in_a_stop_that_is_seen(requested, state):
    run, request = requested
    executing, channel = Executing(lambda _: run.problem, {**request, "driver_options": {"state": state}}), Channel()
    assert executing._driver.rate == 100.0  # it is asked of the driver, too
    end = executing.run(channel)
    assert "2 finite positions" in end["reason"]
    assert (channel.states[-1]["phase"], channel.states[-1]["reason"]) == ("stopped", end["reason"])
    session = ExecutionSession({}, SolverJob({}, 1.0))
    for one in channel.states:
        session.take({"state": one})
    assert {len(row) for row in session.seen._rows} == {1 + 3 * 2}


def test_a_watcher_that_is_slow_still_sees_the_end():
    """Its queue is full of states by then."""
    seen = []

    async def watched():
        session, begun, go_on = ExecutionSession({}, SolverJob({}, 1.0)), asyncio.Event(), asyncio.Event()

        async def watch():
            begun.set()
            async for event in session.events(anyio.Event()):
                seen.append(event["type"])
                await go_on.wait()

        task = asyncio.ensure_future(watch())
        await begun.wait()
        for k in range(8):
            session.take({"state": {"t": 0.04 * k, "q": [0.0], "v": [0.0]}})
        session.end("done", clean=True)
        go_on.set()
        await asyncio.wait_for(task, PATIENCE)

    answer_of(watched())
    assert seen[-1] == "end"
