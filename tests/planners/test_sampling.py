"""Sampled paths: proved, repeatable, through several goals, with reasons when there are none."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.path_timing import timed_path
from optiplan.planners.sampling import sample_path as paths
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_search import rrt_connect
from optiplan.planners.sampling.sample_path import SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.search import Search
from optiplan.planners.sampling.shortcutting import path_cost, path_time, shorten
from optiplan.planners.sampling.shrunk_obstacles import thinned, through_thinner
from optiplan.planners.trajopt import planner as trajopt
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import derived
from tests.planners import cases
from tests.planners.polyline import polyline_contact

pytestmark = pytest.mark.usefixtures("processor_clock")


def sample(problem, goals=None, **options):
    model = CollisionModel(problem.robot, problem.scene)
    options = {"budget": Budget(20.0)} | options
    goals = [goal.q for goal in problem.goal] if goals is None else goals
    return sample_path(path_check(model, problem.limits), problem.start, goals, SamplingOptions(**options))


@pytest.mark.parametrize("seed", range(4))
def test_path_is_proved_and_ends_exactly(seed):
    problem = cases.wall()
    path = sample(problem, seed=seed)
    assert np.array_equal(path.waypoints[0], problem.start)
    assert np.array_equal(path.waypoints[-1], cases.LEFT)
    assert polyline_contact(CollisionModel(problem.robot, problem.scene), path.waypoints) is None
    assert path.cost == pytest.approx(path_time(path.waypoints, problem.limits.velocity).sum())
    assert path.goal_index == 0


def test_same_seed_same_path_and_another_seed_another():
    first, again, other = (sample(cases.wall(), seed=seed).waypoints for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_blocked_goals_are_passed_over():
    problem = cases.goal_in_wall()
    path = sample(problem, goals=[cases.LEFT, cases.READY + 0.2])
    assert path.goal_index == 1
    assert np.array_equal(path.waypoints[-1], cases.READY + 0.2)


def test_a_joint_without_bounds_may_turn_either_way():
    problem = cases.planar()
    endless = replace(problem.limits, lower=np.array([-np.inf, -2.8]), upper=np.array([np.inf, 2.8]))
    path = sample(derived(problem, limits=endless), goals=[np.array([-9.0, 0.3])])
    assert path.waypoints[-1][0] == -9.0


def test_no_path_names_bodies_and_tree_sizes():
    failure = sample(cases.barred(), budget=Budget(0.5))
    assert isinstance(failure, Failure)
    assert failure.kind == "no-path"
    assert "states) stay" in failure.detail
    assert failure.witness["pair"][1].startswith("bar")
    assert failure.witness["distance"] <= 0.0


def test_no_path_names_bodies_where_the_trees_lie_on_one_side():
    """KPIECE checks edges late: its tree from the goal may hold states beyond the bar, which no edge leads to."""
    problem = cases.barred()
    beside = np.array([[0.2, 0.3], [0.1, 0.2]])
    assert not any(CollisionModel(problem.robot, problem.scene).collides(q) for q in beside)

    def searcher(check, ends, budget, seed, patience):
        return Search(None, ends[0][None], np.vstack([ends[1], beside]), (1, 3))

    failure = sample(problem, budget=Budget(0.05), searcher=searcher)
    assert failure.kind == "no-path"
    assert failure.witness["pair"][1].startswith("bar")
    assert "(3 states) are not joined; on the straight line from the start to the goal" in failure.detail


def test_cancel_is_seen_within_a_fifth_of_a_second():
    cancel = threading.Event()
    threading.Timer(0.3, cancel.set).start()
    began = time.process_time()
    failure = sample(cases.barred(), budget=Budget(30.0, cancel))
    assert failure.kind == "cancelled"
    assert time.process_time() - began < 0.7  # of this process, whatever others do


def test_two_threads_get_what_one_would():
    alone = [sample(cases.wall(), seed=seed).waypoints for seed in (1, 2)]
    together = {}
    threads = [
        threading.Thread(target=lambda seed=seed: together.update({seed: sample(cases.wall(), seed=seed).waypoints}))
        for seed in (1, 2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(together[seed], alone[seed - 1]) for seed in (1, 2))


def test_shortcuts_never_lengthen_and_keep_the_ends():
    model = CollisionModel(cases.robot("panda"), cases.wall().scene)
    limits = model.robot.limits
    rng = np.random.default_rng(0)
    path = cases.READY + np.cumsum(np.vstack([np.zeros(7), rng.uniform(-0.15, 0.15, (8, 7))]), axis=0)
    check = MotionCheck(model, limits)
    assert check.polyline_free(path)
    shorter = shorten(check, path, limits.velocity, rng.uniform(size=(100, 3)), Budget(10.0))
    assert np.array_equal(shorter[[0, -1]], path[[0, -1]])
    assert path_time(shorter, limits.velocity).sum() < 0.9 * path_time(path, limits.velocity).sum()
    assert check.polyline_free(shorter)


def test_timed_path_is_free_and_faster_than_stops():
    problem = cases.wall()
    model = CollisionModel(problem.robot, problem.scene)
    path = sample(problem, seed=1).waypoints
    names = problem.robot.joint_names
    from optiplan.planners.common.continuous_collision import first_contact
    from optiplan.trajectory.timing.stops import stop_at_corners

    stops = stop_at_corners(path, problem.limits, names)
    trajectory = timed_path(model, path, problem.limits, Budget(20.0))
    assert trajectory.duration < stops.duration
    assert first_contact(model, trajectory) is None
    hurried = timed_path(model, path, problem.limits, Budget(0.0))
    assert hurried.duration == stops.duration


def giving_up(most):
    """RRT-Connect in rounds of together at most so many iterations: an effort that is counted, not timed."""
    left = [most]

    def searcher(check, ends, budget, seed, *, patience):
        left[0] -= patience
        found = rrt_connect(check, ends, budget, seed, patience=patience if left[0] >= 0 else 0)
        return replace(found, impatient=found.impatient and left[0] >= 0)

    return searcher


def test_a_long_narrow_place_is_left_by_taking_turns():
    problem, how = cases.duct(), {"seed": 3, "detour": np.inf, "attempts": 10}
    alone = sample(problem, searcher=giving_up(2500), alternate=None, **how)
    assert isinstance(alone, Failure)
    path = sample(problem, searcher=giving_up(2500), **how)
    assert polyline_contact(CollisionModel(problem.robot, problem.scene), path.waypoints) is None
    assert np.array_equal(path.waypoints[-1], cases.IN_DUCT)


def test_a_path_that_is_needed_soon_gets_shortcuts_while_they_gain(monkeypatch):
    """Nearly straight, it gets few; else it is made shorter than by those, until they gain little."""
    problem, tried = cases.wall(), []

    def counted(check, path, velocity, draws, budget):
        shorter = shorten(check, path, velocity, draws, budget)
        tried.append((len(draws), path_cost(shorter, velocity)))
        return shorter

    monkeypatch.setattr(paths, "shorten", counted)
    sample(problem, soon=True, attempts=10_000)
    assert len(tried) == 1  # it costs less than 1.2 times the straight line
    few = tried.pop()
    monkeypatch.setattr(paths, "_STRAIGHT", 1.0)
    path = sample(problem, soon=True, attempts=10_000)
    assert tried[0] == few
    assert few[0] < tried[1][0]
    assert len(tried) < 10
    assert path.cost == tried[-1][1] < few[1]
    assert polyline_contact(CollisionModel(problem.robot, problem.scene), path.waypoints) is None


def test_rounds_take_turns_and_so_do_the_goals():
    """A goal that comes first in one round is the last in the next; the other searcher has more iterations."""
    goals = [cases.LEFT, cases.LEFT + 0.05, cases.LEFT + 0.1]

    def rounds_in_vain(seed):
        rounds, seeds = [], []

        def never(name):
            def searcher(check, ends, budget, seed, *, patience):
                rounds.append((name, patience, [float(goal[0]) for goal in ends[1]]))
                seeds.append(seed)
                return Search(None, ends[0][None], ends[1], (1, 1), impatient=len(rounds) < 5)

            return searcher

        fresh = iter([[cases.LEFT + 0.15], [], [], []])
        both = {"searcher": never("mine"), "alternate": never("other"), "more_goals": lambda count, stop: next(fresh)}
        assert sample(cases.wall(), goals=goals, seed=seed, **both).kind == "no-path"
        return rounds, seeds

    (rounds, seeds), again, other = (rounds_in_vain(seed) for seed in (3, 3, 4))
    assert again == (rounds, seeds)
    assert len({*seeds, *other[1]}) == 10, "each round draws anew"
    assert [name for name, _, _ in rounds] == ["mine", "mine", "other", "mine", "other"]
    assert [patience for _, patience, _ in rounds] == [500, 1500, 30000, 4500, 90000]
    first, second, third, fourth = 1.2, 1.25, 1.3, 1.35
    assert np.allclose(rounds[1][2], [first, second, third])
    assert np.allclose(rounds[2][2], [second, third, fourth, first])
    assert np.allclose(rounds[3][2], [third, fourth, first, second])


@pytest.mark.parametrize(("begun", "turns"), [(0, "RKRKTRTKTRTTTKTT"), (2, "TRTKTRTTTKTT")])
def test_thinner_obstacles_take_turns_after_the_second_round_of_both(begun, turns):
    """Where the first two rounds have been made before, they come first."""
    rounds = []

    def never(name):
        def searcher(check, ends, budget, seed, *, patience):
            rounds.append((name, patience))
            return Search(None, ends[0][None], ends[1], (1, 1), impatient=len(rounds) < len(turns))

        return searcher

    options = {"searcher": never("R"), "alternate": never("K"), "relaxed": never("T"), "detour": np.inf}
    assert sample(cases.wall(), goals=[cases.LEFT], begun=begun, **options).kind == "no-path"
    assert "".join(name for name, _ in rounds) == turns
    assert {patience for name, patience in rounds if name == "T"} == {90_000}


def test_a_path_between_thinner_obstacles_is_proved_between_the_real_ones():
    problem = cases.wall()
    model = CollisionModel(problem.robot, problem.scene)
    check, ends = MotionCheck(model, problem.limits), (problem.start, cases.LEFT[None])
    assert all(
        np.allclose(np.subtract(real.shape.size, thin.shape.size).max(), 0.04)
        for real, thin in zip(problem.scene.obstacles, thinned(problem.scene).obstacles, strict=True)
    )
    touching = np.array([problem.start, cases.LEFT])
    assert not check.polyline_free(touching)
    free = sample(problem).waypoints
    asked = []

    def found(repaired):
        def repair(waypoints):
            asked.append(waypoints)
            return repaired

        return through_thinner(repair)(check, ends, Budget(20.0), 1, patience=1e5)

    assert np.array_equal(found(free).path, free)
    for rejected in (found(touching), found(None)):
        assert rejected.path is None
        assert rejected.impatient
    assert np.array_equal(asked[0][[0, -1]], touching)
    assert all(not check.polyline_free(path) for path in asked)  # what is free needs no repair
    assert MotionCheck(CollisionModel(problem.robot, thinned(problem.scene)), problem.limits).polyline_free(asked[0])


def test_the_path_as_it_was_found_is_repaired_where_the_cheaper_one_cannot_be():
    problem = cases.wall()
    check = MotionCheck(CollisionModel(problem.robot, problem.scene), problem.limits)
    free, asked = sample(problem).waypoints, []

    def repair(waypoints):
        asked.append(float(path_time(waypoints, problem.limits.velocity).sum()))
        return free if len(asked) > 1 else None

    seeds = iter(range(1, 30))
    while len(asked) < 2:
        asked.clear()
        ends = (problem.start, cases.LEFT[None])
        found = through_thinner(repair)(check, ends, Budget(20.0), next(seeds), patience=1e5)
    assert asked[0] < asked[1]
    assert np.array_equal(found.path, free)


def test_the_optimiser_repairs_a_path_between_thinner_obstacles():
    problem = cases.wall()
    run = trajopt._Run(problem, Budget(20.0), lambda stage, share: None, TrajOptOptions())
    check = MotionCheck(run.model, problem.limits)
    ends = (problem.start, cases.LEFT[None])
    found = through_thinner(run._repaired)(check, ends, Budget(20.0), 1, patience=1e5)
    assert [attempt["seed"] for attempt in run.info["attempts"]] == ["relaxed"]
    assert np.array_equal(found.path[[0, -1]], [problem.start, cases.LEFT])
    assert polyline_contact(run.model, found.path) is None
    assert run.incumbent.candidates


def test_a_stage_within_another_counts_for_itself_alone(by_hand):
    watch = Stopwatch()
    with watch.stage("outer"):
        by_hand[0] += 1.0
        with watch.stage("inner"):
            by_hand[0] += 2.0
    assert watch.seconds == {"inner": 2.0, "outer": 1.0}


def test_what_is_done_aside_counts_for_no_stage(by_hand):
    watch = Stopwatch()
    with watch.stage("outer"), watch.aside():
        by_hand[0] += 1.0
    assert watch.seconds == {"outer": 0.0}
