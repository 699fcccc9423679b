"""Elements of a URDF that no plan needs: left out where parsers would refuse the file, or the link, for them."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator

from optiplan.config.messages import some
from optiplan.robot.urdf.validation import MOVING, plain_numbers, shape_faults

UNUSED = ("safety_controller", "calibration")
"""Elements of a joint that nothing reads."""

NEWER = ("link/*/geometry/capsule", ".//origin[@quat_xyzw]")
"""What parsers take from version 1.1 on."""


def leave_out(root: ET.Element, joints: list[ET.Element]) -> Iterator[str]:
    """Take out of a URDF what would stop its parser and is of no use to a planner; say what is then not shown."""
    if not root.get("name"):
        root.set("name", "robot")
    if root.get("version", "1.0") == "1.0" and any(root.find(place) is not None for place in NEWER):
        root.set("version", "1.1")  # parsers ignore these in older files
    yield from _soft_limits(joints)
    for joint in joints:
        _settle_joint(joint)
    _settle_materials(root)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            if fault := next(shape_faults(visual.find("geometry"), "visual"), None):
                link.remove(visual)
                yield f"link {link.get('name')}: {fault[0]}, not shown"
            for material in visual.findall("material"):
                if not material.get("name"):
                    material.set("name", f"{link.get('name')}_material")
                if not _has_colour(material) and len(material):
                    visual.remove(material)


def _soft_limits(joints: list[ET.Element]) -> Iterator[str]:
    if soft := [joint.get("name", "") for joint in joints if _has_soft_limits(joint)]:
        yield f"soft limits of position, narrower than <limit>, are not read: those of {some(soft, 4)}"


def _has_soft_limits(joint: ET.Element) -> bool:
    """Whether a `safety_controller` states narrower limits of position; 0 and 0, its defaults, state none."""
    soft, limit = joint.find("safety_controller"), joint.find("limit")
    if soft is None or limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return False
    stated = [soft.get("soft_lower_limit", "0"), soft.get("soft_upper_limit", "0")]
    ends = [plain_numbers(text) for text in (*stated, limit.get("lower", "0"), limit.get("upper", "0"))]
    if not all(len(end) == 1 for end in ends):
        return False
    (low,), (high,), (lower,), (upper,) = ends
    return low < high and (low > lower or high < upper)


def _settle_joint(joint: ET.Element) -> None:
    """Take out what is not read, and what says nothing."""
    for element in list(joint):
        empty = element.tag == "dynamics" and not {"damping", "friction"} & set(element.attrib)
        follows = element.tag == "mimic" and joint.get("type") not in MOVING
        if element.tag in UNUSED or empty or follows:
            joint.remove(element)


def _settle_materials(root: ET.Element) -> None:
    """Keep each material of the robot once, and those that say a colour."""
    names = set()
    for material in root.findall("material"):
        name = material.get("name")
        if not name or name in names or not _has_colour(material):
            root.remove(material)
        names.add(name)


def _has_colour(material: ET.Element) -> bool:
    """Whether a material says a colour that can be one, or a picture."""
    colour, texture = material.find("color"), material.find("texture")
    numbers = [] if colour is None else plain_numbers(colour.get("rgba", ""))
    pictured = colour is None and texture is not None and bool(texture.get("filename"))
    return pictured or (len(numbers) == 4 and all(0.0 <= x <= 1.0 for x in numbers))
