import base64

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import JointGoal, derived
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.runs import RATE, Poses, ViewedRun, distinct_labels, run_for_page
from tests.unchecked_problem import unchecked_problem

WITNESS = {"proved_clearance": 0.0123, "met_clearance": 0.0145}
COLLISION = {"name": "collision", "passed": True, "worst": 0.0123, "time": 0.4, "witness": WITNESS}
REPORT = {"verified": True, "checks": [COLLISION]}


def floats(text: str, *shape: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(*shape)


def test_poses_are_those_of_pinocchio(shelf, panda):
    q = np.linspace(-0.4, 0.5, 7)
    joints, tool = Poses(shelf).of(np.array([shelf.start, q]))
    data = panda.model.createData()
    pin.framesForwardKinematics(panda.model, data, q)
    for j in range(1, panda.model.njoints):
        assert pin.XYZQUATToSE3(joints[1, j - 1]).isApprox(data.oMi[j], 1e-9)
    assert np.allclose(tool[1], data.oMf[panda.model.getFrameId(panda.tool_frame)].translation)


def test_motion_is_sampled_from_start_to_end(shelf, motion):
    shown = run_for_page(shelf, Poses(shelf), ViewedRun("quintic", motion(shelf), REPORT))
    poses = floats(shown["poses"], shown["samples"], 7, 7)
    assert shown["samples"] - 1 >= RATE * shown["duration"]
    ends = Poses(shelf).of(np.array([shelf.start, shelf.goal[0].q]))[0]
    assert np.allclose(poses[[0, -1]], ends, atol=1e-6)


def test_ellipsoids_hold_what_the_jacobian_says(shelf, motion, panda):
    shown = run_for_page(shelf, Poses(shelf), ViewedRun("quintic", motion(shelf), REPORT))
    sent = floats(shown["ellipsoids"], shown["samples"], 7)
    data, tool = panda.model.createData(), panda.model.getFrameId(panda.tool_frame)
    for k, q in enumerate(motion(shelf)(np.linspace(0.0, 1.6, shown["samples"]))):
        J = pin.computeFrameJacobian(panda.model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)[:3]
        axes, lengths = pin.Quaternion(*sent[k, [3, 0, 1, 2]].astype(float)).matrix(), sent[k, 4:]
        assert np.allclose(axes @ np.diag(lengths**2) @ axes.T, J @ J.T, atol=1e-5)
        assert (np.diff(lengths) <= 0.0).all()


def test_ellipsoids_of_a_planar_arm_are_flat(planar):
    flat = Poses(
        unchecked_problem(name="flat", robot=planar, scene=Scene(), start=np.zeros(2), goal=(), limits=planar.limits)
    ).ellipsoids(np.array([[0.3, 1.0]]))
    assert flat.shape == (1, 7)
    assert flat[0, 6] < 1e-12 < flat[0, 5]


def test_facts_of_a_verified_run(shelf, motion):
    shown = run_for_page(shelf, Poses(shelf), ViewedRun("quintic", motion(shelf), REPORT))
    facts = dict(shown["facts"])
    assert shown["badge"] == "verified"
    assert facts["duration"] == "1.600 s"
    assert facts["clearance, proved"] == "12.30 mm"  # beside verified stands what is proved
    assert facts["smallest distance met"] == "14.50 mm"
    assert "worst clearance" not in facts
    assert float(facts["× lower bound"]) > 1.0
    assert shown["problems"] == shown["witnesses"] == []


def test_what_the_verdict_is_about_is_shown(shelf, motion):
    scope = ("4 pairs of links not checked: 4 adjacent", "torque: at all times, without friction")
    run = ViewedRun("quintic", motion(shelf), REPORT | {"scope": list(scope)})
    assert run_for_page(shelf, Poses(shelf), run)["about"]["statements"] == list(scope)
    assert run_for_page(shelf, Poses(shelf), run._replace(report=None))["about"] is None


@pytest.mark.parametrize("offset", [0.0, 1e-15, 1e-12])
def test_a_motion_that_ends_where_it_starts_has_no_bound(shelf, motion, offset):
    """Start and end of a circle differ by rounding: no bound to compare with, where 3276800.000 was shown."""
    there = motion(shelf)
    q = shelf.start.copy()
    q[2] += offset
    back = motion(derived(shelf, start=there.end, goal=(JointGoal(q),)))
    coefficients = np.concatenate([there.coefficients, back.coefficients])
    circle = Trajectory(there.joint_names, np.array([0.0, 1.6, 3.2]), coefficients)
    facts = dict(run_for_page(shelf, Poses(shelf), ViewedRun("circle", circle, REPORT))["facts"])
    assert facts["duration"] == "3.200 s"
    assert not any("bound" in name for name in facts)


def test_a_run_is_verified_only_when_its_report_says_so(shelf, motion):
    trajectory, poses = motion(shelf), Poses(shelf)
    runs = [ViewedRun("a", trajectory), ViewedRun("b", trajectory, {"verified": False}), ViewedRun("c", None)]
    assert [run_for_page(shelf, poses, run)["badge"] for run in runs] == ["not checked", "not verified", "no plan"]


def test_refused_check_is_shown_with_its_witness(shelf, motion):
    witness = {"q": shelf.start.tolist(), "points": [[0.1, 0.2, 0.3], [0.1, 0.2, 0.4]], "pair": ["panda_hand", "board"]}
    check = {
        "name": "collision",
        "passed": False,
        "worst": -0.004,
        "time": 1.1,
        "detail": "they touch",
        "witness": witness,
    }
    shown = run_for_page(shelf, Poses(shelf), ViewedRun("bad", motion(shelf), {"verified": False, "checks": [check]}))
    assert shown["problems"] == ["collision: they touch (at 1.100 s)"]
    (found,) = shown["witnesses"]
    assert (found["points"], found["pair"], found["time"]) == (witness["points"], witness["pair"], 1.1)
    assert np.allclose(floats(found["poses"], 7, 7), Poses(shelf).of(shelf.start[None])[0][0], atol=1e-6)


def test_failure_without_a_trajectory_is_shown(shelf):
    failure = {"kind": "no-path", "detail": "the goal is walled in", "witness": {"points": [[0.0, 0.0, 1.0]], "t": 0.5}}
    shown = run_for_page(shelf, Poses(shelf), ViewedRun("rrt", None, None, failure))
    assert shown["problems"] == ["no-path: the goal is walled in"]
    assert shown["witnesses"] == [{"points": [[0.0, 0.0, 1.0]], "pair": [], "distance": None, "time": 0.5}]


@pytest.mark.parametrize("witness", [{}, {"q": None}, {"points": []}, {"points": [1.0, 2.0]}])
def test_witness_without_a_place_draws_nothing(shelf, witness):
    failure = {"kind": "budget", "detail": "", "witness": witness}
    assert run_for_page(shelf, Poses(shelf), ViewedRun("rrt", None, None, failure))["witnesses"] == []


def test_witness_of_another_robot_draws_no_robot(shelf):
    failure = {"kind": "collision", "detail": "", "witness": {"q": [0.0, float("nan")], "points": [[0, 0, 0]]}}
    (found,) = run_for_page(shelf, Poses(shelf), ViewedRun("rrt", None, None, failure))["witnesses"]
    assert "poses" not in found


def test_no_bound_is_shown_of_a_path_whose_speed_is_stated():
    path = op.Path([[0.5, 0.1, 0.4], [0.5, -0.1, 0.4]], speed=0.1, axis=[0, 0, -1])
    for task, shown in ((path, False), (op.Task().move("extended"), True)):
        run = op.plan(op.Problem("panda", "ready", task=task), budget=5.0)
        assert run.verified
        facts = run_for_page(run.problem, Poses(run.problem), ViewedRun("led", run.trajectory, REPORT))["facts"]
        assert any("bound" in name for name, _ in facts) is shown


@pytest.mark.parametrize("labels", [["a", "a", "a (1)"], ["a", "a", "a (1)", "a (1)"], ["a (2)", "a", "a"]])
def test_no_two_labels_are_alike(labels):
    assert len(set(distinct_labels(labels))) == len(labels)
    assert distinct_labels(["a", "b", "a"]) == ["a (1)", "b", "a (2)"]
