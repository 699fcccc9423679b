"""A robot as a URDF for other programs."""

import xml.etree.ElementTree as ET

import numpy as np

from optiplan.robot.robot import Robot
from optiplan.robot.urdf.elements import xml_text
from optiplan.robot.urdf.reader import ENDLESS

_RATES = {"acceleration": "acceleration", "deceleration": "acceleration", "jerk": "jerk"}
"""Attributes of <limit> in URDF 1.2, and the limits of a robot that they state."""


def export_urdf(robot: Robot) -> str:
    """The URDF of the whole robot, with the limits of its planned joints; meshes by their absolute paths.

    Position, velocity and effort limits are those of `robot.limits`; joints without an end are `continuous`.
    Those of acceleration and jerk, which only readers of URDF 1.2 take, are where the source states some. A capsule is
    a cylinder with a mark: see `dh.to_urdf`. Mecanum wheels that planned joints stand for are continuous joints,
    `wheel_front_left` and so on, which turn about y of the base.
    """
    root = ET.fromstring(robot.urdf)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    endless = set(np.array(robot.joint_names)[robot.endless])
    for name, joint in joints.items():
        limit = joint.find("limit")
        if limit is not None and (name in endless or float(limit.get("upper", "0")) == ENDLESS):
            joint.set("type", "continuous")
            del limit.attrib["lower"], limit.attrib["upper"]
    for i, name in enumerate(robot.joint_names):
        limit = joints[name].find("limit")
        assert limit is not None  # `read_urdf` gives one to every joint that can be planned
        limit.set("velocity", repr(float(robot.limits.velocity[i])))
        for key, end in (("lower", robot.limits.lower[i]), ("upper", robot.limits.upper[i])):
            if np.isfinite(end):
                limit.set(key, repr(float(end)))
        for key in limit.attrib.keys() & _RATES.keys():
            limit.set(key, repr(float(getattr(robot.limits, _RATES[key])[i])))
        if np.isfinite(robot.limits.torque[i]):
            limit.set("effort", repr(float(robot.limits.torque[i])))
    _add_wheels(root, robot)
    ET.indent(root)
    return xml_text(root)


def _add_wheels(root: ET.Element, robot: Robot) -> None:
    """Add a link and a continuous joint for each mecanum wheel, to the link that the base's joints move."""
    spec = robot.mecanum
    names = {link.get("name") for link in root.findall("link")}
    if spec is None or "wheel_front_left" in names:
        return
    base = next(joint.find("child") for joint in root.findall("joint") if joint.get("name") == spec.joints[2])
    assert base is not None
    for x, along in ((spec.half_wheelbase, "front"), (-spec.half_wheelbase, "rear")):
        for y, side in ((spec.half_track, "left"), (-spec.half_track, "right")):
            name = f"wheel_{along}_{side}"
            link = ET.SubElement(root, "link", name=name)
            visual = ET.SubElement(link, "visual")
            ET.SubElement(visual, "origin", xyz="0 0 0", rpy=f"{np.pi / 2!r} 0 0")
            shape = ET.SubElement(visual, "geometry")
            ET.SubElement(shape, "cylinder", radius=repr(spec.radius), length=repr(spec.radius))
            joint = ET.SubElement(root, "joint", name=f"{name}_joint", type="continuous")
            ET.SubElement(joint, "origin", xyz=f"{x!r} {y!r} {spec.radius!r}", rpy="0 0 0")
            ET.SubElement(joint, "parent", link=str(base.get("link")))
            ET.SubElement(joint, "child", link=name)
            ET.SubElement(joint, "axis", xyz="0 1 0")
