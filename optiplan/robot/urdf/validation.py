"""Find URDF faults that pinocchio's parser ignores silently: it drops the faulty part, which is then never checked."""

import math
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from difflib import get_close_matches
from typing import NamedTuple

import numpy as np

from optiplan.config.messages import some
from optiplan.records import dataclass

SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}}
SIZES["capsule"] = SIZES["cylinder"]
"""Attributes of each shape, and how many numbers > 0 each has."""

MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")

DEEPEST = 64
"""How deep elements may be nested; a URDF needs seven."""

LONGEST = 256
"""Characters of a name."""

RESERVED = "universe"
"""Pinocchio's name of the world, which no joint and no link may have."""


VERSIONS = ("1.0", "1.1", "1.2")
"""Of the format, as a file may say."""


class Fault(NamedTuple):
    """A fault of a URDF: name of the link or joint, what was found, what is expected."""

    name: str
    found: str
    expected: str


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)


@dataclass(frozen=True)
class _Range:
    """Number of values of an attribute, and the bounds of each."""

    count: int
    low: float
    high: float
    words: str


_PLACE = _Range(3, -1e5, 1e5, "three numbers of at most 1e5 m")
_TURN = _Range(3, -4.0 * math.pi, 4.0 * math.pi, "three angles in rad, within two turns (12.566)")
_END = _Range(1, -1e30, 1e30, "a number of at most 1e30 (a joint without an end is `continuous`)")
_RATE = _Range(1, 0.0, 1e12, "a number from 0 to 1e12")
_MASS = _Range(1, 0.0, 1e9, "a mass from 0 to 1e9 kg, as a plain number")
_MOMENT = _Range(1, -1e-9, 1e12, "a moment of inertia from 0 to 1e12 kg m², as a plain number")
_PRODUCT = _Range(1, -1e12, 1e12, "a number of at most 1e12 kg m²")

_QUATERNION = _Range(4, -1.001, 1.001, "the four numbers of a unit quaternion")
_ORIGIN = {"xyz": _PLACE, "rpy": _TURN, "quat_xyzw": _QUATERNION}
_FACTOR = _Range(1, -1e12, 1e12, "a number of at most 1e12")
_MIMIC = {"multiplier": _FACTOR, "offset": _FACTOR}
_DYNAMICS = {"damping": _RATE, "friction": _RATE}
_LIMIT = {"lower": _END, "upper": _END}
_LIMIT |= dict.fromkeys(("velocity", "effort", "acceleration", "deceleration", "jerk"), _RATE)
_INERTIA = {key: _MOMENT if key[1] == key[2] else _PRODUCT for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}


ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "joint": ("parent", "child", "origin", "axis", "limit", "mimic"),
}
"""What an element has once, of what decides about a motion."""

READ = {
    "link": ("inertial", "visual", "collision", "collision_checking", "self_collision_checking"),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "joint": ("parent", "child", "origin", "axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"),
}
"""What is read inside an element. Others have a meaning for other programs, but not if they look like one of these."""

STATED = {"origin": tuple(_ORIGIN), "axis": ("xyz",), "mimic": ("joint", *_MIMIC), "mesh": ("filename", "scale")}
"""Attributes of which each has a default: one that is misspelt would move a joint or a body elsewhere."""

ALIKE = 0.75, 0.6
"""How alike a tag, and an attribute, is to the one that is meant, as `difflib` measures it."""

DEGREES = (40.0, 720.0)
"""Limits of joints that turn, if in radians from six turns on, which few arms have; larger ones mean without end."""

ROUNDED = 1e-6
"""kg m²: by so much the digits of a file may be off."""


def odd_inertias(root: ET.Element) -> Iterator[str]:
    """Say which links have an inertia with a negative principal moment; to be asked of a URDF without faults.

    No body has one, but files of real robots do, so that is no fault: torques are then as wrong as the file.
    """
    for link in root.findall("link"):
        for inertia in link.findall("inertial/inertia"):
            xx, yy, zz, xy, xz, yz = (float(inertia.get(key, "0")) for key in _INERTIA)
            least = float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0])
            if least < -ROUNDED:
                moment = f"a principal moment of {least:.3g} kg m², which no body has"
                yield f"link {link.get('name')}: an inertia with {moment}; torques are as wrong as that"


def odd_turns(joints: Iterable[ET.Element]) -> Iterator[str]:
    """Say which joints turn so far that their limits look like degrees; to be asked of a URDF without faults."""
    ends = {
        joint.get("name", ""): max(abs(float(limit.get(key, "0"))) for key in ("lower", "upper"))
        for joint in joints
        for limit in joint.findall("limit")
        if joint.get("type") == "revolute"
    }
    if far := [f"{name} ({end:g} rad)" for name, end in ends.items() if DEGREES[0] <= end <= DEGREES[1]]:
        yield f"limits of position that look like degrees, where a URDF has radians: those of {some(far, 3)}"


def faults(root: ET.Element, joints: list[ET.Element]) -> Iterator[Fault]:
    """Everything that a parser would drop or choke on, of links first and of joints then, and of the tree at last."""
    yield from list(_part_faults(root, joints)) or _root_faults(root)


def _part_faults(root: ET.Element, joints: list[ET.Element]) -> Iterator[Fault]:
    yield from _depth_faults(root)
    if root.get("version", VERSIONS[0]) not in VERSIONS:
        yield Fault(root.get("name", ""), f"version '{root.get('version')}'", f"one of: {', '.join(VERSIONS)}")
    links = root.findall("link")
    if not links:
        yield Fault("robot", f"<{root.tag}> without a <link>", "a URDF: a <robot> with links and joints")
    yield from _name_faults("link", links)
    yield from _name_faults("joint", joints)
    for element, find in [*((link, _link_faults) for link in links), *((joint, _joint_faults) for joint in joints)]:
        for fault in (*_repetitions(element), *_misspellings(element), *find(element)):
            yield Fault(element.get("name", ""), *fault)
    yield from _tree_faults(root, {link.get("name", "") for link in links})


def _depth_faults(root: ET.Element) -> Iterator[Fault]:
    level = [root]
    for _ in range(DEEPEST):
        level = [child for element in level for child in element]
    if level:
        yield Fault(root.get("name", ""), f"elements nested more than {DEEPEST} deep", "a URDF")


def _name_faults(kind: str, elements: list[ET.Element]) -> Iterator[Fault]:
    counts = Counter(element.get("name", "") for element in elements)
    for name, count in counts.items():
        if not name:
            yield Fault("", f"a {kind} without a name", "a name")
        elif len(name) > LONGEST or not name.isprintable():
            yield Fault(name, f"a {kind} with a name of {len(name)} characters", f"at most {LONGEST}, all printable")
        elif count > 1:
            yield Fault(name, f"{count} {kind}s called '{name}'", "names that differ")
        elif name == RESERVED:
            yield Fault(name, f"a {kind} called '{RESERVED}', which is the world's own name", "another name")


def _link_faults(link: ET.Element) -> Iterator[tuple[str, str]]:
    for collision in link.findall("collision"):
        yield from shape_faults(collision.find("geometry"))
        yield from _origin_faults(collision.find("origin"))
    for visual in link.findall("visual"):
        yield from _origin_faults(visual.find("origin"))
    for inertial in link.findall("inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is None or inertia is None:
            missing = " and ".join(f"<{tag}>" for tag in ("mass", "inertia") if inertial.find(tag) is None)
            yield f"an <inertial> without {missing}", "both, or no <inertial>"
        yield from _number_faults(mass, {"value": _MASS}, required=True)
        yield from _number_faults(inertia, _INERTIA, required=True)
        yield from _origin_faults(inertial.find("origin"))


def _repetitions(element: ET.Element) -> Iterator[tuple[str, str]]:
    """Find repeated elements, where readers take the first."""
    for inside in element.iter():
        for tag, count in Counter(str(child.tag) for child in inside).items():
            if count > 1 and tag in ONCE.get(str(inside.tag), ()):
                yield f"{count} <{tag}> in a <{inside.tag}>", "one: a reader takes the first and drops the others"


def _misspellings(element: ET.Element) -> Iterator[tuple[str, str]]:
    """Find tags and attributes that no reader knows, and that are written almost like one that all know."""
    for inside in element.iter():
        known = READ.get(str(inside.tag), ())
        for tag in {str(child.tag) for child in inside} if known else ():
            if meant := _meant(tag, known, ALIKE[0]):
                yield f"<{tag}> in a <{inside.tag}>", f"<{meant}>"
        for name in inside.attrib:
            meant = _meant(name, STATED.get(str(inside.tag), ()), ALIKE[1])
            if meant and meant not in inside.attrib:
                yield f"<{inside.tag}> with {name}='{inside.get(name)}'", meant


def _meant(name: str, known: Collection[str], alike: float) -> str:
    """Return the known name that was meant; empty where it is one of them, or like none."""
    return "" if name in known else next(iter(get_close_matches(name.lower(), known, 1, alike)), "")


def _root_faults(root: ET.Element) -> Iterator[Fault]:
    links = [link.get("name", "") for link in root.findall("link")]
    carried = {_end(joint, "child") for joint in root.findall("joint")}
    roots = [link for link in links if link not in carried]
    for link in roots[1:]:
        yield Fault(link, f"a link that no joint carries, besides '{roots[0]}'", "a tree: one such link")
    children: dict[str, list[str]] = {}
    for joint in root.findall("joint"):
        children.setdefault(_end(joint, "parent"), []).append(_end(joint, "child"))
    reached = list(roots)
    for link in reached:  # each link once: it is the child of one joint
        reached += children.get(link, [])
    if circle := {*links} - {*reached}:
        yield Fault(min(circle), "links that carry each other in a circle", "a tree: one link that no joint carries")


def _tree_faults(root: ET.Element, links: set[str]) -> Iterator[Fault]:
    seen: set[str] = set()
    joints = root.findall("joint")
    for joint in joints:
        for end in ("parent", "child"):
            link = _end(joint, end)
            if link not in links:
                yield Fault(
                    joint.get("name", ""), f"the {end} link '{link}', which is not there", "a link of this file"
                )
        name = _end(joint, "child")
        if name in seen:
            yield Fault(name, "a link that is the child of two joints", "a tree: one parent for each link")
        seen.add(name)


def _end(joint: ET.Element, end: str) -> str:
    """Return the link that is the `parent` or the `child` of a joint; empty where it names none."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _joint_faults(joint: ET.Element) -> Iterator[tuple[str, str]]:
    kind = joint.get("type", "")
    if kind not in JOINT_TYPES:
        yield f"a joint of type '{kind}'", f"one of: {', '.join(JOINT_TYPES)}"
    yield from _origin_faults(joint.find("origin"))
    yield from _number_faults(joint.find("limit"), _LIMIT)
    yield from _number_faults(joint.find("mimic"), _MIMIC)
    yield from _number_faults(joint.find("dynamics"), _DYNAMICS)
    axis = joint.find("axis")
    if kind in (*MOVING, "planar") and axis is not None:
        numbers = plain_numbers(axis.get("xyz", "1 0 0"))
        if len(numbers) != 3 or not 1e-6 < math.hypot(*numbers) < 1e6:
            yield f"the axis '{axis.get('xyz')}'", "a direction: three numbers, not all 0"


def shape_faults(geometry: ET.Element | None, owner: str = "collision") -> Iterator[tuple[str, str]]:
    """Find what is wrong with the shape of an element: what is there, and what is expected."""
    shapes = [] if geometry is None else [shape for shape in geometry if shape.tag in (*SIZES, "mesh")]
    if len(shapes) != 1:
        yield f"a <{owner}> with {len(shapes)} shapes", f"one of: {', '.join(SIZES)}, mesh"
        return
    shape = shapes[0]
    if shape.tag == "mesh":
        scale = shape.get("scale", "1 1 1")
        numbers = plain_numbers(scale)
        if len(numbers) != 3 or not all(1e-9 < abs(x) < 1e9 for x in numbers):  # a mirrored mesh has one below 0
            yield f"<mesh> with scale '{scale}'", "three numbers, none of them 0, of less than 1e9"
        return
    for name, count in SIZES[shape.tag].items():
        numbers = plain_numbers(shape.get(name, ""))
        if len(numbers) != count or not all(0.0 < x < 1e6 for x in numbers):
            expected = f"{'three numbers' if count == 3 else 'a number'} > 0 and < 1e6 m"
            yield f"<{shape.tag}> with {name} '{shape.get(name, '')}'", expected


def _origin_faults(origin: ET.Element | None) -> Iterator[tuple[str, str]]:
    yield from _number_faults(origin, _ORIGIN)
    if origin is not None and {"rpy", "quat_xyzw"} <= set(origin.attrib):
        yield "<origin> with rpy and quat_xyzw", "one of them"


def _number_faults(
    element: ET.Element | None, ranges: dict[str, _Range], required: bool = False
) -> Iterator[tuple[str, str]]:
    """Attributes that are no plain numbers, or beyond their range; those left out only where they are required."""
    if element is None:
        return
    for key, allowed in ranges.items():
        text = element.get(key)
        if text is None and not required:
            continue
        numbers = plain_numbers(text or "")
        if len(numbers) != allowed.count or not all(allowed.low <= x <= allowed.high for x in numbers):
            found = f"no {key}" if text is None else f"{key}='{text}'"
            yield f"<{element.tag}> with {found}", allowed.words


def plain_numbers(text: str) -> list[float]:
    """Return the numbers of a text as every reader of URDFs takes them; none if one of its words is something else."""
    words = text.split()
    return [float(word) for word in words] if all(_NUMBER.match(word) for word in words) else []
