"""Bounds of whole problems: beside a search by brute force on a planar arm, and beside motions that are known."""

import heapq
from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.collision.model import CollisionModel
from optiplan.problem.problem import derived
from optiplan.robot.limits import Limits
from optiplan.verify.bounds.bound import bound_of, unsupported
from optiplan.verify.bounds.duration_bound import DurationBound
from optiplan.verify.bounds.search import LONGEST
from tests.planned import planned_until

needs_core = pytest.mark.skipif(core is None, reason="needs the native core")

BLOCKS = (
    op.Box("block", size=(0.2, 0.4, 0.2), position=(0.9, 0.18, 0.6)),
    op.Box("shelf", size=(0.2, 0.4, 0.04), position=(0.75, 0.18, 1.15)),
    op.Sphere("ball", radius=0.1, position=(0.95, 0.18, 0.6)),
)


@pytest.fixture(scope="module", params=BLOCKS[::2], ids=lambda block: block.name)
def blocked(request):
    """A planar arm that has to fold to get past an obstacle, with limits of speed alone."""
    problem = op.load_problem("12_planar").with_scene([request.param])
    old, much = problem.limits, np.full(2, 1e9)
    return derived(problem, limits=Limits(old.lower, old.upper, old.velocity, much, much * np.inf, old.torque))


def fastest_on_a_grid(problem, count):
    """The least time, s, over the points of a grid, from one to its eight neighbours at the greatest speeds."""
    model, limits = CollisionModel(problem.robot, problem.scene), problem.limits
    low = np.minimum(problem.start, problem.goal[0].q) - 1.6
    high = np.maximum(problem.start, problem.goal[0].q) + 1.6
    low, high = np.maximum(low, limits.lower), np.minimum(high, limits.upper)
    axes = [np.linspace(a, b, count) for a, b in zip(low, high, strict=True)]
    steps = [(axis[1] - axis[0]) / v for axis, v in zip(axes, limits.velocity, strict=True)]
    free = np.array([[not model.collides(np.array([x, y])) for y in axes[1]] for x in axes[0]])
    ends = [tuple(int(np.abs(axes[j] - q[j]).argmin()) for j in (0, 1)) for q in (problem.start, problem.goal[0].q)]
    best, queue = {ends[0]: 0.0}, [(0.0, ends[0])]
    while queue:
        time, (i, j) = heapq.heappop(queue)
        if (i, j) == ends[1]:
            return time
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                there = i + a, j + b
                if min(there) < 0 or max(there) >= count or not free[there]:
                    continue
                later = time + max(abs(a) * steps[0], abs(b) * steps[1])
                if later < best.get(there, np.inf):
                    best[there] = later
                    heapq.heappush(queue, (later, there))
    return np.inf


@needs_core
def test_the_bound_is_below_and_near_what_brute_force_finds_on_a_planar_arm(blocked):
    fastest = fastest_on_a_grid(blocked, 81)
    found = bound_of(blocked, 5.0, known=1.05 * fastest)
    step = 5.2 / 80 / blocked.limits.velocity.min()
    assert fastest > 1.1 * found.alone, "the block is in the way"
    assert found.seconds <= fastest + 4.0 * step  # the ends are rounded to the grid
    assert found.seconds > 0.93 * fastest


@needs_core
@pytest.mark.parametrize("name", ["12_planar", "15_srra", "17_puma560", "18_baxter_dual"])
def test_no_motion_that_is_planned_is_shorter_than_the_bound(name):
    problem = op.load_problem(name)
    run = op.plan(problem, budget=4.0)
    found = op.bound(problem, budget=0.8)  # without the motion: nothing of it is used
    assert run.verified
    assert found.alone <= found.seconds <= run.duration
    assert run.duration == pytest.approx(found.seconds * (1.0 + found.gap(run.duration)))


@needs_core
def test_obstacles_raise_the_bound_and_the_history_tells_when():
    found = op.bound(op.load_problem("12_planar"), budget=1.5)
    assert found.seconds > 1.2 * found.alone
    assert found.joints == ("joint1", "joint2") or len(found.joints) == 2
    assert found.history[0] == (0.0, found.alone)
    assert [one[1] for one in found.history] == sorted(one[1] for one in found.history)
    assert found.history[-1][1] == found.seconds


@needs_core
def test_a_goal_that_obstacles_cut_off_ends_the_search_at_a_bound_that_can_be_read():
    post = op.Box("post", size=(0.1, 0.1, 0.4), position=(0.5, 0.0, 0.0))
    problem = op.Problem("two_links", start=[-1.0, 0.0], goal=[1.0, 0.0], scene=[post])
    found = op.bound(problem, budget=60.0)
    assert LONGEST < found.seconds < 2.0 * LONGEST


@needs_core
def test_of_several_goals_the_bound_is_that_of_the_nearest():
    one = op.load_problem("12_planar")
    near = one.with_goal([-1.1, 0.4], [0.8, 0.5])
    assert op.bound(near, budget=0.5).seconds < op.bound(one, budget=0.5).seconds


def test_without_obstacles_it_is_what_the_slowest_joint_needs():
    problem = op.load_problem("12_planar").with_scene(op.Scene())
    found = op.bound(problem, budget=1.0)
    assert found.seconds == found.alone == pytest.approx(float(problem.lower_bounds([problem.goal[0].q])[0]), rel=1e-3)
    assert found.joints == ()


def test_with_a_limit_of_jerk_it_counts_the_accelerations_that_count_as_rest():
    """Each joint's four phases of full jerk, begun with all the speed and acceleration that is let pass as rest."""
    robot = op.load_robot("two_links")
    many = Limits(*(np.full(2, x) for x in (-3.0, 3.0, 2.0, 100.0, 10.0, np.inf)))
    v, a, jerk, first = 0.99e-5 * 2.0, 0.99e-5 * 100.0, 10.0, 0.4
    widths = np.array([first, first + a / jerk, first + a / jerk, first])
    pieces, state = np.zeros((4, 4, 2)), np.array([0.0, v, a])
    for piece, h, j in zip(pieces, widths, (jerk, -jerk, -jerk, jerk), strict=True):
        piece[:, 0] = [*state / [1.0, 1.0, 2.0], j / 6.0]
        q, v, a = state
        state = np.array([q + h * (v + h * (a / 2.0 + h * j / 6.0)), v + h * (a + h * j / 2.0), a + h * j])
    problem = derived(op.Problem(robot, start=[0.0, 0.0], goal=[state[0], 0.0]), limits=many)
    motion = op.Trajectory(robot.joint_names, np.concatenate([[0.0], np.cumsum(widths)]), pieces)
    assert op.verify(problem, motion).verified
    assert 0.999 * motion.duration < op.bound(problem, budget=0.1).seconds <= motion.duration


def test_what_is_left_out_is_said():
    problem = op.load_problem("12_planar").with_vias([0.5, 0.5])
    assert "via points" in op.bound(problem, budget=0.2).left_out


def test_what_makes_motions_longer_among_obstacles_is_said_to_be_left_out():
    cart = op.Box("cart", size=(0.1, 0.1, 0.1), position=(3.0, 0.0, 0.0)).moving([[0.0], [0.0, 0.1], [0.0]])
    scene = op.Scene([*BLOCKS[:1], cart], safety=0.005)
    problem = op.load_problem("12_planar").with_parts(scene=scene, tracking_error=0.001)
    assert {"a clearance", "a tracking error", "obstacles that move"} <= {*op.bound(problem, budget=0.1).left_out}


@pytest.mark.parametrize(
    ("name", "field"), [("08_pose", "goal"), ("37_on_the_move", "start"), ("40_panda_sorts_cubes", "task")]
)
def test_what_no_bound_is_known_of_is_refused(name, field):
    problem = op.load_problem(name)
    assert unsupported(problem)[0] == field
    with pytest.raises(op.InputError, match=rf"^op\.bound: {field}: "):
        op.bound(problem)


def test_a_motion_of_another_problem_is_refused():
    run = planned_until(op.load_problem("12_planar"))
    with pytest.raises(op.InputError, match=r"^op\.bound: motion: "):
        op.bound(op.load_problem("12_planar").with_limits(velocity=0.5), motion=run)


def test_a_motion_of_another_problem_is_refused_where_neither_has_a_hash():
    one = derived(op.load_problem("12_planar"), seed=1)
    run = planned_until(one)
    assert run.verified
    with pytest.raises(op.InputError, match=r"^op\.bound: motion: "):
        op.bound(derived(one, limits=one.limits.scaled(velocity=0.5)), motion=run)


def test_words_of_a_bound():
    found = DurationBound(2.0, 1.0)
    assert found.words() == "no motion is shorter than 2.000 s, proved"
    assert found.words(2.046) == "at most 2.3 % from the optimum, proved: no motion is shorter than 2.000 s, proved"
    assert DurationBound(0.0, 0.0).gap(1.0) is None


def test_a_motion_below_the_bound_is_told_to_contradict_it():
    found = DurationBound(2.0, 1.0)
    assert found.words(2.5).startswith("at most 25.0 % from the optimum")
    assert "contradicts the bound" in found.words(1.9)
    assert "contradicts the bound" in found.words(float("nan"))


def test_a_bound_is_read_as_it_was_written():
    found = DurationBound(2.0, 1.0, ("joint1",), 12, ((0.0, 1.0), (0.5, 2.0)), ("via points",))
    again = DurationBound.from_dict(found.to_dict())
    assert again == replace(found, recorded=True)
    assert " as recorded, not proved again: no motion is shorter than 2.000 s, as recorded" in again.words(2.046)
    assert DurationBound.from_dict({"seconds": 2, "alone": 1.0}) == DurationBound(2.0, 1.0, recorded=True)


@pytest.mark.parametrize("rubbish", [None, [], {}, {"seconds": 1.0}, "2 s"])
def test_a_bound_that_is_none_is_bad_input(rubbish):
    with pytest.raises(op.InputError, match="proved_bound"):
        DurationBound.from_dict(rubbish)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("seconds", float("nan")),
        ("alone", -1.0),
        ("joints", "joint1"),
        ("parts", True),
        ("history", [[1.0]]),
        ("history", [[0.0, "x"]]),
        ("left_out", [1]),
    ],
)
def test_a_bound_with_a_field_of_another_kind_is_bad_input(key, value):
    with pytest.raises(op.InputError, match=rf"run\.json.*proved_bound\.{key}"):
        DurationBound.from_dict({**DurationBound(2.0, 1.0).to_dict(), key: value}, "run.json")
