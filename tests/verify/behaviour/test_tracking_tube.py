"""Motions proved with a tracking error: no configuration of the tube touches, leaves limits or breaks a constraint."""

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.problem.constraints.states import BrokenConstraint
from optiplan.problem.problem import derived
from optiplan.problem.task.timeline import scene_parts
from optiplan.trajectory.joining import standstill
from optiplan.verify.verify import verify
from tests.checks import named

CASES = [
    ("02_shelf", 0.005),
    ("15_srra", 0.005),
    ("16_delbot", 0.01),
    ("18_baxter_dual", 0.002),
]


def off(rng, motion, error, count):
    """Configurations of the tube at random times, half of them in its corners."""
    t = rng.uniform(0.0, motion.duration, count)
    far = rng.uniform(-1.0, 1.0, (count, motion.n))
    far[::2] = np.sign(far[::2])
    return t, motion(t) + far * error


@pytest.mark.parametrize(("name", "error"), CASES)
def test_nothing_in_the_tube_touches_or_leaves_its_limits(name, error):
    run = op.plan(op.load_problem(name), tracking_error=error, budget=2.0)
    assert run.verified, run
    problem, motion = run.problem, run.trajectory
    assert problem.tracking_error.min() == error
    rng = np.random.default_rng(1)
    for part in scene_parts(problem, motion):
        model = CollisionModel(part.problem.robot.with_proved_checked(), part.problem.scene)
        for _, q in zip(range(400), off(rng, motion, error, 400)[1], strict=False):
            assert not model.collides(q)
            assert (q >= problem.limits.lower - 2e-6).all()
            assert (q <= problem.limits.upper + 2e-6).all()
    model = CollisionModel(problem.robot, problem.scene)  # a clearance is not of pairs proved once for the robot
    clearance = named(run.report, "collision").worst
    least = min(model.clearance(q).distance for q in off(rng, motion, error, 150)[1])
    assert least > clearance > 0.0


def test_the_report_says_and_counts_it():
    run = op.plan(op.load_problem("01_reach"), tracking_error=0.002)
    assert run.report.tracking_error == (0.002,) * 7
    (words,) = [one for one in run.report.scope if one.startswith("tracking error")]
    assert words == (
        "tracking error: 2 checks (position, collision) hold wherever the joints are within 0.002 rad of the motion;"
        " the others hold of the motion alone"
    )
    data = run.to_dict()
    assert data["tracking_error"] == [0.002] * 7
    assert data["report"]["tracking_error"] == [0.002] * 7
    assert data["problem"]["tracking_error"] == 0.002
    plain = op.plan(op.load_problem("01_reach"))
    assert plain.report.tracking_error == ()
    assert plain.to_dict()["tracking_error"] == [0.0] * 7
    assert not any("tracking" in one for one in plain.report.scope)


def test_a_motion_that_is_too_near_for_the_tube_is_refused_quickly_and_named():
    run = op.plan(op.load_problem("15_srra"))
    check = named(run.report, "collision")
    wide = run.problem.with_parts(tracking_error=0.02)
    report = op.verify(wide, run.trajectory)
    (found,) = [one for one in report.failures if one.name == "collision"]
    assert "the tracking error takes" in found.detail
    assert not found.witness["contact"]
    assert found.witness["queries"] < 10 * check.witness["queries"]
    assert found.place


def test_what_is_provable_is_nearly_what_is_true():
    """The proof takes hardly more of a distance than some configuration of the tube does."""
    problem = op.load_problem("15_srra")
    run = op.plan(problem, tracking_error=0.01, budget=2.0)
    check = named(run.report, "collision")
    still = standstill(problem.robot.joint_names, np.array(check.witness["q"]), 1.0)
    model = CollisionModel(problem.robot, problem.scene)
    rng, error = np.random.default_rng(0), 0.01
    for scale in (0.3, 1.0):
        own = derived(problem, tracking_error=np.full(problem.robot.n, scale * error))
        check = named(verify(own, still), "collision")
        q = off(rng, still, scale * error, 400)[1]
        least, middle = min(model.clearance(one).distance for one in q), model.clearance(still.start).distance
        assert check.worst <= least
        taken = middle - least  # by the farthest configuration met
        assert check.worst >= 0.8 * (middle - 1.6 * taken)  # 80 % of what is left is proved


def test_limits_shrink_by_the_error_joint_by_joint():
    problem = op.load_problem("01_reach")
    q = np.array(problem.start)
    q[3] = problem.limits.upper[3] - 0.01
    still = standstill(problem.robot.joint_names, q, 1.0)
    for error, passed in ((0.0099, True), (0.0102, False)):
        own = derived(problem, tracking_error=np.array([0.0, 0.0, 0.0, error, 0.0, 0.0, 0.0]))
        check = named(verify(own, still), "position")
        assert check.passed is passed
        assert check.place == "panda_joint4"


@pytest.mark.parametrize(
    "constraint",
    [
        op.OrientationCone("panda_hand_tcp", (0, 0, 1), (0, 0, -1), 0.25),
        op.PositionBox("panda_hand_tcp", (0.9, 1.4, 0.9), op.Pose((0.35, 0.0, 0.45))),
        op.PairClearance((("panda_hand", "panda_link0"),), 0.2),
    ],
)
def test_path_constraints_hold_in_the_tube(constraint):
    problem = op.load_problem("01_reach").with_objective(op.Objective())
    error = 0.01
    q = problem.robot.configurations["ready"]
    goal = q + np.array([0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    own = problem.with_parts(start=q, goal=goal, path_constraints=[constraint], tracking_error=error)
    run = op.plan(own, budget=4.0)
    assert run.verified, run
    assert "constraint" in next(one for one in run.report.scope if one.startswith("tracking error"))
    broken = BrokenConstraint(own.path_constraints[0], own.robot, own.scene)
    for at in off(np.random.default_rng(2), run.trajectory, error, 200)[1]:
        assert not broken.words(op.State(at))


def test_a_constraint_with_less_room_than_the_tube_is_refused():
    problem = op.load_problem("01_reach")
    q = problem.robot.configurations["ready"]
    cone = op.OrientationCone("panda_hand_tcp", (0, 0, 1), (0, 0, -1), 0.02)
    own = problem.with_parts(start=q, goal=q + 0.001, path_constraints=[cone])
    still = standstill(own.robot.joint_names, q, 1.0)
    assert all(one.passed for one in verify(own, still).checks if "orientation" in one.name)
    (check,) = [
        one for one in verify(derived(own, tracking_error=np.full(7, 0.01)), still).checks if "orientation" in one.name
    ]
    assert not check.passed
    assert "not proved within the tracking error" in check.detail
