"""Attempts side by side: the same motion, bit by bit, for any number of threads."""

import threading
from pathlib import Path

import numpy as np
import pytest

from optiplan._core import core
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, PlanResult
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.planners.trajopt.speculative_attempts import SpeculativeAttempts
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from tests.waiting import wait_until

pytestmark = pytest.mark.skipif(core is None, reason="threads are for the native core")


def planned(problem: Problem, workers: int, seconds: float = 120.0) -> PlanResult:
    """Plan with so many workers and few attempts."""
    options = TrajOptOptions(workers=workers, seeds=3)
    return TrajOpt(options).plan(problem, Budget(seconds), lambda stage, share: None)


def bits(result: PlanResult) -> tuple[bytes, bytes]:
    """Return the motion as bytes."""
    assert result.trajectory is not None
    return result.trajectory.coefficients.tobytes(), result.trajectory.breakpoints.tobytes()


@pytest.mark.parametrize(("name", "workers"), [("07_any_of", 4), ("12_planar", 2)])
def test_any_number_of_workers_gives_the_same_bits(name: str, workers: int, problems: Path) -> None:
    problem, threads = load_problem(problems / f"{name}.yaml"), threading.active_count()
    alone, several = (planned(problem, count) for count in (1, workers))
    assert threading.active_count() == threads, "they end with the plan"
    assert not any(result.info["cut_short"] for result in (alone, several))
    assert bits(alone) == bits(several)
    assert alone.info["attempts"] == several.info["attempts"]
    assert "workers" not in alone.info
    assert several.info["workers"]["count"] == workers


def test_threads_end_with_the_cancelling_of_the_plan(problems: Path) -> None:
    problem, before = load_problem(problems / "02_shelf.yaml"), threading.active_count()
    cancel = threading.Event()
    cancel.set()
    TrajOpt(TrajOptOptions(workers=4)).plan(problem, Budget(60.0, cancel), lambda stage, share: None)
    assert threading.active_count() == before


def test_an_outcome_is_taken_only_where_it_is_that_of_an_attempt_begun_now(problems: Path) -> None:
    problem = load_problem(problems / "01_reach.yaml")
    optimiser = Optimiser(problem, planning_model(problem.robot, problem.scene), TrajOptOptions(workers=2))
    ahead, budget = SpeculativeAttempts(optimiser, Budget(60.0)), Budget(60.0)
    goal = problem.start + 0.3
    control = along_path(optimiser.basis, np.array([problem.start, goal]), problem.limits.velocity)
    ahead.precompute([control], np.inf, False)
    wait_until(lambda: any(task.future.running() or task.future.done() for task in ahead._tasks.values()))
    assert ahead.take(control + 1e-9, budget, np.inf, False) is None
    outcome = ahead.take(control, budget, np.inf, False)
    own = optimiser.run(control, budget)
    ahead.close()
    assert outcome is not None
    assert outcome.attempt is not None
    assert own is not None
    assert outcome.steps == optimiser.steps
    assert outcome.attempt.control.tobytes() == own.control.tobytes()


def test_every_improvement_is_told_with_duration_and_bound(problems: Path) -> None:
    told: list[tuple[Trajectory, float]] = []

    class Watch:
        def __call__(self, stage: str, share: float) -> None:
            pass

        def found(self, trajectory: Trajectory, bound: float) -> None:
            told.append((trajectory, bound))

    problem = load_problem(problems / "12_planar.yaml")
    result = TrajOpt(TrajOptOptions(seeds=2)).plan(problem, Budget(30.0), Watch())
    assert result.trajectory is not None
    durations = [trajectory.duration for trajectory, _ in told]
    assert len(durations) == len(result.earlier) + 1
    assert durations[-1] == result.trajectory.duration
    assert all(0.0 < bound <= duration for (_, bound), duration in zip(told, durations, strict=True))


def test_threads_follow_the_spans_of_the_planner(problems: Path) -> None:
    problem = load_problem(problems / "01_reach.yaml")
    optimiser = Optimiser(problem, planning_model(problem.robot, problem.scene), TrajOptOptions(workers=2))
    ahead, waypoints = SpeculativeAttempts(optimiser, Budget(60.0)), np.array([problem.start, problem.start + 0.3])
    sizes = []
    for spans in (22, 40):
        optimiser.spread(spans)
        control = optimiser.along(waypoints)
        ahead.precompute([control], np.inf, False)
        wait_until(lambda: all(task.future.done() for task in ahead._tasks.values()))
        outcome = ahead.take(control, Budget(60.0), np.inf, False)
        assert outcome is not None
        assert outcome.attempt is not None
        assert outcome.attempt.control.shape == control.shape
        sizes.append(len(control))
    ahead.close()
    assert sizes[0] < sizes[1]
