"""Paths that are looked at here and there lead to curves; only what is proved is offered as a motion."""

import numpy as np
import pytest

from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.goal_ranking import GoalSampler, goal_sampler
from optiplan.planners.sampling import sample_path
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.sample_path import NoPath, SampledPath
from optiplan.planners.trajopt import planner
from optiplan.planners.trajopt.coarse_descents import CoarseDescents
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import Problem
from optiplan.verify.verify import verify
from tests.planners import cases


def _run(problem: Problem) -> planner._Run:
    return planner._Run(problem, Budget(20.0), lambda stage, fraction: None, TrajOptOptions())


def _sampler(run: planner._Run) -> GoalSampler:
    sampler = goal_sampler(run.problem, run.model, run.budget)
    assert isinstance(sampler, GoalSampler)
    return sampler


def test_a_path_that_touches_is_not_offered() -> None:
    run = _run(cases.wall())
    assert run.paths._stopping(np.array([run.problem.start, run.problem.goal[0].q])) is None
    assert not run.incumbent.candidates


@pytest.mark.parametrize("is_free", [True, False])
def test_without_a_free_curve_a_proved_path_is_the_motion(is_free: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CoarseDescents, "at_once", lambda self, waypoints: None)
    run = _run(cases.wall())
    real, searched = run.paths._briefly, []

    def noted(sampler: GoalSampler, check: MotionCheck, work: float) -> SampledPath | Failure:
        searched.append(check is run.paths._check())
        return real(sampler, check, work)

    monkeypatch.setattr(run.paths, "_briefly", noted)
    if not is_free:
        monkeypatch.setattr(run.paths, "free", lambda waypoints: False)
        monkeypatch.setattr(run.paths, "_stopping", lambda waypoints: None)
    run.paths.at_once(_sampler(run))
    proved = run.paths._check().here_and_there() is run.paths._check()
    by_turns = [proved, True, False] * 2 + [False]  # False: between thinner obstacles
    assert searched == ([proved] if is_free else by_turns)
    assert run.paths.found is not None
    assert len(run.incumbent.candidates) == is_free
    for found in run.incumbent.candidates:
        assert verify(run.problem, found.trajectory).verified


def test_a_brief_search_aims_at_the_ends_that_may_be_reached_soonest(monkeypatch: pytest.MonkeyPatch) -> None:
    run = _run(cases.any_of())
    sampler, aimed = _sampler(run), []
    monkeypatch.setattr(run.paths, "_sample", lambda *given: aimed.append(given[-1]))
    run.paths._briefly(sampler, run.paths._check(), 0.01)
    bounds = run.problem.lower_bounds(sampler.configurations)
    (aims,) = aimed
    assert 0 < len(aims) == (bounds <= 1.05 * bounds[0]).sum() < len(bounds)


def test_where_no_end_can_be_reached_sooner_nothing_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """An end between those that are known may have a lower bound than all of them."""
    run = _run(cases.any_of())
    sampler = _sampler(run)
    monkeypatch.setattr(run.paths, "promising", lambda sampler: [])
    assert isinstance(run.paths._briefly(sampler, run.paths._check(), 0.01), Failure)
    assert isinstance(run.paths.next(sampler, lambda path: None), Failure)
    assert run._line(sampler, 7).shape == (run.optimiser.basis.size, run.problem.robot.n)
    assert not run.paths.searches or not run.incumbent.candidates


def test_where_no_path_is_seen_one_between_thinner_obstacles_may_lead_to_a_curve(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = _run(cases.wall())
    real, blocked = run.paths._briefly, []

    def none_between_real_obstacles(sampler: GoalSampler, check: MotionCheck, work: float) -> SampledPath | Failure:
        if check.model is run.model:
            blocked.append(work)
            return Failure("no-path", "made up")
        return real(sampler, check, work)

    monkeypatch.setattr(run.paths, "_briefly", none_between_real_obstacles)
    run.paths.at_once(_sampler(run))
    assert blocked[0] < 0.01  # at a glance
    assert len(blocked) == (1 if run.incumbent.candidates else 2)
    assert run.paths.found is not None
    assert run.paths.found.goal_index == 0
    for candidate in run.incumbent.candidates:
        assert verify(run.problem, candidate.trajectory).verified


def test_searches_in_vain_are_explained_where_no_motion_is_found_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    real, explained = sample_path._no_path, []
    monkeypatch.setattr(sample_path, "_no_path", lambda *given: explained.append(given) or real(*given))
    run = _run(cases.barred())
    sampler = _sampler(run)
    failures = [run.paths._briefly(sampler, run.paths._check(), 0.001) for _ in range(2)]
    assert all(isinstance(failure, NoPath) for failure in failures)
    assert not explained
    planned = planner._Run(run.problem, Budget(0.3), lambda stage, fraction: None, TrajOptOptions()).result()
    assert len(explained) == 1
    assert planned.failure is not None
    assert "the tree from the start" in planned.failure.detail


def test_a_path_is_proved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    run = _run(cases.wall())
    waypoints, asked = np.array([run.problem.start, run.problem.goal[0].q]), []
    monkeypatch.setattr(MotionCheck, "polyline_free", lambda self, path: asked.append(path) or False)
    assert run.paths._stopping(waypoints) is None
    assert not run.paths.free(waypoints)
    assert len(asked) == 1
    assert run.paths._stopping(waypoints.copy()) is None
    assert len(asked) == 2
