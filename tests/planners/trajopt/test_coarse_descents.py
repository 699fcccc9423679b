"""Coarse curves tell what paths lead to, and full descents begin where they ended."""

from typing import Any

import numpy as np
import pytest

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.goal_ranking import GoalSampler, goal_sampler
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.local_searches import box_of_paths
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, _rounds, path_check, sample_path
from optiplan.planners.sampling.search import Search
from optiplan.planners.trajopt import planner
from optiplan.planners.trajopt.coarse_descents import CoarseCurve, CoarseDescents, GuessPath
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.path_search import PathSearch
from optiplan.planners.trajopt.program.sqp import STUCK, DescentOptions
from optiplan.planners.trajopt.stopping_rule import STEP
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.verify.verify import verify
from tests.planners import cases


def _run(problem: Problem) -> planner._Run:
    return planner._Run(problem, Budget(20.0), lambda stage, fraction: None, TrajOptOptions())


def _path(run: planner._Run) -> SampledPath:
    problem = run.problem
    path = sample_path(
        path_check(run.model, problem.limits), problem.start, [problem.goal[0].q], SamplingOptions(Budget(20.0))
    )
    assert isinstance(path, SampledPath)
    assert len(path.waypoints) > 2
    return path


def test_a_full_descent_from_a_coarse_one_takes_fewer_steps_to_as_short_a_motion() -> None:
    run = _run(cases.wall())
    path = _path(run)
    way = run.paths.coarse.descend(run.model, path, np.inf)
    assert way is not None
    assert way.control.shape == run.optimiser.along(path.waypoints).shape
    assert np.allclose(way.control[[0, -1]], path.waypoints[[0, -1]])
    direct = run.optimiser.run(run.optimiser.along(path.waypoints), Budget(20.0))
    steps = run.optimiser.taken
    after = run.optimiser.run(way.control, Budget(20.0))
    assert direct is not None
    assert after is not None
    assert after.free
    assert verify(run.problem, after.trajectory).verified
    assert run.optimiser.taken < steps
    assert after.trajectory.duration < 1.1 * direct.trajectory.duration
    assert 0.8 < way.duration / after.trajectory.duration < 1.2


def test_a_coarse_curve_that_stays_in_an_obstacle_tells_of_no_way() -> None:
    run = _run(cases.barred())
    ends = np.array([run.problem.start, run.problem.goal[0].q])
    assert run.paths.coarse.descend(run.model, SampledPath(ends, 0, 1.0, {}), np.inf) is None


def test_the_work_of_coarse_descents_is_counted() -> None:
    run = _run(cases.wall())
    before = run.patience.seconds
    run.paths.coarse.descend(run.model, _path(run), np.inf)
    assert STEP < run.patience.seconds - before < 50 * STEP


def test_a_curve_that_is_good_enough_takes_fewer_steps_and_does_not_stay_in_an_obstacle() -> None:
    run = _run(cases.wall())
    coarse = run.optimiser
    control = coarse.within_limits(coarse.along(_path(run).waypoints))
    descender = coarse.descender(control)
    descender.set_samples(coarse.instants(control, 0.05))
    to_the_end, soon, at_once = (
        descender.optimise(control, DescentOptions(40, lambda: False, enough=share)) for share in (0.0, 0.02, 10.0)
    )
    assert at_once.steps < soon.steps < to_the_end.steps
    assert max(at_once.missing, soon.missing) <= STUCK
    assert to_the_end.duration < soon.duration < 1.05 * to_the_end.duration
    assert soon.duration < at_once.duration


def test_the_most_promising_way_comes_first_and_the_others_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    run = _run(cases.wall())
    problem, promised = run.problem, iter((3.0, 1.0, 2.0, 9.0, 8.0, 0.5))
    sampler = goal_sampler(problem, run.model, run.budget)
    assert isinstance(sampler, GoalSampler)
    run.paths.offer_first(_path(run))
    monkeypatch.setattr(
        CoarseDescents, "descend", lambda self, model, path, best: CoarseCurve(np.zeros((0, 0)), next(promised))
    )
    seen = [run.paths.next(sampler, lambda waypoints: None) for _ in range(2)]
    assert [way.curve.duration for way in seen if isinstance(way, GuessPath) and way.curve] == [1.0, 0.5]


def test_a_way_that_promises_far_less_than_the_best_curve_is_optimised_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    run = _run(cases.wall())
    path = _path(run)
    assert run.attempts.attempt("sampled", run.optimiser.along(path.waypoints), run.budget) is not None
    sampler = goal_sampler(run.problem, run.model, run.budget)
    assert isinstance(sampler, GoalSampler)
    rough, told = run.incumbent.rough, []

    def descend(self: CoarseDescents, model: CollisionModel, path: SampledPath, best: float) -> CoarseCurve:
        told.append(rough * (0.95, 0.85, 0.5)[len(told)])
        return CoarseCurve(np.zeros((0, 0)), told[-1])

    monkeypatch.setattr(PathSearch, "_sample", lambda self, *given: path)
    monkeypatch.setattr(CoarseDescents, "descend", descend)
    way = run.paths.next(sampler, lambda waypoints: None)
    assert isinstance(way, GuessPath)
    assert way.curve is not None
    assert way.curve.duration == 0.85 * rough
    assert len(told) == 2


def test_a_first_motion_is_looked_for_along_further_paths_where_a_coarse_curve_stays_in_obstacles(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = _run(cases.wall())
    sampler = goal_sampler(run.problem, run.model, run.budget)
    assert isinstance(sampler, GoalSampler)
    path, promised, depths = _path(run), iter((None, None, 2.0, 1.0)), []

    def sampled(self: PathSearch, sampler: GoalSampler, check: MotionCheck, *given: Any) -> SampledPath:
        depths.append(check is not self._check())
        return path

    def descend(self: CoarseDescents, model: CollisionModel, path: SampledPath, best: float) -> CoarseCurve | None:
        duration = next(promised)
        return None if duration is None else CoarseCurve(np.zeros((0, 0)), duration)

    monkeypatch.setattr(PathSearch, "_sample", sampled)
    monkeypatch.setattr(CoarseDescents, "descend", descend)
    run.paths.searches = 1  # the short one, in vain
    way = run.paths.next(sampler, lambda waypoints: None)
    assert isinstance(way, GuessPath)
    assert way.curve is not None
    assert way.curve.duration == 2.0
    assert depths == [True] * 3


def test_ways_are_compared_with_the_best_curve_as_it_was_before_it_was_refined() -> None:
    run = _run(cases.wall())
    path = _path(run)
    attempt = run.attempts.attempt("sampled", run.optimiser.along(path.waypoints), run.budget)
    run.attempts.refine()
    assert attempt is not None
    rough = attempt.trajectory.duration
    assert run.incumbent.cost < 0.999 * rough
    assert run._hopeless(GuessPath(path, CoarseCurve(attempt.control, 1.001 * rough)))
    assert not run._hopeless(GuessPath(path, CoarseCurve(attempt.control, 0.9999 * rough)))


def test_searches_stay_where_motions_that_are_short_enough_pass() -> None:
    run = _run(cases.wall())
    problem, longest, boxes, least = run.problem, 3.0, [], []

    def search(check: Any, ends: Any, *given: Any, **more: Any) -> Search:
        boxes.append((check.limits.lower, check.limits.upper))
        least.append(check.least)
        return Search(None, ends[0][None], ends[1], (1, 1))

    goal = problem.goal[0].q
    options = SamplingOptions(Budget(20.0), searcher=search, begun=1, longest=longest)
    sample_path(path_check(run.model, problem.limits), problem.start, [goal], options)
    within = box_of_paths(problem.start, goal[None], np.array([longest]), problem.limits)
    assert np.allclose(boxes, [within])
    assert least == [lower_bound(problem.start, goal, problem.limits)]


@pytest.mark.parametrize(("soon", "far", "expected"), [(True, 1.0, None), (True, 0.01, 0.5), (False, 1.0, np.inf)])
def test_a_path_that_is_needed_soon_is_searched_on_short_motions_first(
    soon: bool, far: float, expected: float | None
) -> None:
    run = _run(cases.wall())
    problem, least = run.problem, []
    goal = problem.start + far * (problem.goal[0].q - problem.start)

    def search(check: Any, ends: Any, *given: Any, **more: Any) -> Search:
        least.append(check.least)
        return Search(None, ends[0][None], ends[1], (1, 1))

    check = path_check(run.model, problem.limits)
    _rounds(
        check,
        (problem.start, goal[None]),
        SamplingOptions(Budget(20.0), searcher=search, begun=1, soon=soon),
        np.random.default_rng(0),
    )
    assert least == [expected or lower_bound(problem.start, goal, problem.limits)]


def test_coarse_curves_are_compared_by_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a second costs 10 s, a curve of two seconds costs 20 s."""
    run = _run(derived(cases.wall(), objective=Objective(10.0)))
    compared: list[float] = []

    def descend(self: CoarseDescents, model: object, path: object, best: float) -> CoarseCurve:
        compared.append(best)
        return CoarseCurve(np.zeros((0, 0)), 2.0)

    monkeypatch.setattr(CoarseDescents, "descend", descend)
    monkeypatch.setattr(run.paths, "_another", lambda sampler: SampledPath(np.zeros((3, 7)), 0, 1.0, {}))
    monkeypatch.setattr(run.paths, "_first", lambda waypoints: None)
    sampler = goal_sampler(run.problem, run.model, run.budget)
    assert isinstance(sampler, GoalSampler)
    run.paths._compared(sampler, None, 2)
    assert compared == [np.inf, 20.0]


def _slalom() -> tuple[Problem, Array]:
    """A mobile arm that drives through a door in each of six walls, now left, now right; and a path (14, 9)."""
    arm, walls, way = [0.3, -0.6, -1.2, -2.9, -1.5708, 0.0], [], [[-4.4, 0.0]]
    for k, x in enumerate(np.linspace(-3.5, 3.5, 6).tolist()):
        y = 1.5 * (-1.0) ** k
        for name, end, door in (("left", 4.0, y + 0.65), ("right", -4.0, y - 0.65)):
            walls.append(cases.box(f"{name} of {k}", (0.1, abs(end - door), 1.0), (x, 0.5 * (end + door), 0.5)))
        way += [[x - 0.62, y], [x + 0.62, y]]
    waypoints = np.array([[*place, 0.0, *arm] for place in (*way, [4.4, 0.0])])
    return cases.problem("delbot", waypoints[0], [JointGoal(waypoints[-1])], *walls), waypoints


def test_curves_get_the_spans_that_a_path_of_many_legs_needs() -> None:
    problem, waypoints = _slalom()
    run = _run(problem)
    coarse, spans = run.paths.coarse, run.optimiser.options.spans
    assert path_check(run.model, problem.limits).polyline_free(waypoints)
    coarse.follow(waypoints[:8])
    assert run.optimiser.options.spans == spans
    assert coarse.at_once(waypoints) is None
    coarse.follow(waypoints)
    curve = coarse.at_once(waypoints)
    assert curve is not None
    assert verify(problem, curve).verified
    assert run.optimiser.options.spans > spans
    assert len(run.optimiser.along(waypoints)) > len(_run(problem).optimiser.along(waypoints))


def test_spans_stay_once_there_is_a_curve() -> None:
    """One that begins where another ended has as many."""
    problem, waypoints = _slalom()
    run = _run(problem)
    path, spans = SampledPath(waypoints, 0, 1.0, {}), run.optimiser.options.spans
    others = run.paths.anew(run.patience, run.incumbent)
    others._follow(path)
    assert run.optimiser.options.spans == spans
    run.paths._waiting.append((path, CoarseCurve(waypoints, 1.0)))
    run.paths._follow(path)
    assert run.optimiser.options.spans == spans
    run.paths._waiting.clear()
    run.paths._follow(path)
    assert run.optimiser.options.spans > spans
