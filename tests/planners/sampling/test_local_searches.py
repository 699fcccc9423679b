"""Paths improved by searches between two of their points."""

from functools import cache

import numpy as np
import pytest

from optiplan._core import core
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import PartialCheck
from optiplan.planners.sampling.local_searches import box_of_paths, improved_path
from optiplan.planners.sampling.ompl_search import rrt_connect
from optiplan.planners.sampling.ompl_space import search_bounds
from optiplan.planners.sampling.sample_path import path_check
from optiplan.planners.sampling.search import carrying
from optiplan.planners.sampling.shortcutting import path_time, shorten
from optiplan.problem.problem import JointGoal
from optiplan.trajectory.timing.lower_bound import lower_bound
from tests.planners import cases
from tests.planners.polyline import polyline_contact

START, GOAL = np.array([0.8, -0.6]), np.array([-0.8, -0.6])
AROUND = np.array([START, [0.8, 1.5], [-0.8, 1.5], GOAL])
"""The long way around a post that the stretched planar arm meets: with the elbow to the other side."""


@cache
def _post():
    post = cases.box("post", (0.1, 0.1, 0.1), (1.067, 0.175, 0.485))
    problem = cases.problem("planar2r", START, [JointGoal(GOAL)], post)
    model = planning_model(problem.robot, problem.scene)
    return problem, model, path_check(model, problem.limits)


def _cost(path):
    return float(path_time(path, _post()[0].limits.velocity).sum())


def _improved(path, searches=30, seed=0):
    return improved_path(_post()[2], path, rrt_connect, Budget(20.0), np.random.default_rng(seed), searches)


@pytest.mark.parametrize("seed", range(3))
def test_a_search_finds_the_other_way_around_where_shortcuts_find_none(seed):
    problem, model, check = _post()
    assert check.polyline_free(AROUND)
    draws = np.random.default_rng(seed).uniform(size=(200, 3))
    shortened = shorten(check, AROUND, problem.limits.velocity, draws, Budget(20.0))
    assert shortened[:, 1].max() > 0.0  # still by the other side
    improved = _improved(AROUND, seed=seed)
    assert improved[:, 1].max() <= 0.0
    assert _cost(improved) < 0.7 * _cost(shortened)
    assert np.array_equal(improved[[0, -1]], AROUND[[0, -1]])
    assert polyline_contact(model, improved) is None


def test_each_search_makes_a_path_no_dearer_and_the_seed_decides():
    costs = [_cost(_improved(AROUND, searches)) for searches in range(8)]
    assert costs[0] == _cost(AROUND)
    assert np.all(np.diff(costs) <= 0.0)
    assert np.array_equal(_improved(AROUND, 8), _improved(AROUND, 8))
    assert not np.array_equal(_improved(AROUND, 8), _improved(AROUND, 8, seed=1))


def test_nothing_is_searched_where_the_budget_is_over():
    spent = improved_path(_post()[2], AROUND, rrt_connect, Budget(0.0), np.random.default_rng(0), 30)
    assert np.array_equal(spent, AROUND)


def test_the_box_holds_what_a_path_in_that_time_can_pass():
    limits = _post()[0].limits
    goals, longest = np.array([GOAL, [0.4, 0.2]]), np.array([1.2, 0.7])
    low, high = box_of_paths(START, goals, longest, limits)
    rng = np.random.default_rng(0)
    points = rng.uniform(limits.lower, limits.upper, (20_000, 2))
    through = np.abs(points - START) + np.abs(goals[:, None] - points)
    passable = ((through / limits.velocity).max(axis=2) <= longest[:, None]).any(axis=0)
    inside = ((low <= points) & (points <= high)).all(axis=1)
    assert passable.any()
    assert not (passable & ~inside).any()
    assert not inside.all()


_ITERATIONS, _DOUBLED = 400, 2500  # of a search; in which the duration doubles


def _searched(least):
    """Return the configurations of all trees of some searches that begin with motions of this duration, s."""
    problem, _, check = _post()
    goals, box = GOAL[None], (problem.limits.lower, problem.limits.upper)
    part = PartialCheck(check.by_moment_arms(), START, np.ones(2, dtype=bool), box, least)
    searches = [rrt_connect(part, (START, goals), Budget(20.0), seed, patience=_ITERATIONS) for seed in range(1, 11)]
    return np.vstack([tree for found in searches for tree in (found.start_tree, found.goal_tree)])


def _seconds_through(Q):
    """Return the least time at full speed through each configuration of Q (k, 2), s."""
    velocity = _post()[0].limits.velocity
    return sum((np.abs(Q - end) / velocity).max(axis=1) for end in (START, GOAL))


@pytest.mark.skipif(core is None, reason="native core")
def test_searches_draw_configurations_that_short_motions_pass_through():
    least = 1.3 * lower_bound(START, GOAL, _post()[0].limits)
    most = least * 2 ** (_ITERATIONS / _DOUBLED)
    short = _searched(least)
    assert _seconds_through(short).max() <= most
    assert _seconds_through(_searched(np.inf)).max() > 1.1 * most
    assert np.array_equal(short, _searched(least))


@pytest.mark.skipif(core is None, reason="the native core is not built")
def test_where_a_search_is_cut_changes_nothing():
    """Also in the midst of a connection."""
    problem = cases.duct()
    check = path_check(planning_model(problem.robot, problem.scene), problem.limits).by_moment_arms()
    still, joints = check.searched
    goal, limits = problem.goal[0].q, problem.limits
    bounds = search_bounds(limits, (problem.start, goal[None]))
    rows = np.vstack([*bounds, check.units, limits.velocity, limits.acceleration])

    def search(rows=rows):
        ends = problem.start, goal[None]
        return core.RrtConnect(check.native, still, np.flatnonzero(joints), rows, check.least, 0, *ends, 0.4, 3)

    whole, cut = search(), search()
    whole.grow(20_000, 1e9)
    while not cut.met:
        cut.grow(20_000, 1e-4)
    assert cut.iterations == whole.iterations
    assert np.array_equal(cut.path(7), whole.path(7))
    with pytest.raises(ValueError, match="units above 0"):
        search(rows * np.array([1.0, 1.0, 0.0, 1.0, 1.0])[:, None])


def test_a_base_that_drives_carries_an_arm():
    assert carrying(cases.robot("delbot").revolute) == 3
    assert carrying(cases.robot("panda").revolute) == 0
    assert carrying(np.array([False, True, True])) == 0  # a torso that lifts an arm
    assert carrying(np.array([False, False, True])) == 0  # a base alone
    assert carrying(np.array([False, False, False])) == 0


@pytest.mark.skipif(core is None, reason="the native core is not built")
def test_a_way_for_a_base_is_found_sooner_with_its_arm_as_at_an_end():
    """Through one door after the other."""
    arm = [[0.3, -0.6, -1.2, -2.9, -1.5708, 0.0], [0.8, -0.9, -1.0, -2.5, -1.2, 0.4]]
    start, goal = np.array([-3.0, 0.0, 0.0, *arm[0]]), np.array([3.0, 0.0, 0.0, *arm[1]])
    walls = [
        cases.box(f"wall {x} {side}", (0.1, 4.0, 1.5), (x, door + 2.6 * side, 0.75))
        for x, door in ((-1.5, 2.0), (0.0, -2.0), (1.5, 2.0))
        for side in (-1, 1)
    ]
    problem = cases.problem("delbot", start, [JointGoal(goal)], *walls)
    check = path_check(planning_model(problem.robot, problem.scene), problem.limits).by_moment_arms()
    limits = problem.limits
    rows = np.vstack([*search_bounds(limits, (start, goal[None])), check.units, limits.velocity, limits.acceleration])

    def iterations(carriers: int) -> int:
        total = 0
        for seed in range(4):
            ends = start, goal[None]
            trees = core.RrtConnect(check.native, start, np.arange(9), rows, np.inf, carriers, *ends, 0.4, seed)
            trees.grow(20_000, 1e9)
            total += trees.iterations
        return total

    assert iterations(3) < 0.5 * iterations(0)
    with pytest.raises(ValueError, match="carriers among the searched joints"):
        iterations(10)
