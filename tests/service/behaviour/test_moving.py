"""Plans from a robot that moves: over HTTP and from a cell, verified from the very state that was given."""

import numpy as np
import pytest

from optiplan.problem.load import load_problem
from optiplan.service.cell import CellPlanner
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify


@pytest.fixture(scope="module")
def first(server, problems):
    """A motion on its way."""
    answer = server.http.post("/api/plan", json={"problem": (problems / "01_reach.yaml").read_text(), "budget": 3.0})
    assert answer.status_code == 200
    return Trajectory.from_dict(answer.json()["trajectory"])


def test_a_plan_begins_at_the_state_of_a_motion_under_way(server, problems, first):
    file, t = problems / "01_reach.yaml", 0.4 * first.duration
    state = {key: first(t, order).tolist() for order, key in enumerate(("joints", "velocity", "acceleration"))}
    assert np.abs(state["velocity"]).max() > 0.3
    given = {"problem": file.read_text(), "start": state, "budget": 3.0}
    goal = {"joints": (load_problem(file).goal[0].q + 0.2).tolist()}
    answer = server.http.post("/api/plan", json={**given, "goal": goal}).json()
    assert answer["verified"], answer["failure"]
    motion = Trajectory.from_dict(answer["trajectory"])
    for order, key in enumerate(("joints", "velocity", "acceleration")):
        np.testing.assert_allclose(motion(0.0, order), state[key], atol=1e-6)
    record = server.http.get(f"/api/runs/{answer['id']}/run.json").json()
    assert record["problem"]["start"]["velocity"] == pytest.approx(state["velocity"])
    queued = server.submit(**{**given, "goal": goal, "seed": 5})
    assert server.ended(queued["id"])["verified"]


def test_a_cell_plans_from_where_the_robot_will_be(server, problems, first):
    with CellPlanner(server.url, problems / "01_reach.yaml") as cell:
        before = cell.plan(budget=3.0)
        k = len(before.t) // 3
        assert np.abs(before.v[k]).max() > 0.3
        aside = before.q[-1] + 0.15
        motion = cell.plan(
            before.q[k], joint_target=aside, velocities=before.v[k], accelerations=before.a[k], budget=3.0
        )
    assert motion.verified, motion.reason
    for found, wanted in ((motion.q, before.q), (motion.v, before.v), (motion.a, before.a)):
        np.testing.assert_allclose(found[0], wanted[k], atol=1e-6)
    np.testing.assert_allclose(motion.q[-1], aside, atol=1e-6)


def test_replanning_begins_at_the_motion_of_an_earlier_run(server, problems):
    text = (problems / "01_reach.yaml").read_text()
    first = server.http.post("/api/plan", json={"problem": text, "budget": 3.0}).json()
    aside = {"joints": (np.array(first["trajectory"]["q"][-1]) + 0.02).tolist()}
    given = {"problem": text, "goal": aside, "budget": 3.0, "warm_start": first["id"]}
    answer = server.http.post("/api/plan", json=given).json()
    assert answer["verified"], answer["failure"]
    record = server.http.get(f"/api/runs/{answer['id']}/run.json").json()
    assert record["info"]["warm_start"] in ("beaten", "refused")  # the goal is another: the motion itself cannot do
    queued = server.submit(**{**given, "seed": 3})
    assert server.ended(queued["id"])["verified"]
    assert queued["id"] != server.submit(**{**given, "seed": 3, "warm_start": None})["id"]
    again = server.http.post("/api/plan", json={"problem": text, "budget": 2.5, "warm_start": first["id"]}).json()
    record = server.http.get(f"/api/runs/{again['id']}/run.json").json()
    assert record["info"]["warm_start"] in ("beaten", "kept")
    assert again["duration"] <= first["duration"] * (1.0 + 1e-9)


def test_a_warm_start_has_a_motion(server, problems):
    given = {"problem": (problems / "01_reach.yaml").read_text(), "warm_start": "0" * 32}
    answer = server.http.post("/api/plan", json=given)
    assert answer.status_code == 404
    assert "0" * 32 in answer.json()["error"]


def test_velocities_of_another_size_are_refused(server, problems):
    start = {"joints": [0.0] * 7, "velocity": [1.0, 2.0]}
    given = {"problem": (problems / "01_reach.yaml").read_text(), "start": start}
    answer = server.http.post("/api/plan", json=given)
    assert answer.status_code == 422
    assert "velocity" in answer.json()["error"]


def test_the_motion_verifies_offline(server, problems, first):
    assert verify(load_problem(problems / "01_reach.yaml"), first).verified
