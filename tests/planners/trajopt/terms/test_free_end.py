"""Ends free in a pose goal: one more variable, exact derivatives, shorter motions that still end in the goal."""

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.collision.native_model import planning_model
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.program import sqp
from optiplan.planners.trajopt.program.native_step import NativeSubproblem
from optiplan.planners.trajopt.program.qp import Subproblem
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import Margins
from optiplan.planners.trajopt.terms.free_end import FreeEnd
from optiplan.problem.goals import goal_configurations
from tests.problem.goal_errors import goal_residual

BASIS = SplineBasis(bunched_breakpoints(14, 0.6), open_end=True)


@pytest.fixture(scope="module")
def problem():
    post = op.Box("post", size=(0.06, 0.06, 0.9), position=(0.42, 0.2, 0.45))
    goal = op.Pose((0.35, 0.45, 0.5), rpy=(np.pi, 0.0, 0.0), position_tolerance=0.03, orientation_tolerance=0.3)
    return op.Problem("panda", start="ready", goal=goal, scene=[post], objective={"time": 1.0, "jerk": 1e-6})


@pytest.fixture(scope="module")
def curve(problem):
    model = planning_model(problem.robot, problem.scene)
    goal = goal_configurations(problem, model, np.random.default_rng(0)).configurations[0]
    way = np.array([problem.start, 0.5 * (problem.start + goal) + 0.1, goal])
    control = along_path(BASIS, way, problem.limits.velocity)
    margins = Margins.between(model, control[[0, -1]], 0.005)
    made = Transcription(problem, model, BASIS, margins, FreeEnd(problem, problem.goal[0]).terms)
    made.set_samples(np.linspace(0.02, 1.0, 40))
    return made, control


def test_the_last_three_control_points_are_one_variable():
    control, change = np.zeros((BASIS.size, 2)), np.arange(2.0 * BASIS.variables).reshape(-1, 2)
    moved = BASIS.moved(control, change)
    assert BASIS.variables == BASIS.size - 5
    np.testing.assert_array_equal(moved[-3:], np.tile(change[-1], (3, 1)))
    np.testing.assert_array_equal(moved[:3], 0.0)
    np.testing.assert_array_equal(BASIS.moving(moved), change)
    for rows in BASIS.derivative[1:]:
        np.testing.assert_allclose(BASIS.by_variables(rows) @ change, rows @ moved, atol=1e-9)


def test_rows_equal_differences_at_the_end_too(curve):
    made, control = curve
    rng = np.random.default_rng(0)
    change = 1e-6 * rng.normal(size=BASIS.moving(control).shape)
    for term in made.terms[2:]:
        here, after, before = (
            term.rows(made.curve(BASIS.moved(control, sign * change), 1.2)) for sign in (0.0, 1.0, -1.0)
        )
        assert set(here.sample) == {39}
        np.testing.assert_allclose(here.by_control @ change.ravel(), 0.5 * (after.value - before.value), atol=1e-10)


@pytest.mark.skipif(core is None, reason="the native core is not built")
def test_the_native_step_is_as_good_as_piqps(curve):
    made, control = curve
    point = sqp.evaluate(made, control, 0.0)
    for radius in (0.1, 0.02):
        program = (point.control, point.duration, point.soft, radius, point.span)
        expected, found = Subproblem(made, "piqp").solve(*program), NativeSubproblem(made, gap=1e-6).solve(*program)
        assert found.promise == pytest.approx(expected.promise, abs=1e-4 * point.duration)
        np.testing.assert_array_equal(found.control[-1], found.control[-3])
        assert np.abs(found.control[-1] - control[-1]).max() > 0.0
        np.testing.assert_array_equal(found.control[:3], control[:3])


def test_a_free_end_makes_a_motion_shorter_and_stays_in_the_goal(problem, curve):
    _, control = curve
    model, options = planning_model(problem.robot, problem.scene), TrajOptOptions(spans=14)
    budget = op.Budget(20.0)
    fixed = Optimiser(problem, model, options).run(control, budget)
    free = Optimiser(problem, model, options, FreeEnd(problem, problem.goal[0])).run(control, budget)
    assert fixed.free
    assert free.free
    assert free.trajectory.duration < 0.97 * fixed.trajectory.duration
    assert goal_residual(problem, free.trajectory.end)[0].reached


def test_the_planner_tries_it_and_the_verifier_agrees(problem):
    run = op.plan(problem, budget=5.0)
    assert run.verified
    assert any(attempt["seed"] == "end" for attempt in run.info["attempts"])
