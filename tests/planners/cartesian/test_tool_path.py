"""Tool paths: ends, derivatives against differences, shapes."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.planners.cartesian.tool_path import (
    ToolPath,
    angle_about,
    arc,
    circle,
    circle_through,
    line,
    screw,
    screw_about,
)

RNG = np.random.default_rng(4)


def pose():
    return pin.SE3(pin.exp3(RNG.normal(size=3)), RNG.normal(size=3))


def any_path():
    """One whose velocity and orientation turn about different axes, by different angles."""
    return ToolPath(pose(), RNG.normal(size=3), 2.0 * RNG.normal(size=3), RNG.normal(size=3))


def test_twist_is_the_derivative_of_the_pose():
    path, h = any_path(), 1e-6
    for s in (0.0, 0.3, 1.0):
        low, high = path.pose(s - h), path.pose(s + h)
        velocity = (high.translation - low.translation) / (2.0 * h)
        angular = pin.log3(high.rotation @ low.rotation.T) / (2.0 * h)
        assert path.twist(s) == pytest.approx(np.concatenate([velocity, angular]), abs=1e-8)


def test_twist_rate_is_the_derivative_of_the_twist():
    path, h = any_path(), 1e-5
    for s in (0.0, 0.3, 1.0):
        difference = (path.twist(s + h) - path.twist(s - h)) / (2.0 * h)
        assert path.twist_rate(s) == pytest.approx(difference, abs=1e-8)


def test_velocity_turns_and_so_does_the_frame():
    """R(s) = exp([w] s) R(0), p'(s) = exp([a] s) u."""
    path = any_path()
    for s in (0.2, 0.9):
        assert path.pose(s).rotation == pytest.approx(pin.exp3(s * path.turning) @ path.start.rotation, abs=1e-14)
        assert path.twist(s)[:3] == pytest.approx(pin.exp3(s * path.bending) @ path.velocity, abs=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1.0, np.pi - 1e-9, np.pi])
def test_line_and_screw_end_at_the_goal(angle):
    axis = np.array([0.6, 0.0, 0.8])
    start = pose()
    end = pin.SE3(pin.exp3(angle * axis) @ start.rotation, np.array([0.1, 0.2, 0.3]))
    for path in (line(start, end), screw(start, end), screw(start, end, 0)):
        assert path.end.homogeneous == pytest.approx(end.homogeneous, abs=1e-14)
        assert path.angle == pytest.approx(angle, abs=1e-12)


def test_line_is_straight_and_its_orientation_is_slerp():
    start, end = pose(), pose()
    path = line(start, end)
    a, b = pin.Quaternion(start.rotation), pin.Quaternion(end.rotation)
    for s in (0.25, 0.6):
        straight = (1.0 - s) * start.translation + s * end.translation
        assert path.pose(s).translation == pytest.approx(straight, abs=1e-14)
        assert path.pose(s).rotation == pytest.approx(a.slerp(s, b).toRotationMatrix(), abs=1e-12)
    assert path.length == pytest.approx(np.linalg.norm(end.translation - start.translation))


def test_screw_is_the_power_of_the_displacement():
    """X(s) = X(0) exp(s log(X(0)^-1 X(1)))."""
    start, end = pose(), pose()
    path = screw(start, end)
    for s in (0.25, 0.6):
        expected = start * pin.exp6(s * pin.log6(start.actInv(end)))
        assert path.pose(s).homogeneous == pytest.approx(expected.homogeneous, abs=1e-14)


def test_more_turns_of_a_screw_keep_axis_slide_and_end():
    start, end = pose(), pose()
    plain = screw(start, end)
    axis = plain.turning / plain.angle
    for turns in (1, -2):
        path = screw(start, end, turns)
        assert path.end.homogeneous == pytest.approx(end.homogeneous, abs=1e-13)
        assert axis @ path.turning == pytest.approx(plain.angle + 2.0 * np.pi * turns)
        assert axis @ path.velocity == pytest.approx(axis @ plain.velocity)


def test_screw_about_an_axis_keeps_its_distance_and_slides_by_the_pitch():
    start, axis, point = pose(), np.array([0.0, 0.6, 0.8]), np.array([0.3, -0.2, 0.5])
    path = screw_about(start, axis, point, 2.5, 0.4)
    offset = start.translation - point
    for s in (0.5, 1.0):
        turned = pin.exp3(2.5 * s * axis)
        expected = point + turned @ offset + 0.4 * s * axis
        assert path.pose(s).translation == pytest.approx(expected, abs=1e-14)
        assert path.pose(s).rotation == pytest.approx(turned @ start.rotation, abs=1e-14)


def test_arc_through_a_point_passes_it_and_ends_at_the_goal():
    for _ in range(20):
        start, via, end = pose(), RNG.normal(size=3), pose()
        centre, rotation = circle_through(start.translation, via, end.translation)
        path = arc(start, end, centre, rotation)
        assert path.end.homogeneous == pytest.approx(end.homogeneous, abs=1e-11)
        axis = rotation / np.linalg.norm(rotation)
        passed = angle_about(axis, start.translation - centre, via - centre) % (2.0 * np.pi)
        assert passed < np.linalg.norm(rotation) < 2.0 * np.pi
        at = path.pose(passed / np.linalg.norm(rotation)).translation
        assert at == pytest.approx(via, abs=1e-10 * max(1.0, np.linalg.norm(centre)))


def test_the_circle_through_three_points_is_as_far_from_all():
    """centre = a + (|u|^2 v x n - |v|^2 u x n) / (2 |n|^2)."""
    a, b, c = np.eye(3)
    centre, rotation = circle_through(a, b, c)
    assert centre == pytest.approx(np.full(3, 1.0 / 3.0))
    assert rotation == pytest.approx(np.full(3, 4.0 * np.pi / 3.0 / np.sqrt(3.0)))
    assert circle_through(a, 0.5 * (a + b), b) is None


def test_circle_closes_and_keeps_its_radius():
    start, centre = pose(), RNG.normal(size=3)
    normal = np.array([0.0, 0.0, 1.0])
    path = circle(start, centre, 2.0 * np.pi * normal, np.zeros(3))
    assert path.end.homogeneous == pytest.approx(start.homogeneous, abs=1e-14)
    radius = np.linalg.norm((start.translation - centre)[:2])
    for s in np.linspace(0.0, 1.0, 9):
        X = path.pose(s)
        assert np.linalg.norm((X.translation - centre)[:2]) == pytest.approx(radius)
        assert X.translation[2] == pytest.approx(start.translation[2])
        assert X.rotation == pytest.approx(start.rotation)
    assert path.length == pytest.approx(2.0 * np.pi * radius)


def test_angles_leave_parts_along_the_axis_aside():
    assert angle_about(
        np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 5.0]), np.array([0.0, 2.0, -3.0])
    ) == pytest.approx(np.pi / 2.0)
