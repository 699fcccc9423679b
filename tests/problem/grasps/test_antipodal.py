"""Antipodal grasps of boxes and cylinders: fingers on opposite faces, coming from outside."""

import numpy as np
import pytest

from optiplan.geometry.shapes import Box, Cylinder, Sphere
from optiplan.problem.grasps.antipodal import DEEPEST, graspable, grasps, gripper_in_frame, least_width

SHAPES = [Box((0.04, 0.06, 0.1)), Box((0.02, 0.2, 0.2)), Cylinder(0.03, 0.12), Cylinder(0.2, 0.05)]
OPENING = 0.08


def inside(shape, p):
    if isinstance(shape, Box):
        return bool((np.abs(p) <= 0.5 * np.array(shape.size) + 1e-12).all())
    return bool(np.hypot(p[0], p[1]) <= shape.radius + 1e-12 and abs(p[2]) <= 0.5 * shape.length + 1e-12)


def width(shape, X, side):
    """Distance from the TCP to the surface along the closing axis, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        here = inside(shape, X.translation + side * middle * X.rotation[:, 1])
        low, high = (middle, high) if here else (low, middle)
    return low


@pytest.mark.parametrize("shape", SHAPES)
def test_fingers_meet_opposite_faces_within_the_opening(shape):
    found = grasps(shape, OPENING)
    assert len(found) >= 8
    for X in found:
        assert inside(shape, X.translation)
        assert np.allclose(X.rotation.T @ X.rotation, np.eye(3))
        assert np.linalg.det(X.rotation) > 0.0
        left, right = width(shape, X, 1.0), width(shape, X, -1.0)
        assert left == pytest.approx(right, abs=1e-9)  # the TCP is between the fingertips
        assert left + right <= OPENING + 1e-9


@pytest.mark.parametrize("shape", SHAPES)
def test_the_gripper_comes_from_outside_and_as_deep_as_stated(shape):
    for depth in (None, 0.01):
        for X in grasps(shape, OPENING, depth):
            back = [X.translation - s * X.rotation[:, 2] for s in (DEEPEST if depth is None else depth, 0.5)]
            assert not inside(shape, back[1])
            outside = back[0] - 1e-6 * X.rotation[:, 2]
            assert depth is None or not inside(shape, outside)


def test_a_wider_side_is_not_grasped():
    """Of 20 x 200 x 200 mm only the thin sides are: from four directions, turned twice, in three places."""
    assert len(grasps(Box((0.02, 0.2, 0.2)), OPENING)) == 4 * 2 * 3
    assert len(grasps(Cylinder(0.2, 0.05), OPENING, turns=6)) == 6 * 2
    assert grasps(Box((0.2, 0.2, 0.2)), OPENING) == []
    assert least_width(Cylinder(0.2, 0.05)) == 0.05
    assert not graspable(Sphere(0.02))


def test_axes_of_any_gripper_are_those_that_come_and_close():
    X_FG = gripper_in_frame(np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    X_OF = grasps(Box((0.04, 0.06, 0.1)), OPENING)[0] * X_FG.inverse()
    X_OG = grasps(Box((0.04, 0.06, 0.1)), OPENING)[0]
    assert np.allclose(X_OF.rotation @ [1.0, 0, 0], X_OG.rotation[:, 2])
    assert np.allclose(X_OF.rotation @ [0, 0, 1.0], X_OG.rotation[:, 1])
