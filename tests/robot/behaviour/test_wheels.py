"""Mecanum wheels: their rates along a motion, and as joints of the exported URDF."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from optiplan.kinematics.mecanum import WHEELS, wheel_rates_along
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf.export import export_urdf
from optiplan.runs.metrics import peak_wheel_rates
from optiplan.trajectory.timing.stops import stop_at_corners


def test_driving_ahead_all_wheels_turn_alike():
    robot = load_robot("delbot", group="base")
    rates = wheel_rates_along(robot, np.array([[0.0, 0.0, 0.5]]), 0.3 * np.array([[np.cos(0.5), np.sin(0.5), 0.0]]))
    assert np.allclose(rates, 0.3 / robot.mecanum.radius)
    assert wheel_rates_along(load_robot("ur5"), np.zeros((1, 6)), np.zeros((1, 6))) is None


def test_the_largest_rates_of_a_motion():
    robot = load_robot("delbot", group="base")
    motion = stop_at_corners(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), robot.limits, robot.joint_names)
    peaks = peak_wheel_rates(robot, motion)
    assert tuple(peaks) == WHEELS
    assert list(peaks.values()) == pytest.approx(4 * [robot.limits.velocity[0] / robot.mecanum.radius], rel=1e-3)


def test_the_urdf_has_wheel_joints():
    root = ET.fromstring(export_urdf(load_robot("delbot")).encode())
    wheels = {j.get("name"): j for j in root.findall("joint") if str(j.get("name")).startswith("wheel_")}
    assert sorted(wheels) == [f"wheel_{name}_joint" for name in sorted(WHEELS)]
    for joint in wheels.values():
        assert (joint.get("type"), joint.find("parent").get("link")) == ("continuous", "chassis")
        assert joint.find("axis").get("xyz") == "0 1 0"
    assert "wheel_" not in export_urdf(load_robot("ur5"))
