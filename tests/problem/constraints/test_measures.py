"""Measures of path constraints: what a proof takes for granted of them between the poses that it looks at."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.problem.constraints.measures import measures
from optiplan.problem.constraints.points import OnArc, OnCircle
from optiplan.problem.constraints.poses import LookAt, OnScrew

AXIS = np.array([0.48, -0.6, 0.64])
PLACE = pin.SE3(pin.exp3(np.array([0.3, -0.7, 1.1])), np.array([0.4, -0.2, 0.5]))
ONES = {
    "look_at": LookAt("tool", np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.1, 0.2]), 0.3),
    "circle": OnCircle("tool", np.array([0.1, 0.0, 0.2]), AXIS, 0.3, 1e-3),
    "arc": OnArc("tool", np.array([0.4, 0.0, 0.0]), np.array([0.3, 0.3, 0.1]), np.array([0.0, 0.4, 0.0]), 1e-3),
    "door": OnScrew("tool", AXIS, np.array([0.1, 0.2, 0.3]), 0.0, PLACE, 1e-3, 0.02),
    "bolt": OnScrew("tool", AXIS, np.array([0.1, 0.2, 0.3]), 0.05, PLACE, 0.01, 0.5),
}


def near(one, rng):
    """A pose that is within a few tolerances of the constraint, where that is a screw."""
    if not isinstance(one, OnScrew):
        return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3) * 0.4)
    turn = rng.uniform(-3.0, 3.0)
    R = pin.exp3(one.axis * turn)
    p = one.point + R @ (one.X_WF.translation - one.point) + one.pitch * turn * one.axis
    off = pin.exp3(rng.normal(size=3) * one.orientation)
    return pin.SE3(off @ R @ one.X_WF.rotation, p + rng.normal(size=3) * one.position)


@pytest.mark.parametrize("one", ONES.values(), ids=ONES)
def test_no_measure_grows_by_more_than_it_says(one):
    """Origins travel by at most so much, and frames turn by at most so much, in whatever direction."""
    (measure,) = measures(one)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        X = near(one, rng)
        travel, turn = rng.choice([0.0, 1e-5, 1e-3, 0.1]), rng.choice([0.0, 1e-5, 1e-3, 0.1, 0.5])
        by, about = rng.normal(size=(2, 3))
        step = pin.exp3(turn * about / np.linalg.norm(about))
        Y = pin.SE3(step @ X.rotation, X.translation + travel * by / np.linalg.norm(by))
        before, after = measure.value(np.stack([X.homogeneous, Y.homogeneous]))
        assert measure.growth is not None
        (grown,) = measure.growth(X.homogeneous[None], np.array([travel]), np.array([turn]))
        assert after <= before + grown + 1e-9


def test_a_screw_is_left_by_a_turn_about_the_frame_itself():
    """The frame stays where it is, and turns about the axis: the screw would have moved it by the lever times that."""
    X_WF = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    (measure,) = measures(OnScrew("tool", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, X_WF, 1e-3, 0.1))
    turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.01])), X_WF.translation)
    assert measure.value(turned.homogeneous[None])[0] == pytest.approx(5.0, rel=1e-4)
    assert measure.growth(X_WF.homogeneous[None], np.zeros(1), np.array([0.01]))[0] >= 5.0
