"""The planners line, arc, circle and screw: verified answers, honest failures, options that fit or are refused."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError
from optiplan.geometry.poses import pose_from_data
from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.planners.base import Budget
from optiplan.planners.cartesian.tool_path import circle_through
from optiplan.planners.registry import make_planner
from optiplan.problem.constraints.poses import RelativePose
from optiplan.problem.problem import JointGoal, PoseGoal, derived
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.robot import load_robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify
from tests.unchecked_problem import unchecked_problem

UR5 = np.array([-0.02, -1.359, 1.644, -0.284, 1.551, 0.0])


@cache
def ur5():
    return load_robot("ur5")


def pose(q):
    return frame_pose(ur5(), np.asarray(q, dtype=float), "tool0")


def problem(goal, start=UR5, obstacles=()):
    robot = ur5()
    goal = PoseGoal("tool0", goal) if isinstance(goal, pin.SE3) else JointGoal(np.asarray(goal, dtype=float))
    return unchecked_problem(
        name="case",
        robot=robot,
        scene=Scene(tuple(obstacles)),
        start=np.array(start),
        goal=(goal,),
        limits=robot.limits,
    )


def plan(name, what, **options):
    return make_planner(name, options).plan(what, Budget(20.0), lambda stage, fraction: None)


def shifted(shift, turn=(0.0, 0.0, 0.0), start=UR5):
    X = pose(start)
    return pin.SE3(pin.exp3(np.array(turn, dtype=float)) @ X.rotation, X.translation + np.array(shift))


def tool_points(trajectory, count=400):
    return np.array([pose(q).translation for q in trajectory(np.linspace(0.0, trajectory.duration, count))])


def off_line(points):
    along = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    offset = points - points[0]
    return np.linalg.norm(offset - np.outer(offset @ along, along), axis=1).max()


def check_witness(failure, cause):
    """The pose is that of the configuration, and both are where the fraction says."""
    assert failure.witness["cause"] == cause
    X = pose_from_data(failure.witness["pose"])
    assert pose(failure.witness["q"]).homogeneous == pytest.approx(X.homogeneous, abs=1e-5)
    assert f"{100.0 * failure.witness['fraction']:.1f} %" in failure.detail
    return X


def test_line_is_straight_and_verified():
    what = problem(shifted((-0.2, 0.3, 0.1), (0.0, 0.5, 0.0)))
    result = plan("line", what)
    assert verify(what, result.trajectory).verified
    assert off_line(tool_points(result.trajectory)) <= 1e-6
    assert result.info["tool_length"] == pytest.approx(np.sqrt(0.14))
    assert not result.info["branch_changed"]


def test_line_to_a_configuration_ends_in_it_or_says_which_one_it_would_end_in():
    goal = plan("line", problem(shifted((0.0, 0.2, 0.0)))).trajectory.end
    assert plan("line", problem(goal)).trajectory.end == pytest.approx(goal, abs=1e-9)
    others = closed_form(ur5()).solve(pose(goal).homogeneous[None])
    far = [q for q in others.q[0] if np.abs(q - goal).max() > 0.5]
    failures = [plan("line", problem(q)).failure for q in far]
    found = [failure for failure in failures if failure.kind == "no-path"]  # the others collide
    assert found
    assert all(failure.witness["cause"] == "branch" and "pose" in failure.detail for failure in found)


@pytest.mark.parametrize("profile", ["trapezoid", "jerk", "uniform"])
def test_tool_keeps_its_speed_and_acceleration_limits(profile):
    what = problem(shifted((-0.1, 0.4, 0.1)))
    if profile == "trapezoid":
        what = derived(what, limits=replace(what.limits, jerk=np.full(6, np.inf)))
    trajectory = plan("line", what, profile=profile, speed=0.2, acceleration=0.8).trajectory
    assert verify(what, trajectory).verified
    t = np.linspace(0.0, trajectory.duration, 2001)
    J = [geometric_jacobian(ur5(), q, "tool0")[:3] for q in trajectory(t)]
    velocity = np.einsum("nij,nj->ni", J, trajectory(t, 1))
    speed = np.linalg.norm(velocity, axis=1)
    assert speed.max() <= 0.2 * (1.0 + 1e-6)
    acceleration = np.linalg.norm(np.diff(velocity, axis=0), axis=1) / t[1]
    assert acceleration.max() <= 0.8 * (1.0 + 1e-3)
    if profile == "trapezoid":
        length = np.sqrt(0.18)
        assert trajectory.duration == pytest.approx(length / 0.2 + 0.2 / 0.8, rel=0.01)
        assert np.median(speed) == pytest.approx(0.2, rel=1e-3)


def test_duration_is_kept_or_the_shortest_is_named():
    what = problem(shifted((0.0, 0.2, 0.0)))
    fastest = plan("line", what).trajectory.duration
    assert plan("line", what, duration=3.0).trajectory.duration == pytest.approx(3.0)
    failure = plan("line", what, duration=0.5 * fastest).failure
    assert failure.kind == "limits"
    assert failure.witness["duration"] == pytest.approx(fastest, rel=1e-3)


def test_line_into_a_joint_limit():
    """Turning about the tool's own axis moves the last joint only: 6.0 rad and on to 2 pi is all that is left."""
    start = UR5 + 6.0 * np.eye(6)[5]
    X = pose(start)
    goal = pin.SE3(X.rotation @ pin.exp3(np.array([0.0, 0.0, 1.0])), X.translation)
    failure = plan("line", problem(goal, start)).failure
    assert (failure.kind, failure.witness["joint"]) == ("limits", "wrist_3_joint")
    assert failure.witness["fraction"] == pytest.approx(2.0 * np.pi - 6.0, abs=1e-6)
    assert failure.witness["limit"] == pytest.approx(2.0 * np.pi)
    check_witness(failure, "joint limit")
    motion = Trajectory.from_dict(failure.witness["motion"])  # to look at: up to the limit and beyond
    assert motion(np.array([failure.witness["t"]]))[0] == pytest.approx(failure.witness["q"], abs=1e-6)
    assert motion.end[5] > 2.0 * np.pi


def test_change_of_branch_before_the_start():
    start = UR5 + 6.0 * np.eye(6)[5]
    X = pose(start)
    what = problem(pin.SE3(X.rotation @ pin.exp3(np.array([0.0, 0.0, 1.0])), X.translation), start)
    result = plan("line", what, change_branch=True)
    assert result.info["branch_changed"]
    assert verify(what, result.trajectory).verified
    at_rest = [t for t in result.trajectory.breakpoints if np.abs(result.trajectory(np.array([t]), 1)).max() < 1e-9]
    assert len(at_rest) == 3  # start, the other branch, goal
    there = result.trajectory(np.array([at_rest[1]]))[0]
    assert pose(there).homogeneous == pytest.approx(X.homogeneous, abs=1e-9)
    line = result.trajectory(np.linspace(at_rest[1], at_rest[2], 200))
    assert np.abs([pose(q).translation - X.translation for q in line]).max() < 1e-6


def test_other_branches_keep_the_frames_that_go_along():
    """Only some branches have the wrist where it was in the tool's frame; none of them reaches the goal."""
    held = pose(UR5).actInv(frame_pose(ur5(), UR5, "wrist_2_link"))
    together = RelativePose("wrist_2_link", "tool0", held, 1e-3, 1e-2)
    what = derived(problem(shifted((0.2, 0.9, 0.0))), path_constraints=(together,))
    failure = plan("line", what, change_branch=True, goals=2).failure
    assert failure.kind == "goal-unreachable"


def test_line_into_an_obstacle():
    """The flange meets a post half-way, the goal is free."""
    goal = shifted((0.0, 0.4, 0.0))
    post = Obstacle("post", Box((0.02, 0.02, 0.3)), pin.SE3(np.eye(3), shifted((0.0, 0.2, 0.0)).translation))
    failure = plan("line", problem(goal, obstacles=[post])).failure
    assert failure.kind == "collision"
    assert "post" in failure.witness["pair"]
    X = check_witness(failure, "obstacle")
    assert X.translation[1] == pytest.approx(pose(UR5).translation[1] + 0.4 * failure.witness["fraction"], abs=1e-6)
    assert 0.2 < failure.witness["fraction"] < 0.5


WRIST = np.array([0.0, -1.2, 1.6, -1.2, 0.0, 0.3])
"""Joint 5 at 0: axes 4 and 6 are parallel, and the tool cannot be turned about the direction across them and axis 5."""


def lost_direction():
    """The twist that the Jacobian does not reach at `WRIST`."""
    return np.linalg.svd(geometric_jacobian(ur5(), WRIST, "tool0"))[0][:, -1]


def test_line_out_of_a_wrist_singularity_in_the_direction_that_is_lost():
    twist = 0.4 * lost_direction()
    what = problem(shifted(twist[:3], twist[3:], WRIST), WRIST)
    failure = plan("line", what).failure
    assert failure.kind == "singularity"
    assert failure.witness["fraction"] == 0.0
    assert failure.witness["singular"] == ["wrist"]
    assert failure.witness["measure"] < 1e-9
    X = check_witness(failure, "singularity")
    assert X.homogeneous == pytest.approx(pose(WRIST).homogeneous, abs=1e-9)
    changed = plan("line", what, change_branch=True)
    assert changed.info["branch_changed"]
    assert verify(what, changed.trajectory).verified


def test_line_through_a_wrist_singularity_on_the_branch_that_crosses_it():
    """Joint 5 changes its sign half-way; no joint jumps, and the tool does not leave its line."""
    middle, twist = pose(WRIST), 0.6 * lost_direction()
    start = pin.SE3(pin.exp3(-0.5 * twist[3:]) @ middle.rotation, middle.translation - 0.5 * twist[:3])
    end = pin.SE3(pin.exp3(0.5 * twist[3:]) @ middle.rotation, middle.translation + 0.5 * twist[:3])
    solutions = closed_form(ur5()).solve(start.homogeneous[None])
    q = min(solutions.q[0][solutions.valid[0]], key=lambda q: np.abs(q - WRIST).max())
    what = problem(end, q)
    trajectory = plan("line", what).trajectory
    assert verify(what, trajectory).verified
    assert trajectory.start[4] * trajectory.end[4] < 0.0
    assert off_line(tool_points(trajectory)) <= 1e-6


def test_line_into_the_column_that_the_shoulder_cannot_reach():
    """Axis 4 stays 109 mm from axis 1 or farther: a line across axis 1 ends there, at the shoulder's singularity."""
    goal = shifted((-1.1, 0.0, 0.0))
    failure = plan("line", problem(goal)).failure
    assert failure.kind == "reach"
    assert failure.witness["singular"] == ["shoulder"]
    X = check_witness(failure, "reach")
    assert failure.witness["measure"] < 1e-3
    solver = closed_form(ur5())
    reachable = [solver.solve(shifted((-1.1 * s, 0.0, 0.0)).homogeneous[None]).valid.any() for s in steps(failure)]
    assert reachable == [True, False]
    assert X.translation[0] < 0.2


def steps(failure):
    return failure.witness["fraction"] - 1e-3, failure.witness["fraction"] + 1e-3


def test_line_to_a_pose_out_of_reach():
    """The goal is unreachable, and the witness has where the line leaves the reach."""
    failure = plan("line", problem(shifted((0.2, 0.9, 0.0)))).failure
    assert failure.kind == "goal-unreachable"
    assert "misses by" in failure.detail
    assert 0.3 < failure.witness["fraction"] < 0.9
    assert "elbow" in failure.witness["singular"]
    check_witness(failure, failure.witness["cause"])


def test_arc_out_of_reach_between_two_poses_within():
    what = problem(shifted((-0.3, 0.5, 0.0)))
    failure = plan("arc", what, through=[0.9, 0.6, 0.3]).failure
    assert failure.kind in {"reach", "singularity"}
    assert 0.05 < failure.witness["fraction"] < 0.6
    check_witness(failure, failure.witness["cause"])


def test_arc_through_a_point_is_verified():
    what = problem(shifted((-0.2, 0.4, 0.0), (0.0, 0.0, 0.5)))
    via = 0.5 * (pose(UR5).translation + shifted((-0.2, 0.4, 0.0)).translation) + np.array([0.05, 0.05, 0.1])
    trajectory = plan("arc", what, through=via.tolist()).trajectory
    assert verify(what, trajectory).verified
    points = tool_points(trajectory, 2000)
    assert np.linalg.norm(points - via, axis=1).min() < 1e-3
    assert arc_radius_error(points, trajectory) < 1e-6


def arc_radius_error(points, trajectory):
    """Largest difference of the distances from the circle's centre, fitted through three of the points."""
    centre, _ = circle_through(points[0], points[len(points) // 2], points[-1])
    return np.ptp(np.linalg.norm(points - centre, axis=1))


def test_arc_about_a_centre_goes_the_short_way_or_the_long_one():
    centre = shifted((0.0, 0.1, 0.0)).translation
    what = problem(shifted((0.0, 0.1, 0.1)))
    short = plan("arc", what, centre=centre.tolist()).trajectory
    long = plan("arc", what, centre=centre.tolist(), angle=-1.5 * np.pi).trajectory
    for trajectory, angle in ((short, 0.5 * np.pi), (long, 1.5 * np.pi)):
        assert verify(what, trajectory).verified
        points = tool_points(trajectory, 2000)
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(0.1 * angle, rel=1e-4)
        assert np.ptp(np.linalg.norm(points - centre, axis=1)) < 1e-6


def test_half_an_arc_needs_a_normal():
    what, centre = problem(shifted((0.0, 0.2, 0.0))), shifted((0.0, 0.1, 0.0)).translation.tolist()
    with pytest.raises(InputError, match="normal: nothing"):
        plan("arc", what, centre=centre)
    trajectory = plan("arc", what, centre=centre, normal=[-1, 0, 0]).trajectory
    assert tool_points(trajectory)[200] == pytest.approx(shifted((0.0, 0.1, 0.1)).translation, abs=2e-3)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (
            {"centre": [0.55, 0.21, 0.3], "normal": [1, 0, 0]},
            r"centre: 0.110202 m from the start and 0.0897993 m from .* such as \[0\.550064, 0\.199799, 0\.3\]",
        ),
        ({"centre": [0.550064, 0.199799, 0.299646], "angle": 1.0, "normal": [1, 0, 0]}, "angle: 1 rad.*one of"),
        ({"centre": [0.55, 0.25, 0.35]}, "centre: .* m from the goal"),
        ({"centre": pose(UR5).translation.tolist()}, "normal: nothing, with start, centre and goal in line"),
        ({"centre": pose(UR5).translation.tolist(), "normal": [1, 0, 0]}, "centre: 0 m from the start and 0.2 m"),
        ({"through": [0.550064, 0.199799, 0.299646]}, "through: .* in line"),
        (
            {"centre": [0.55, 0.2, 0.3], "normal": [0, 1, 0]},
            r"normal: \[0\.?0?, 1.* across the way to the goal, such as \[0.0, 0.0, -1",
        ),
    ],
)
def test_arcs_that_do_not_lead_to_the_goal_are_refused_with_what_would_fit(options, match):
    with pytest.raises(InputError, match=match):
        plan("arc", problem(shifted((0.0, 0.2, 0.0))), **options)


@pytest.mark.parametrize("orientation", ["kept", "following"])
def test_circle_closes(orientation):
    """Following, the last joint ends a turn from where it began: the start's pose, but not its configuration."""
    X = pose(UR5)
    what = problem(X if orientation == "following" else UR5)
    options = {"centre": (X.translation - [0, 0, 0.05]).tolist(), "normal": [2.0, 0.0, 0.0], "orientation": orientation}
    trajectory = plan("circle", what, **options).trajectory
    assert verify(what, trajectory).verified
    assert np.linalg.norm(pose(trajectory.end).translation - X.translation) <= 1e-6
    half = pose(trajectory(np.array([0.5 * trajectory.duration]))[0])
    assert half.translation == pytest.approx(X.translation - [0, 0, 0.1], abs=0.01)
    turned = np.linalg.norm(pin.log3(X.rotation.T @ half.rotation))
    assert turned == pytest.approx(np.pi if orientation == "following" else 0.0, abs=0.1)
    if orientation == "following":
        failure = plan("circle", problem(UR5), **options).failure
        assert (failure.witness["cause"], failure.witness["joint"]) == ("branch", "wrist_3_joint")


def test_circle_by_radius_and_plane_starts_at_the_top_and_may_turn_twice_the_other_way():
    trajectory = plan("circle", problem(UR5), radius=0.05, plane="yz", turns=-2).trajectory
    points = tool_points(trajectory, 2000) - pose(UR5).translation
    assert points.max(axis=0) == pytest.approx([0.0, 0.05, 0.0], abs=1e-5)
    assert points.min(axis=0) == pytest.approx([0.0, -0.05, -0.1], abs=1e-5)
    assert points[np.linalg.norm(points, axis=1).argmax() // 4, 1] > 0.0  # counterclockwise would go to -y first
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(0.2 * np.pi, rel=1e-4)


def test_limits_narrower_than_the_robots_end_the_path():
    lower = np.where(np.arange(6) == 0, UR5[0] - 0.01, ur5().limits.lower)
    what = derived(problem(UR5), limits=replace(ur5().limits, lower=lower))
    failure = plan("circle", what, radius=0.05, plane="xy").failure
    assert (failure.kind, failure.witness["limit"]) == ("limits", lower[0])
    check_witness(failure, "joint limit")


def test_circle_refuses_a_goal_elsewhere_and_a_centre_off_its_plane():
    with pytest.raises(InputError, match=r"goal: a pose 0.1 m .* ends where it begins"):
        plan("circle", problem(shifted((0.1, 0.0, 0.0))), radius=0.05, plane="xy")
    centre = pose(UR5).translation - [0.0, 0.02, 0.05]
    with pytest.raises(InputError, match=r"centre: 0.02 m off .* such as"):
        plan("circle", problem(UR5), centre=centre.tolist(), normal=[0, 1, 0])


def test_screw_about_a_given_axis_with_a_pitch():
    axis, point = np.array([0.0, 0.0, 1.0]), shifted((-0.1, 0.1, 0.0)).translation
    turn = pin.exp3(1.2 * axis)
    X = pose(UR5)
    end = pin.SE3(turn @ X.rotation, point + turn @ (X.translation - point) + 0.12 * axis)
    given = {"axis": [0, 0, 3], "point": point.tolist(), "angle": 1.2, "pitch": 0.1}
    what = problem(end)
    by_axis, by_goal = (plan("screw", what, **options).trajectory for options in (given, {}))
    for trajectory in (by_axis, by_goal):
        assert verify(what, trajectory).verified
        points = tool_points(trajectory)
        assert np.ptp(np.linalg.norm((points - point)[:, :2], axis=1)) < 1e-6
    with pytest.raises(InputError, match=r"goal: a pose .* expected pose"):
        plan("screw", what, **given | {"pitch": 0.2})


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("line", {"speed": 0.0}),
        ("line", {"duration": -1.0}),
        ("arc", {}),
        ("arc", {"through": [0.0, 1.0]}),
        ("arc", {"through": [0.0, 1.0, 0.0], "angle": 1.0}),
        ("circle", {"radius": 0.1}),
        ("circle", {"radius": -0.1, "plane": "xy"}),
        ("circle", {"centre": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 0.0]}),
        ("circle", {"radius": 0.1, "plane": "xy", "turns": 0}),
        ("screw", {"axis": [0.0, 0.0, 1.0]}),
        ("screw", {"pitch": 1.0}),
        ("screw", {"axis": [0.0, 0.0, 0.0], "point": [0.0, 0.0, 0.0], "angle": 1.0}),
    ],
)
def test_options_that_make_no_sense_are_refused(name, options):
    with pytest.raises(InputError):
        make_planner(name, options)


def test_a_goal_without_orientation_leaves_it_free_on_the_way():
    what = problem(shifted((0.0, 0.2, 0.0), (3.0, 0.0, 0.0)))
    free = derived(what, goal=(replace(what.goal[0], orientation=np.pi),))
    trajectory = plan("line", free).trajectory
    assert verify(free, trajectory).verified
    assert off_line(tool_points(trajectory)) <= 1e-6
    turned = pin.log3(pose(UR5).rotation.T @ pose(trajectory.end).rotation)
    assert np.linalg.norm(turned) < 1.0


def test_a_redundant_arm_aims_at_other_ends_when_its_elbow_is_in_the_way():
    robot = load_robot("panda")
    ready = robot.configurations["ready"]
    X = frame_pose(robot, ready, robot.tool_frame)
    cube = Obstacle("cube", Box((0.08, 0.08, 0.08)), pin.SE3(np.eye(3), np.array([-0.12, 0.17, 0.68])))
    goal = PoseGoal(robot.tool_frame, pin.SE3(X.rotation, X.translation + np.array([-0.11, 0.38, 0.06])))
    what = unchecked_problem(
        name="case", robot=robot, scene=Scene((cube,)), start=ready, goal=(goal,), limits=robot.limits
    )
    result = plan("line", what, profile="uniform")
    assert result.info["attempts"] > 2  # the first two go where limits are far
    assert verify(what, result.trajectory).verified


def test_no_motion_where_the_goal_is_the_start():
    result = plan("line", problem(UR5))
    assert isinstance(result.trajectory, Trajectory)
    assert result.trajectory.end == pytest.approx(UR5, abs=1e-9)
