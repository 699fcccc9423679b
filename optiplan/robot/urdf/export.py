"""A robot as a URDF for other programs."""

import xml.etree.ElementTree as ET

import numpy as np

from optiplan.robot.robot import Robot


def export_urdf(robot: Robot) -> str:
    """The URDF of the whole robot, with the limits of its planned joints; meshes by their absolute paths.

    Position, velocity and effort limits are those of `robot.limits`; joints without an end are `continuous`.
    A URDF has no word for acceleration and jerk limits, and none for capsules: see `dh_urdf`.
    """
    root = ET.fromstring(robot.urdf)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for i, name in enumerate(robot.joint_names):
        limit = joints[name].find("limit")
        assert limit is not None  # `read_urdf` gives one to every joint that can be planned
        if np.isinf(robot.limits.lower[i]) and np.isinf(robot.limits.upper[i]):
            joints[name].set("type", "continuous")
            del limit.attrib["lower"], limit.attrib["upper"]
        limit.set("velocity", repr(float(robot.limits.velocity[i])))
        if np.isfinite(robot.limits.torque[i]):
            limit.set("effort", repr(float(robot.limits.torque[i])))
    ET.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
