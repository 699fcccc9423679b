"""Links that no joint moves, as frames of a problem file."""

import xml.etree.ElementTree as ET

import pinocchio as pin

from optiplan.robot.robot import Robot


def fixed_links(robot: Robot) -> dict[str, pin.SE3]:
    """Return the poses X_BL, in the robot's root, of the links that no joint of its description moves."""
    moved: set[str] = set()
    children: dict[str, list[str]] = {}
    for joint in ET.fromstring(robot.urdf).iter("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            continue
        children.setdefault(parent.get("link", ""), []).append(child.get("link", ""))
        moved |= {child.get("link", "")} if joint.get("type") != "fixed" else set()
    left = list(moved)
    while left:
        more = [child for child in children.get(left.pop(), ()) if child not in moved]
        moved.update(more)
        left += more
    frames = robot.unmounted.model.frames
    links = {frame.name: frame for frame in frames if frame.type == pin.FrameType.BODY}
    return {name: link.placement for name, link in links.items() if name not in moved and link.parentJoint == 0}
