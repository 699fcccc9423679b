"""The proof that a robot does not tip over, beside dense samples of the wrench."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.problem.problem import derived
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.balance_check import _BaseBounds, tip_over
from optiplan.verify.continuous.intervals import derivative_bounds
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.scope import scope

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@pytest.fixture(scope="module", params=["panda", "delbot", "srra"])
def swing(request):
    """A problem, its base tilted and with a payload, and a quick motion of random polynomials."""
    robot, rng = op.load_robot(request.param), np.random.default_rng(0)
    link = next(str(f.name) for f in reversed(robot.model.frames.tolist()) if f.type == pin.FrameType.BODY)
    load = ((link, pin.Inertia(1.0, np.array([0.05, 0.0, 0.1]), 0.01 * np.eye(3))),)
    base = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.0, 0.4), np.array([0.1, 0.2, 0.05]))
    robot = robot.mounted(replace(robot.mounting, X_WB=base, payload=load))
    home = next(iter(robot.configurations.values()))
    coefficients = rng.uniform(-0.4, 0.4, (3, 6, robot.n))
    coefficients[:, 0] += home
    motion = Trajectory(robot.joint_names, np.array([0.0, 0.6, 1.0, 1.7]), coefficients)
    problem = derived(op.Problem(request.param, home, home + 0.1), robot=robot)
    return problem, motion


def margins(problem, motion, one):
    """The margins at 4000 instants of each piece."""
    piece = np.repeat(np.arange(len(motion.widths)), 4000)
    local = np.concatenate([np.linspace(0.0, h, 4000) for h in motion.widths])
    return one.polygon.margins(base_reaction(problem.robot, *motion.states_in(piece, local)))


def test_what_is_just_held_is_proved_and_what_is_just_broken_is_refused(swing):
    problem, motion = swing
    wide = op.TipOver(3.0 * SQUARE, height=-0.2)
    least = margins(problem, motion, wide).min()
    held = tip_over(problem, motion, VerifyPolicy(), replace(wide, margin=least - 1e-3))
    assert held.passed, held
    assert held.kind == "continuous"
    assert held.worst == pytest.approx(least, abs=1e-3)
    broken = tip_over(problem, motion, VerifyPolicy(), replace(wide, margin=least + 1e-3))
    assert not broken.passed
    assert "beyond its limit" in broken.detail


def test_the_bounds_are_above_the_second_derivative_of_the_wrench(swing):
    problem, motion = swing
    h, bounds = 1e-3, _BaseBounds(problem.robot)
    t = np.linspace(0.05, 0.55, 40)
    c = np.repeat(motion.coefficients[:1], len(t), axis=0)
    size, curvature = bounds.over(derivative_bounds(c, t[:, None], np.full((len(t), 1), h), 5))
    piece = np.zeros(len(t), dtype=np.intp)
    before, here, after = (base_reaction(problem.robot, *motion.states_in(piece, t + k * h)) for k in (-1, 0, 1))
    second = (before - 2.0 * here + after) / h**2
    for column, part in ((0, slice(3)), (1, slice(3, 6))):
        assert (np.linalg.norm(second[:, part], axis=1) <= curvature[:, column] * (1.0 + 1e-3) + 1e-3).all()
        assert (np.linalg.norm(here[:, part], axis=1) <= size[:, column]).all()


def test_a_robot_without_masses_is_refused():
    problem = op.Problem("baxter_report", [0.1, -0.3, 0.1, 0.5, 0.1, 0.5, 0.1], [0.2, -0.3, 0.1, 0.5, 0.1, 0.5, 0.1])
    motion = Trajectory(problem.robot.joint_names, np.array([0.0, 1.0]), problem.start[None, None])
    check = tip_over(problem, motion, VerifyPolicy(), op.TipOver(SQUARE))
    assert not check.passed
    assert "no masses" in check.detail


ROBOTS = {"a": "planar2r", "b": {"use": "planar2r", "base": op.Pose((0, 2, 0))}}


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (lambda: op.Robot.side_by_side(ROBOTS), "a and b together, as on one base; without masses: the base"),
        (lambda: op.load_robot("delbot", group="all"), "on corners that stand still while the base drives"),
        (lambda: op.load_robot("delbot", group="arm"), ""),
    ],
)
def test_the_report_says_what_stands_on_the_corners(robot, words):
    plain = op.Problem("planar2r", "up", "ready")
    problem = derived(plain, robot=robot(), path_constraints=(op.TipOver(9.0 * SQUARE),))
    said = [one for one in scope(problem, problem.robot, ()) if one.startswith("tip over")]
    assert words in "".join(said)
    assert bool(said) == bool(words)


def test_a_start_that_tips_over_and_a_margin_beyond_the_polygon_are_bad_input():
    """The SRRA on its own foot without the weight of a base."""
    tipping = {"corners": [[-0.35, 0.55], [0.35, 0.55], [0.35, 0.95], [-0.35, 0.95]], "height": -2}
    with pytest.raises(op.InputError, match="tipping over: a margin of -"):
        op.Problem("srra", "home", [0.5] * 6, path_constraints=[{"tip_over": tipping}])
    with pytest.raises(op.InputError, match="leaves nothing of the polygon"):
        op.Problem("srra", "home", [0.5] * 6, path_constraints=[{"tip_over": tipping | {"margin": 0.3}}])


def test_a_task_is_judged_with_what_it_holds_at_each_time():
    """A panda takes a heavy ball and reaches out with it: alone it would stand far safer."""
    ball = op.Sphere("ball", 0.03, position=(0.42, 0.0, 0.45))
    task = op.Task().dwell(0.1).attach("ball", "panda_hand", mass=3.0).move([0.2, 0.4, 0, -1.2, 0, 1.6, 0.8])
    run = op.plan(op.Problem("panda", "ready", scene=[ball], task=task), "quintic", budget=5.0)
    assert run.verified, run
    wide = op.TipOver(1.5 * SQUARE, height=-1.0)
    alone = tip_over(derived(run.problem, task=()), run.trajectory, VerifyPolicy(), wide).worst
    for margin, passes in ((alone - 0.01, False), (alone - 0.5, True)):
        problem = derived(run.problem, path_constraints=(replace(wide, margin=margin),))
        found = [check for check in op.verify(problem, run.trajectory).checks if check.name == "tip over constraint"]
        assert {check.passed for check in found} == ({True, False} if not passes else {True})
        assert all(check.time >= run.trajectory.segments[1].begin for check in found if not check.passed)
        assert {one for check in found for one in check.covers} == {"path_constraints[0]"}
