"""The ends of a pose goal are compared by their bounds before a search stops."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from optiplan.arrays import Array
from optiplan.collision.contacts import Contacts
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.goal_improvement import NearerEnds
from optiplan.planners.common.goal_ranking import GoalSampler, are_distinct
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.planners.trajopt.stopping_rule import PRICE, EndsInVain, Patience
from optiplan.problem.goals import GoalOptions
from optiplan.problem.problem import PoseGoal
from tests.planners import cases
from tests.problem.goal_errors import goal_residual

FAR = 1.2
"""Least bound of the ends that the first draw is left with, in that of the nearest of all."""


def test_an_end_reached_at_its_own_bound_is_compared_with_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first draw has far ends alone, of which a straight line reaches the nearest at its bound."""
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    all_ends = GoalSampler(problem, model, 0)
    all_ends.more(10)
    bounds = problem.lower_bounds(all_ends.configurations)
    far = [q for q, bound in zip(all_ends.configurations, bounds, strict=True) if bound > FAR * bounds[0]]
    assert far
    begin = GoalSampler.__init__

    def unlucky(self: GoalSampler, *given: object, **named: object) -> None:
        begin(self, *given, **named)  # type: ignore[arg-type]
        self.configurations = list(far)

    monkeypatch.setattr(GoalSampler, "__init__", unlucky)
    result = TrajOpt(TrajOptOptions()).plan(problem, Budget(60.0), lambda stage, share: None)
    assert result.trajectory is not None
    assert result.trajectory.duration < FAR * bounds[0]


def test_steps_towards_the_start_among_obstacles_stay_free() -> None:
    """Every step stays in the goal and free, and the bound falls."""
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    ends = GoalSampler(problem, model, 0, GoalOptions(4), nearer=False).configurations
    goal = problem.goal[0]
    assert isinstance(goal, PoseGoal)
    nearer = NearerEnds(problem, goal)
    for q in ends:
        passed = nearer.towards_start(q, model)
        assert not any(model.collides(end) for end in passed)
        assert all(goal_residual(problem, end)[0].reached for end in passed)
        falling = problem.lower_bounds([q, *passed])
        assert (np.diff(falling) < 0.0).all()


def test_a_refused_step_does_not_ask_for_the_same_distances_again(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    ends = GoalSampler(problem, model, 0, GoalOptions(4), nearer=False).configurations
    goal = problem.goal[0]
    assert isinstance(goal, PoseGoal)
    asked: list[bytes] = []
    near, step, steps = CollisionModel.near, NearerEnds._step, []

    def counted(self: CollisionModel, Q: Array, cutoff: float) -> Contacts:
        asked.append(Q.tobytes())
        return near(self, Q, cutoff)

    def stepped(self: NearerEnds, *given: Any) -> Array | None:
        steps.append(given)
        return step(self, *given)

    monkeypatch.setattr(CollisionModel, "near", counted)
    monkeypatch.setattr(NearerEnds, "_step", stepped)
    for q in ends:
        asked.clear()
        NearerEnds(problem, goal).towards_start(q, model)
        assert len(asked) == len(set(asked))
    assert len({given[0].tobytes() for given in steps}) < len(steps), "some steps are refused"


def test_the_ends_of_branches_are_apart_free_and_within_the_time() -> None:
    problem = cases.pose()
    sampler = GoalSampler(problem, CollisionModel(problem.robot, problem.scene), 0, GoalOptions(4))
    ends = sampler.nearest_ends(3.0)
    bounds = problem.lower_bounds(ends)
    assert (np.diff(bounds) >= 0.0).all()
    assert bounds[-1] < 3.0
    assert all(are_distinct(q, other, problem.limits) for k, q in enumerate(ends) for other in ends[:k])
    assert all(goal_residual(problem, q)[0].reached for q in ends)
    assert sampler.nearest_ends(float(bounds[0])) == [], "none is sooner than the soonest"


def test_seeds_agree_on_the_nearest_end() -> None:
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    nearest = [
        problem.lower_bounds(GoalSampler(problem, model, seed, GoalOptions(2)).nearest_ends(3.0))[0]
        for seed in range(4)
    ]
    assert max(nearest) < 1.02 * min(nearest)


def test_the_rule_for_ends_by_hand() -> None:
    """g² / (1 + k) (1 + t) against PRICE / budget times the work of a try."""
    patience, done = Patience(Budget(10.0)), EndsInVain(tried=4, in_vain=1, seconds=2.0)
    bound = 1.0 - np.sqrt(PRICE * 0.5 / 10.0 * (1 + 1) * (1 + 2))
    assert patience.worth_an_end(1.0, bound - 1e-6, 2, done)
    assert not patience.worth_an_end(1.0, bound + 1e-6, 2, done)
    assert not replace(patience, good_enough=1.1).worth_an_end(1.0, 0.95, 0, EndsInVain())
    done.record(1.0, gained=True)
    assert (done.tried, done.in_vain, done.each) == (5, 0, 0.6)
