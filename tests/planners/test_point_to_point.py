"""The planners of one profile: durations, limits, torque, options that make no sense, and odd robots."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError
from optiplan.geometry.scene import Obstacle, Scene, Sphere
from optiplan.planners.base import Budget, PlanResult
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.common.limit_violations import excess
from optiplan.planners.point_to_point.base import STEPS
from optiplan.planners.registry import make_planner
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import JointGoal, PoseGoal, Problem, derived
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.timing.time_scaling import speed_ratio
from optiplan.verify.verify import verify
from tests.planners import cases

FAMILY = ["bangbang", "cubic", "lspb", "quintic", "scurve", "septic"]
SMOOTH = ["quintic", "scurve", "septic"]
MOTIONS = ["synchronised", "independent", "sequential"]


def plan(problem: Problem, name: str, **options: object) -> PlanResult:
    return make_planner(name, options).plan(problem, Budget(20.0), lambda stage, fraction: None)


def free_of_jerk(problem: Problem) -> Problem:
    return derived(problem, limits=replace(problem.limits, jerk=np.full(problem.robot.n, np.inf)))


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", FAMILY)
def test_verified_in_the_shortest_time_and_in_a_longer_one(name, motion):
    problem = cases.planar() if name in SMOOTH else free_of_jerk(cases.planar())
    shortest = plan(problem, name, motion=motion).trajectory
    assert speed_ratio(shortest, problem.limits) == pytest.approx(1.0, rel=1e-6)
    longer = plan(problem, name, motion=motion, duration=2.0 * shortest.duration).trajectory
    assert longer.duration == pytest.approx(2.0 * shortest.duration)
    for trajectory in (shortest, longer):
        assert verify(problem, trajectory).verified


@pytest.mark.parametrize("name", FAMILY)
def test_a_jump_of_the_acceleration_is_told_where_jerk_is_limited(name):
    jerky = plan(cases.planar(), name)
    assert verify(cases.planar(), jerky.trajectory).verified == (name in SMOOTH)
    assert jerky.info.get("note") == (None if name in SMOOTH else STEPS)
    assert "note" not in plan(free_of_jerk(cases.planar()), name).info


def test_what_refuses_the_jump_names_the_way_out():
    report = verify(cases.planar(), plan(cases.planar(), "lspb").trajectory)
    assert {check.name for check in report.failures} == {"rest", "continuity"}
    assert all("`limits: {jerk: none}` in the problem lifts this" in check.detail for check in report.failures)


def test_the_s_curve_takes_the_lower_bound():
    problem = cases.planar()
    for motion in ("synchronised", "independent"):
        found = plan(problem, "scurve", motion=motion).trajectory
        bound = lower_bound(problem.start, found.end, problem.limits)
        assert found.duration == pytest.approx(bound, rel=1e-9)


@pytest.mark.parametrize("name", FAMILY)
def test_too_short_a_duration_is_refused_with_the_shortest(name):
    problem = free_of_jerk(cases.planar())
    failure = plan(problem, name, duration=0.3).failure
    assert failure.kind == "limits"
    place = failure.witness
    assert place["joint"] in failure.detail
    assert place["quantity"] in failure.detail
    assert place["value"] > place["limit"]
    assert np.isfinite(place["q"]).all()
    told = float(failure.detail.split("the shortest duration is ")[1].split(" s")[0])
    assert told == pytest.approx(place["shortest_duration"], rel=1e-5)
    assert plan(problem, name, duration=told).failure is None
    assert plan(problem, name, duration=0.999 * told).failure.kind == "limits"


@pytest.mark.parametrize("name", FAMILY)
def test_too_little_torque_slows_down_or_refuses_a_duration(name):
    problem = free_of_jerk(cases.planar())
    strong = plan(problem, name).trajectory
    gravity = Gravity(problem.robot, problem.limits.torque)
    most = np.max([gravity.torque(q) for q in strong(np.linspace(0.0, strong.duration, 99))], axis=0)
    weak = derived(problem, limits=replace(problem.limits, torque=1.05 * most))
    slower = plan(weak, name).trajectory
    assert slower.duration > 1.01 * strong.duration
    assert verify(weak, slower).verified
    failure = plan(weak, name, duration=strong.duration).failure
    assert (failure.kind, failure.witness["quantity"]) == ("limits", "torque")
    assert failure.witness["shortest_duration"] == pytest.approx(slower.duration)


def test_a_velocity_beyond_the_limit_has_no_duration():
    problem = free_of_jerk(cases.planar())
    failure = plan(problem, "lspb", velocity=5.0).failure
    assert (failure.kind, failure.witness["quantity"]) == ("limits", "velocity")
    assert "no other duration" in failure.detail


LSPB = [({"velocity": 0.02}, "velocity", "more than 0.0833 and at most 0.167 rad/s")]
LSPB += [({"velocity": 0.17}, "velocity", "more than 0.0833 and at most 0.167 rad/s")]
LSPB += [({"velocity": 1.5 / 18.0}, "velocity", "more than 0.0833")]
LSPB += [({"velocity": -0.17}, "velocity", "more than 0.0833 and at most 0.167 rad/s")]
LSPB += [({"blend_time": 9.1}, "blend_time", "at most 9 s")]
LSPB += [({"acceleration": 0.0185}, "acceleration", "at least 0.0185186 rad/s²")]


@pytest.mark.parametrize(("shape", "field", "bounds"), LSPB)
def test_a_trapezoid_that_cannot_be_is_an_input_error(shape, field, bounds):
    with pytest.raises(InputError) as caught:
        plan(cases.planar(), "lspb", duration=18, **shape)
    (issue,) = caught.value.issues
    assert issue.field == field
    assert bounds in issue.expected
    assert "'shoulder', which moves 1.5 rad in 18 s" in issue.found


def test_a_velocity_against_the_motion_is_an_input_error():
    """The shoulder moves by -1.5 rad: a negative velocity is its own; the other way round it is not."""
    there = cases.planar()
    back = derived(there, start=there.goal[0].q, goal=(JointGoal(there.start),))
    for duration in ({"duration": 18}, {}):
        assert plan(there, "lspb", velocity=-0.1, **duration).trajectory is not None
        with pytest.raises(InputError, match=r"-0\.1 rad/s for joint 'shoulder'.*a positive one"):
            plan(back, "lspb", velocity=-0.1, **duration)


@pytest.mark.parametrize("shape", [{"velocity": 1.5 / 9.0}, {"blend_time": 9}, {"acceleration": 0.0185186}, {}])
def test_a_trapezoid_at_its_bounds_can_be(shape):
    found = plan(cases.planar(), "lspb", duration=18, **shape).trajectory
    assert found.duration == 18.0
    assert found.end == pytest.approx([-1.0, 0.3], abs=1e-12)


def test_each_joint_of_a_trapezoid_has_bounds_of_its_own():
    """1.5 and 0.7 rad in 4 s: no velocity is above 1.5 / 4 and not above 2 · 0.7 / 4; one after another, all are."""
    with pytest.raises(InputError, match=r"'elbow'.*at most 0\.35 rad/s"):
        plan(cases.planar(), "lspb", duration=4, velocity=0.4, motion="independent")
    found = plan(free_of_jerk(cases.planar()), "lspb", duration=4, velocity=0.8, motion="sequential").trajectory
    assert np.abs(found.extrema(1)).max(axis=0) == pytest.approx([0.8, 0.8])


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("quintic", {"duration": 0.0}),
        ("quintic", {"duration": float("inf")}),
        ("quintic", {"duration": 1e-7}),
        ("cubic", {"start_velocity": [1e300, 0.0]}),
        ("lspb", {"velocity": float("nan")}),
        ("quintic", {"motion": "together"}),
        ("quintic", {"start_velocity": [0.1]}),
        ("quintic", {"end_velocity": [0.1, float("nan")]}),
        ("septic", {"end_jerk": [0.1, 0.0], "motion": "sequential"}),
        ("lspb", {"velocity": 1.0, "blend_time": 1.0}),
        ("lspb", {"blend_time": -1.0}),
        ("lspb", {"velocity": 0.0}),
        ("bangbang", {"acceleration": -1.0}),
        ("scurve", {"goals": 0}),
    ],
)
def test_options_that_make_no_sense_are_input_errors(name, options):
    with pytest.raises(InputError):
        plan(cases.planar(), name, **options)


@pytest.mark.parametrize("name", ["cubic", "quintic", "septic"])
@pytest.mark.parametrize("option", ["start_velocity", "end_velocity"])
def test_velocities_at_the_ends_are_the_problems(name, option):
    problem = free_of_jerk(cases.planar())
    with pytest.raises(InputError, match=rf"{option}.*\[0\.2, 0\.0\].*those of the problem, \[0\.0, 0\.0\]"):
        plan(problem, name, **{option: [0.2, 0.0]})
    assert plan(problem, name, **{option: [0.0, 0.0]}).trajectory is not None
    moving = derived(problem, start_velocity=np.array([0.2, 0.0])) if option == "start_velocity" else problem
    if option == "end_velocity":
        moving = derived(problem, goal=(JointGoal(problem.goal[0].q, velocity=np.array([0.2, 0.0])),))
    found = plan(moving, name, **{option: [0.2, 0.0]}).trajectory
    assert verify(moving, found).verified
    assert {check.name for check in verify(problem, found).failures} == {"rest"}


def test_accelerations_at_the_ends_where_the_jerk_is_free():
    ends = {"end_acceleration": [0.5, 0.0]}
    problem = free_of_jerk(cases.planar())
    found = plan(problem, "quintic", **ends).trajectory
    t = np.array([0.0, found.duration])
    assert found(t, 1) == pytest.approx(0.0, abs=1e-9)
    assert found(t, 2) == pytest.approx(np.array([[0.0, 0.0], [0.5, 0.0]]), abs=1e-9)
    assert verify(problem, found).verified
    with_jerk = plan(cases.planar(), "septic", start_jerk=[2.0, 0.0]).trajectory
    assert with_jerk(np.zeros(1), 3)[0] == pytest.approx([2.0, 0.0], abs=1e-9)
    assert verify(cases.planar(), with_jerk).verified
    with pytest.raises(InputError, match=r"end_acceleration.*jerk"):
        plan(cases.planar(), "quintic", **ends)


@pytest.mark.parametrize("name", FAMILY)
def test_durations_of_any_size(name):
    problem = free_of_jerk(cases.planar())
    assert plan(problem, name, duration=1e-6).failure.kind == "limits"
    slow = plan(problem, name, duration=1e7).trajectory
    assert slow.end == pytest.approx([-1.0, 0.3], abs=1e-12)
    assert excess(slow, problem.limits) is None


def test_bangbang_takes_bounds_below_the_limits():
    problem = free_of_jerk(cases.planar())
    found = plan(problem, "bangbang", acceleration=0.5, velocity=0.6).trajectory
    assert np.abs(found.extrema(1)).max() == pytest.approx(0.6)
    assert np.abs(found.extrema(2)).max() == pytest.approx(0.5)
    failure = plan(problem, "bangbang", acceleration=0.5, duration=2.0).failure
    assert (failure.kind, failure.witness["limit"]) == ("limits", 0.5)


def one_joint(tmp_path, row, goal, limits="{velocity: 2, acceleration: 8, jerk: 80}"):
    table = f"dh:\n  convention: standard\n  unit: rad\n  radius: 0.05\n  rows:\n    - {row}\n"
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: one\n{table}limits: {limits}\n")
    data = {"version": 1, "robot": str(tmp_path / "robot.yaml"), "start": {"joints": [0.1]}, "goal": {"joints": [goal]}}
    return problem_from_dict(data)


@pytest.mark.parametrize("goal", [0.1, 0.1 + 1e-13, 0.1 - 1e-6, -3.0, 40.0])
@pytest.mark.parametrize("name", SMOOTH)
def test_one_endless_joint_moves_any_distance(tmp_path, name, goal):
    problem = one_joint(tmp_path, "{name: turn, joint: revolute, a: 0.3}", goal)
    assert np.isinf(problem.robot.limits.upper).all()
    for motion in MOTIONS:
        result = plan(problem, name, motion=motion)
        assert result.failure is None
        assert verify(problem, result.trajectory).verified
        turns = (result.trajectory.end - goal) / (2.0 * np.pi)
        assert turns == pytest.approx(np.rint(turns), abs=1e-9)
        assert abs(result.trajectory.end - 0.1) <= np.pi + 1e-9  # the short way round


@pytest.mark.parametrize("name", ["quintic", "rrtconnect", "trajopt"])
def test_an_endless_joint_goes_the_other_way_round_where_one_is_blocked(tmp_path, name):
    """The goal is 2.3 rad back, past a post, or 4 rad on."""
    free = one_joint(tmp_path, "{name: turn, joint: revolute, a: 0.3}", 4.1)
    post = Obstacle("post", Sphere(0.05), pin.SE3(np.eye(3), 0.25 * np.array([np.cos(-1.0), np.sin(-1.0), 0.0])))
    blocked = derived(free, scene=Scene((post,)))
    for problem, end in ((free, 4.1 - 2.0 * np.pi), (blocked, 4.1)):
        result = plan(problem, name)
        assert verify(problem, result.trajectory).verified
        assert result.trajectory.end == pytest.approx([end], abs=1e-6)


@pytest.mark.parametrize(
    "limits", ["{velocity: 1.0e+6, acceleration: 1.0e+9, jerk: 1.0e+12}", "{velocity: 1.0e-4, jerk: 1.0e+6}"]
)
@pytest.mark.parametrize("name", SMOOTH)
def test_huge_and_tiny_limits(tmp_path, name, limits):
    problem = one_joint(tmp_path, "{name: rail, joint: prismatic, a: 0.3, limits: [-1, 1]}", -0.9, limits)
    result = plan(problem, name)
    assert result.failure is None
    assert verify(problem, result.trajectory).verified


def test_goals_are_tried_until_one_is_free():
    away = JointGoal(0.5 * (cases.READY + cases.LEFT) + [0.0, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem = derived(cases.wall(), goal=(*cases.wall().goal, away))
    result = plan(problem, "quintic")
    blocked = plan(cases.wall(), "quintic").failure
    assert blocked.kind == "collision"
    assert "plate" in blocked.witness["pair"]
    assert result.trajectory.end == pytest.approx(away.q)


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_too_short_a_duration_between_states_is_refused_with_the_next(share):
    swing = cases.swing()
    problem = derived(swing, goal=(replace(swing.goal[0], velocity=0.3 * swing.limits.velocity),))
    shortest = plan(problem, "scurve").trajectory.duration
    failure = plan(problem, "scurve", duration=share * shortest).failure
    assert failure.kind == "limits"
    assert failure.witness["shortest_duration"] == pytest.approx(shortest)
    assert plan(problem, "scurve", duration=2.0 * shortest).trajectory.duration == pytest.approx(2.0 * shortest)


def test_what_is_too_heavy_is_on_the_motion_and_not_on_a_straight_line():
    """The arm is raised first, stretched, and then folded."""
    problem = cases.problem("planar2r", [-1.4, 0.1], [JointGoal(np.array([0.0, 2.6]))])
    weak = derived(problem, limits=replace(problem.limits, torque=np.array([21.0, 100.0])))
    assert plan(weak, "quintic").failure is None
    failure = plan(weak, "quintic", motion="sequential").failure
    assert failure.witness["torque"] > 21.0
    assert failure.witness["q"][1] == pytest.approx(0.1)


def test_goals_too_near_a_limit_for_the_tracking_error_name_the_joint():
    q = np.array([0.3, cases.robot("planar2r").limits.upper[1] - 0.004])
    goal = PoseGoal(cases.robot("planar2r").tool_frame, cases.tool_pose("planar2r", q), 1e-4, np.pi)
    problem = derived(cases.problem("planar2r", [0.3, 0.3], [goal]), tracking_error=np.full(2, 0.01))
    failure = make_planner("quintic").plan(problem, Budget(0.2), lambda stage, fraction: None).failure
    assert "'elbow' at" in failure.detail
    assert "tracking error" in failure.detail
    there = plan(derived(problem, start=q), "quintic").failure
    assert there.kind == "start-in-collision"
    assert "'elbow' at 2.796 is nearer to the limits -2.8 and 2.8 rad" in there.detail
