"""The planners that pass vias without stopping: spline, parabolic, rounded."""

from dataclasses import replace

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.planners.common.limit_violations import excess
from optiplan.planners.registry import make_planner
from optiplan.problem.problem import JointGoal, PoseGoal, Via, derived
from optiplan.runs.pipeline import run
from optiplan.verify.via_check import vias
from tests.checks import named
from tests.planners import cases

FIRST = 0.5 * (cases.READY + cases.LEFT) + np.array([0.3, -0.1, 0.2, 0.0, 0.2, -0.2, 0.1])
SECOND = cases.READY + 0.1
POSE = PoseGoal("panda_hand_tcp", cases.tool_pose("panda", SECOND), 1e-6, 1e-6)
OPEN_JERK = {"parabolic"}
"""Planners of motions whose acceleration jumps."""


def problem(*points, jerk=True):
    free = derived(cases.free(), vias=points or (Via(JointGoal(FIRST)), Via(POSE)))
    limits = free.limits if jerk else replace(free.limits, jerk=np.full(7, np.inf))
    return derived(free, limits=limits)


def quiet(stage, fraction):
    assert 0.0 <= fraction <= 1.0


def answer(name, problem, **options):
    """The failure, or the trajectory, within limits and through all vias as far as that is quick to see."""
    result = make_planner(name, options).plan(problem, Budget(20.0), quiet)
    if result.trajectory is None:
        return result.failure
    assert excess(result.trajectory, problem.limits) is None
    assert not problem.vias or vias(problem, result.trajectory).passed
    return result.trajectory


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("spline", {}),
        ("spline", {"degree": 3}),
        ("spline", {"velocities": "heuristic"}),
        ("parabolic", {}),
        ("parabolic", {"blend_time": 0.25}),
        ("parabolic", {"acceleration": 5.0}),
        ("rounded", {"deviation": 0.1}),
        ("rounded", {"curve": "bspline"}),
    ],
)
def test_vias_are_hit_without_stopping_and_all_is_verified(name, options):
    result = run(problem(jerk=name not in OPEN_JERK), name, options, Budget(20.0), quiet)
    assert result.verified, result.failure or result.report.failures
    check = named(result.report, "via")
    assert check.worst < 1e-7
    assert np.abs(result.trajectory(np.array(check.witness["times"]), 1)).max(axis=1).min() > 0.1


@pytest.mark.parametrize("name", ["quintic", "trajopt", "spline", "parabolic", "rounded"])
@pytest.mark.parametrize("angle", [4.0, 8.0])
def test_a_via_of_an_endless_joint_is_passed_at_the_stated_turn(name, angle):
    """The nearest angle to 4 rad, seen from 0, is -2.28 rad, on which no via is."""
    turning = cases.endless()
    limits = replace(turning.limits, jerk=np.full(2, np.inf)) if name in OPEN_JERK else turning.limits
    via = Via(JointGoal(np.array([angle, 0.0])))
    past = derived(turning, start=np.zeros(2), vias=(via,), goal=(JointGoal(np.array([0.5, 0.0])),), limits=limits)
    result = run(past, name, {}, Budget(20.0), quiet)
    assert result.verified, result.failure or result.report.failures


@pytest.mark.parametrize("name", ["spline", "parabolic", "rounded"])
def test_without_vias_they_go_straight_to_the_goal(name):
    """`parabolic` with each joint at its own acceleration: the joints start together, not in proportion."""
    motion = answer(name, derived(problem(jerk=False), vias=()))
    if name == "parabolic":
        return
    Q = motion(np.linspace(0.0, motion.duration, 50)) - cases.READY
    chord = cases.LEFT - cases.READY
    assert pytest.approx(np.outer(Q @ chord / (chord @ chord), chord), abs=1e-9) == Q


@pytest.mark.parametrize("name", ["spline", "parabolic", "rounded"])
def test_equal_points_are_passed_once(name):
    points = (cases.READY, FIRST, FIRST, cases.LEFT)
    assert answer(name, problem(*(Via(JointGoal(q)) for q in points), jerk=False)).duration > 0.5
    still = derived(problem(Via(JointGoal(cases.READY)), jerk=False), goal=(JointGoal(cases.READY),))
    assert answer(name, still).duration < 0.1


@pytest.mark.parametrize(("name", "options"), [("parabolic", {}), ("parabolic", {"blend_time": 0.3}), ("rounded", {})])
def test_tolerances_are_used_up_and_not_more(name, options):
    loosely = problem(Via(JointGoal(FIRST, 0.05)), Via(JointGoal(SECOND, 0.1)), jerk=False)
    exactly = problem(Via(JointGoal(FIRST)), Via(JointGoal(SECOND)), jerk=False)
    loose, hit = answer(name, loosely, **options), answer(name, exactly, **options)
    assert vias(loosely, loose).worst > 1e-3
    assert loose.duration < 0.98 * hit.duration


@pytest.mark.parametrize("name", ["spline", "parabolic"])
@pytest.mark.parametrize("duration", [None, 9.0])
def test_times_of_vias_are_kept(name, duration):
    timed = problem(Via(JointGoal(FIRST), time=2.0), Via(JointGoal(SECOND), time=5.0), jerk=False)
    motion = answer(name, timed, **({} if duration is None else {"duration": duration}))
    assert motion(np.array([2.0, 5.0])) == pytest.approx(np.array([FIRST, SECOND]), abs=1e-6)
    assert motion.duration == duration if duration else motion.duration > 5.1


def test_given_velocities_are_kept():
    v = np.array([0.2, 0.1, -0.1, 0.0, 0.1, 0.3, -0.2])
    asked = problem(Via(JointGoal(FIRST), velocity=v))
    for options in ({}, {"duration": 6.0}):
        motion = answer("spline", asked, velocities="given", **options)
        assert motion(np.array(vias(asked, motion).witness["times"]), 1)[0] == pytest.approx(v, abs=1e-6)
        assert motion.duration == pytest.approx(options.get("duration", motion.duration))


@pytest.mark.parametrize("options", [{"velocities": "given"}, {"velocities": "continuous"}, None])
def test_a_via_at_an_end_is_passed_at_rest(options):
    name, options = ("parabolic", {}) if options is None else ("spline", options)
    here = Via(JointGoal(cases.READY), velocity=np.full(7, 0.1))
    there = Via(JointGoal(cases.LEFT), velocity=np.full(7, 0.1))
    motion = answer(name, problem(here, there, jerk=False), **options)
    assert np.abs(motion(np.array([0.0, motion.duration]), 1)).max() < 1e-9
    still = derived(problem(here, jerk=False), goal=(JointGoal(cases.READY),))
    motion = answer(name, still, duration=2.0, **options)
    assert motion.duration == pytest.approx(2.0)


def test_a_longer_duration_is_kept_and_a_shorter_one_refused():
    assert answer("spline", problem(), duration=7.5).duration == pytest.approx(7.5)
    failure = answer("spline", problem(), duration=0.7)
    assert failure.kind == "limits"
    assert failure.witness["shortest_duration"] == pytest.approx(answer("spline", problem()).duration)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("spline", {"velocities": "given"}, "via 1 has none"),
        ("spline", {"duration": 4.0}, "more than the 5.0 s of the last via"),
        ("parabolic", {"acceleration": 0.5}, "blends that overlap|no blend strong enough"),
        ("parabolic", {"blend_time": 1.5}, "blends that overlap by .* s, of 'panda_joint"),
        ("parabolic", {"blend_time": 1.0, "acceleration": 2.0}, "only one of them"),
        ("rounded", {"deviation": 1e-5}, "deviation"),
    ],
)
def test_options_that_make_no_sense_are_input_errors(name, options, words):
    timed = problem(Via(JointGoal(FIRST), time=2.0), Via(JointGoal(SECOND), time=5.0), jerk=False)
    with pytest.raises(InputError, match=words):
        answer(name, timed, **options)


def test_where_the_path_turns_straight_back_it_stops_and_hits_the_via():
    there_and_back = derived(problem(Via(JointGoal(cases.LEFT))), goal=(JointGoal(cases.READY + 0.001),))
    motion = answer("rounded", there_and_back)
    check = vias(there_and_back, motion)
    assert check.worst < 1e-9
    assert np.abs(motion(np.array(check.witness["times"]), 1)).max() < 1e-3


def test_rounded_corners_stay_within_the_deviation_of_straight_lines():
    motion = answer("rounded", problem(Via(JointGoal(FIRST, 1.0))), deviation=0.02)
    Q = motion(np.linspace(0.0, motion.duration, 300))
    s = np.linspace(0.0, 1.0, 500)[:, None]
    lines = np.concatenate([cases.READY + s * (FIRST - cases.READY), FIRST + s * (cases.LEFT - FIRST)])
    assert max(np.abs(lines - q).max(axis=1).min() for q in Q) < 0.02 + 2e-3


@pytest.mark.parametrize("apart", [1e-8, 1e-5, 1e-3])
def test_where_there_is_hardly_room_to_round_a_corner_it_stops(apart):
    """Two vias side by side: at the speed of their corners the motion took minutes."""
    one, two = (problem(*(Via(JointGoal(FIRST + shift)) for shift in shifts)) for shifts in ([0.0], [0.0, apart]))
    turned = derived(two, vias=(two.vias[0], Via(JointGoal(FIRST + apart * np.array([1.0, -1, 1, -1, 1, -1, 1])))))
    alone, beside = (answer("rounded", each) for each in (one, turned))
    assert beside.duration < 1.5 * alone.duration
    assert vias(turned, beside).worst < 1e-9


def test_a_via_out_of_reach_is_named():
    far = PoseGoal("panda_hand_tcp", cases.too_far().goal[0].X_WG)
    failure = answer("spline", problem(Via(JointGoal(FIRST)), Via(far)))
    assert failure.kind == "goal-unreachable"
    assert failure.detail.startswith("via 2: ")
    assert failure.witness["via"] == 2


@pytest.mark.parametrize("name", ["spline", "rounded"])
def test_a_wall_in_the_way_is_named(name):
    failure = answer(name, derived(cases.wall(), vias=(Via(JointGoal(0.5 * (cases.READY + cases.LEFT))),)))
    assert failure.kind in {"collision", "goal-in-collision"}
    assert "plate" in failure.witness["pair"]
