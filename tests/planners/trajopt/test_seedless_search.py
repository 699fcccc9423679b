"""What is searched from one stream of numbers leads every seed to the same motion."""

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.goal_ranking import GoalSampler, goal_sampler
from optiplan.planners.trajopt import seedless_search
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import _Run
from optiplan.planners.trajopt.seedless_search import SeedlessSearch
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.stops import stop_at_corners
from tests.planners import cases
from tests.problem.goal_errors import goal_residual


def _searched(problem: Problem) -> tuple[_Run, SeedlessSearch]:
    """Run the search where the best motion is far from short."""
    run = _Run(problem, Budget(600.0), lambda stage, share: None, TrajOptOptions())
    run.patience.budget = Budget(20.0)
    sampler = goal_sampler(problem, run.model, run.budget)
    assert isinstance(sampler, GoalSampler)
    run.incumbent.bounded(float(problem.lower_bounds(sampler.configurations).min()))
    ends = np.array([problem.start, sampler.configurations[0]])
    slow = stop_at_corners(ends, problem.limits, problem.robot.joint_names)
    assert run.incumbent.offer(slow.scaled(20.0 * slow.duration))
    search = SeedlessSearch(run.attempts, run.paths)
    search.run()
    return run, search


def test_every_seed_gets_the_same_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow motion of each seed becomes the same curve, bit by bit, and no more work is done once that was made."""
    monkeypatch.setattr(seedless_search, "_SHARE", 1e-3)  # of 600 s: the work decides, not the clock
    curves = []
    for seed in (0, 5):
        run, search = _searched(cases.pose().with_seed(seed))
        curve = run.incumbent.curve
        assert curve is not None
        assert goal_residual(run.problem, curve.control[-1])[0].reached
        curves.append(curve.control)
        done = len(run.info["attempts"])
        search.run()
        assert len(run.info["attempts"]) == done, "once"
    np.testing.assert_array_equal(*curves)


def test_nothing_is_searched_for_a_joint_goal_nor_near_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    run, _ = _searched(cases.wall())
    assert "ways" not in run.info
    monkeypatch.setattr(seedless_search, "_NEAR", np.inf)
    run, _ = _searched(cases.pose())
    assert "ways" not in run.info


def test_configurations_drawn_within_a_time_are_those_of_every_seed() -> None:
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    drawn = [GoalSampler(problem, model, seed).within(3.0, 4) for seed in (0, 1)]
    assert drawn[0]
    np.testing.assert_array_equal(*drawn)
    assert (problem.lower_bounds(drawn[0]) < 3.0).all()
    assert not any(model.collides(q) for q in drawn[0])
    assert all(goal_residual(problem, q)[0].reached for q in drawn[0])
