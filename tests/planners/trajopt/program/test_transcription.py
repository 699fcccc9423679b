"""Rows of the main planner against finite differences."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.contacts import Contacts
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Box, Obstacle, Scene, Sphere
from optiplan.planners.common.gravity import limits_at_rest
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.program.qp import Subproblem
from optiplan.planners.trajopt.program.sqp import DescentOptions, PythonProgram, descend, evaluate
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import CUTOFF, Margins, _pushed_one_way
from optiplan.planners.trajopt.terms.term import CostModel, SoftRows
from optiplan.planners.trajopt.terms.torques import TorqueTerm
from optiplan.problem.problem import JointGoal, Objective, Problem
from optiplan.robot.robot import load_robot
from tests.unchecked_problem import unchecked_problem

GOAL = np.array([1.2, 0.3, 0.4, -1.6, 0.3, 1.9, -0.4])


@pytest.fixture(scope="module")
def problem() -> Problem:
    robot = load_robot("panda")
    start = robot.configurations["ready"]
    ball = Obstacle("ball", Sphere(0.08), pin.SE3(np.eye(3), np.array([0.45, 0.25, 0.62])))
    board = Obstacle("board", Box((0.6, 0.6, 0.02)), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.1])))
    # Slow joints and weak motors: the torque rows are there to be looked at.
    limits = replace(robot.limits, torque=0.4 * robot.limits.torque)
    return unchecked_problem(
        name="t",
        robot=robot,
        scene=Scene((ball, board)),
        start=start,
        goal=(JointGoal(GOAL),),
        limits=limits,
        objective=Objective(1.0, 1e-6),
    )


@pytest.fixture(scope="module")
def transcription(problem: Problem) -> Transcription:
    basis = SplineBasis(bunched_breakpoints(14, 0.6))
    model = CollisionModel(problem.robot, problem.scene)
    made = Transcription(problem, model, basis, Margins.between(model, np.array([problem.start, GOAL]), 0.005))
    made.set_samples(np.linspace(0.02, 0.98, 30))
    return made


@pytest.fixture(scope="module")
def control(problem: Problem, transcription: Transcription) -> np.ndarray:
    way = np.array([problem.start, 0.5 * (problem.start + GOAL) + 0.1, GOAL])
    return along_path(transcription.basis, way, problem.limits.velocity)


def moved(control: np.ndarray, transcription: Transcription, change: np.ndarray) -> np.ndarray:
    result = control.copy()
    result[transcription.basis.free] += change.reshape(-1, control.shape[1])
    return result


def contacts(made: Transcription, control: np.ndarray) -> SoftRows:
    return made.contacts.rows(made.curve(control, 1.0))


def torques(made: Transcription, control: np.ndarray, duration: float) -> SoftRows:
    return made.torques.rows(made.curve(control, duration))


def jerk(made: Transcription, control: np.ndarray, duration: float) -> CostModel:
    return made.cost_model(made.curve(control, duration))


def direction(transcription: Transcription, n: int, seed: int) -> np.ndarray:
    free = transcription.basis.size - 6
    return np.random.default_rng(seed).normal(size=free * n) * 1e-4


@pytest.mark.parametrize("seed", range(3))
def test_contact_rows_equal_differences(transcription: Transcription, control: np.ndarray, seed: int) -> None:
    change = direction(transcription, 7, seed)
    here = contacts(transcription, control)
    plus = contacts(transcription, moved(control, transcription, change))
    minus = contacts(transcription, moved(control, transcription, -change))
    assert len(here.value) == len(plus.value) == len(minus.value) > 10
    expected = 0.5 * (plus.value - minus.value)
    error = np.abs(here.by_control @ change - expected)
    assert np.median(error) < 1e-8
    assert np.quantile(error, 0.8) < 1e-6  # the rest: kinks where faces are parallel


@pytest.mark.parametrize("seed", range(3))
def test_torque_rows_equal_differences(transcription: Transcription, control: np.ndarray, seed: int) -> None:
    change, T, dT = direction(transcription, 7, seed) * 0.01, 1.1, 1e-6
    here = torques(transcription, control, T)
    plus = torques(transcription, moved(control, transcription, change), T + dT)
    minus = torques(transcription, moved(control, transcription, -change), T - dT)
    assert len(here.value) == len(plus.value) == len(minus.value) > 10
    expected = 0.5 * (plus.value - minus.value)
    predicted = here.by_control @ change + here.by_duration * dT
    np.testing.assert_allclose(predicted, expected, rtol=1e-4, atol=1e-9)


def test_what_gravity_may_overload_has_rows_at_rest(
    problem: Problem, transcription: Transcription, control: np.ndarray
) -> None:
    """Beside those of the motion: of 98 % of the limits, or of what the ends need, here 106 % of the shoulder's."""
    robot, limit, curve = problem.robot, problem.limits.torque, transcription.curve(control, 1.1)
    assert np.isinf(limits_at_rest(robot, robot.limits.torque)).all()
    still = limits_at_rest(robot, limit)
    moving = TorqueTerm(robot, limit)
    moving.begin(transcription.samples)
    Q, data = transcription.samples.at[0] @ control, robot.model.createData()
    gravity = np.abs([pin.computeGeneralizedGravity(robot.model, data, q) for q in [problem.start, GOAL, *Q]])
    share = gravity[2:] / np.maximum(0.98 * still, gravity[:2].max(axis=0))
    assert 1.05 < (gravity[1] / limit).max() < 1.07
    expected = np.concatenate([moving.rows(curve).value, 1.0 - share[share > 0.8]])
    np.testing.assert_allclose(np.sort(transcription.torques.rows(curve).value), np.sort(expected), atol=1e-12)
    assert share.max() > 0.9


def test_jerk_cost_equals_differences(transcription: Transcription, control: np.ndarray) -> None:
    change, T, dT = direction(transcription, 7, 0), 1.1, 1e-6
    here = jerk(transcription, control, T)
    plus = jerk(transcription, moved(control, transcription, change), T)
    minus = jerk(transcription, moved(control, transcription, -change), T)
    assert here.gradient @ change == pytest.approx(0.5 * (plus.value - minus.value), rel=1e-6)
    assert change @ (here.hessian() @ change) == pytest.approx(plus.value + minus.value - 2 * here.value, rel=1e-4)
    later, earlier = (jerk(transcription, control, T + s * dT).value for s in (1, -1))
    assert here.by_duration == pytest.approx((later - earlier) / (2 * dT), rel=1e-6)


def test_watched_torques_get_rows(transcription: Transcription, control: np.ndarray) -> None:
    transcription.set_samples(transcription.samples.u)
    before = len(torques(transcription, control, 5.0).value)
    fast = torques(transcription, control, 0.5)
    assert fast.violation() > 0.0
    assert transcription.torques.watch(fast)
    assert not transcription.torques.watch(fast)
    assert len(torques(transcription, control, 5.0).value) > before
    transcription.set_samples(transcription.samples.u)


def test_violation_takes_the_worst_row_of_each_sample() -> None:
    rows = SoftRows(np.array([0, 0, 2]), np.array([-0.1, -0.3, -0.2]), np.zeros((3, 1)), np.zeros(3))
    assert rows.violation() == pytest.approx(0.5)


def test_margins_are_those_that_the_ends_of_each_pair_allow() -> None:
    margins = Margins(0.005, np.array([0.04, 0.0, 0.002]), np.array([0.04, 0.04, 0.002]))
    u, pairs = np.array([0.0, 0.0, 0.1, 0.3, 0.5]), np.array([0, 1, 1, 1, 2])
    np.testing.assert_allclose(margins.at(u, pairs), [0.005, 0.0, 0.0024, 0.005, 0.0012])


def test_margins_between_ends_know_the_clearance_of_each_pair(problem: Problem) -> None:
    """As far as the cutoff; at both ends no pair is asked for more than a part of what it has there."""
    model = CollisionModel(problem.robot, problem.scene)
    ends = np.array([problem.start, GOAL])
    margins = Margins.between(model, ends, 0.03)
    for q, known in zip(ends, (margins.start, margins.end), strict=True):
        distance = np.array([model.distance(q, k).distance for k in range(len(model.pairs))])
        np.testing.assert_allclose(known, np.clip(distance, 0.0, CUTOFF), atol=2e-6)
    pairs = np.arange(len(model.pairs))
    for u, known in ((0.0, margins.start), (1.0, margins.end)):
        wanted = margins.at(np.full(len(pairs), u), pairs)
        assert (wanted <= known).all()
        assert (wanted <= margins.middle).all()


def test_a_small_step_keeps_its_promise(transcription: Transcription, control: np.ndarray) -> None:
    point = evaluate(transcription, control, 0.0)
    step = Subproblem(transcription, "piqp").solve(point.control, point.duration, point.soft, 1e-4, point.span)
    assert step is not None
    allowed = 1e-4 * point.span * transcription.limits.velocity
    assert (np.abs(step.control - control) <= allowed * (1.0 + 1e-3)).all()
    gain = point.merit - evaluate(transcription, step.control, step.duration, point.span).merit
    assert step.promise > 0
    assert gain > 0.2 * step.promise


def test_optimise_reaches_a_curve_without_violation(transcription: Transcription, control: np.ndarray) -> None:
    found = descend(PythonProgram(Subproblem(transcription, "piqp")), control, DescentOptions(60, lambda: False))
    assert 0 < found.steps <= 60
    assert found.log.ended == "converged"
    first = evaluate(transcription, control, 0.0)
    point = evaluate(transcription, found.control, found.duration, first.span)
    assert point.missing < 1e-3
    assert point.rows[1].violation() < 0.02
    assert point.merit < first.merit
    limits = transcription.limits
    assert (point.control >= limits.lower - 1e-9).all()
    assert (point.control <= limits.upper + 1e-9).all()


def test_optimise_stops_when_told(transcription: Transcription, control: np.ndarray) -> None:
    found = descend(PythonProgram(Subproblem(transcription, "piqp")), control, DescentOptions(60, lambda: True))
    assert found.steps == 0
    assert found.log.ended == "stopped"
    np.testing.assert_array_equal(found.control, control)


def test_one_pair_inside_at_consecutive_samples_is_pushed_one_way() -> None:
    rows, pairs = np.array([0, 1, 2, 4, 1]), np.array([7, 7, 7, 7, 8])
    normals = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 0, 1]])
    distance = np.array([-0.1, -0.1, 0.01, -0.1, -0.1])
    pushed = _pushed_one_way(Contacts(rows, pairs, distance, np.zeros((5, 2, 3)), normals)).normals
    np.testing.assert_allclose(pushed[:2], [[0.5**0.5, 0.5**0.5, 0]] * 2)
    np.testing.assert_array_equal(pushed[2:], normals[2:])
