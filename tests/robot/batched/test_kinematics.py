"""Axes of the joints of many configurations at once."""

import numpy as np
import pytest

import optiplan as op
from optiplan.robot.batched.kinematics import _columns


@pytest.mark.parametrize("name", ["panda", "ur5", "baxter", "delbot", "puma560", "srra"])
def test_axes_are_the_same_by_columns_and_by_products(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = op.load_robot(name)
    kinematics = robot.kinematics
    poses = kinematics.poses(np.random.default_rng(2).uniform(-1.0, 1.0, (5, robot.n)))
    quick = kinematics.axes(poses)
    monkeypatch.setattr(kinematics, "_along", None)
    for found, product in zip(quick, kinematics.axes(poses), strict=True):
        assert np.array_equal(found, product)
        assert found.flags.c_contiguous


def test_an_axis_that_is_no_coordinate_axis_has_no_column() -> None:
    assert _columns(np.eye(3)[[2, 0, 1]]).tolist() == [2, 0, 1]
    for axis in ([0.6, 0.8, 0.0], [0.0, 0.0, -1.0], [1.0, 1e-28, 0.0]):
        assert _columns(np.array([[0.0, 0.0, 1.0], axis])) is None
