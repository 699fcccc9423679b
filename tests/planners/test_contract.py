"""What every planner of the registry owes its callers."""

import threading
import time

import numpy as np
import pinocchio as pin
import pytest

from optiplan.model.collision import CollisionModel
from optiplan.planners.base import Budget, Planner
from optiplan.planners.registry import PLANNERS, make_planner
from optiplan.problem.goals import goal_residual
from tests.planners import cases

KINDS = {
    "goal-unreachable",
    "start-in-collision",
    "goal-in-collision",
    "no-path",
    "collision",
    "budget",
    "cancelled",
    "limits",
    "unsupported",
}


def silent(stage, fraction):
    assert isinstance(stage, str)
    assert 0.0 <= fraction <= 1.0


def plan(name, problem, budget=None):
    planner: Planner = make_planner(name)
    return planner.plan(problem, budget or Budget(10.0), silent)


@pytest.fixture(scope="module", params=sorted(PLANNERS))
def name(request):
    plan(request.param, cases.wall(), Budget(30.0))  # imports and caches warm: the tests below look at the clock
    return request.param


@pytest.mark.parametrize("case", sorted(cases.SOLVABLE))
def test_answer_joins_start_and_goal_at_rest(name, case):
    problem = cases.SOLVABLE[case]()
    result = plan(name, problem)
    assert (result.trajectory is None) != (result.failure is None)
    if result.trajectory is None:
        assert case == "wall", f"only the wall may stop a planner: {result.failure}"
        return
    trajectory = result.trajectory
    assert trajectory.joint_names == problem.robot.joint_names
    assert trajectory.start == pytest.approx(problem.start, abs=1e-9)
    assert any(error.reached for error in goal_residual(problem, trajectory.end))
    ends = np.array([0.0, trajectory.duration])
    assert np.abs(trajectory(ends, 1)).max() < 1e-6
    for order, bound in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        limit = getattr(problem.limits, bound)
        low, high = trajectory.extrema(order)
        assert (np.maximum(-low, high) <= limit * (1.0 + 1e-6)).all(), bound
    t = np.linspace(0.0, trajectory.duration, 500)
    data = problem.robot.model.createData()
    motion = zip(*(trajectory(t, order) for order in range(3)), strict=True)
    torques = [pin.rnea(problem.robot.model, data, q, v, a) for q, v, a in motion]
    assert (np.abs(torques) <= problem.limits.torque * (1.0 + 1e-6)).all()


@pytest.mark.parametrize("case", sorted(cases.SOLVABLE))
def test_answer_is_free_at_samples(name, case):
    problem = cases.SOLVABLE[case]()
    result = plan(name, problem)
    if result.trajectory is not None:
        model = CollisionModel(problem.robot, problem.scene)
        configurations = result.trajectory(np.linspace(0.0, result.trajectory.duration, 1000))
        assert not any(model.collides(q) for q in configurations)


def test_same_problem_same_answer(name):
    first, second = (plan(name, cases.wall()) for _ in range(2))
    if first.trajectory is None:
        assert first.failure == second.failure
        return
    assert np.array_equal(first.trajectory.breakpoints, second.trajectory.breakpoints)
    assert np.array_equal(first.trajectory.coefficients, second.trajectory.coefficients)


@pytest.mark.parametrize("case", sorted(cases.UNSOLVABLE))
def test_failure_says_why_and_where(name, case):
    make, kinds = cases.UNSOLVABLE[case]
    began = time.perf_counter()
    result = plan(name, make(), Budget(1.5))
    assert time.perf_counter() - began < 2.5, "budget"
    assert result.trajectory is None
    assert result.failure.kind in kinds & KINDS
    assert len(result.failure.detail) > 20
    assert np.isfinite(result.failure.witness["q"]).all()


def test_cancel_stops_it_at_once(name):
    cancel = threading.Event()
    done = []
    budget = Budget(60.0, cancel)
    worker = threading.Thread(target=lambda: done.append(plan(name, cases.barred(), budget)))
    worker.start()
    time.sleep(0.3)
    cancel.set()
    began = time.perf_counter()
    worker.join(10.0)
    assert time.perf_counter() - began < 0.5  # 0.2 s, and as much again for a busy machine
    assert done[0].failure.kind in {"cancelled", "collision"}


def test_no_time_no_answer(name):
    result = plan(name, cases.wall(), Budget(0.0))
    assert result.trajectory is None
    assert result.failure.kind in KINDS


def test_prints_nothing_and_leaves_the_problem_alone(name, capfd):
    problem = cases.wall()
    arrays = (problem.start, problem.goal[0].q, problem.limits.velocity, problem.robot.model.lowerPositionLimit)
    before = [array.copy() for array in arrays]
    plan(name, problem)
    assert capfd.readouterr() == ("", "")
    assert all(np.array_equal(a, b) for a, b in zip(arrays, before, strict=True))


def test_timings_cover_the_work(name):
    began = time.perf_counter()
    result = plan(name, cases.wall())
    took = time.perf_counter() - began
    assert result.timings
    assert sum(result.timings.values()) == pytest.approx(took, abs=0.1 + 0.2 * took)
