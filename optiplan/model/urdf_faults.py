"""Faults of a URDF that its parser would pass over: it drops the part in question, which then is not checked at all."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator

SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}}
SIZES["capsule"] = SIZES["cylinder"]
"""Attributes of each shape, and how many numbers > 0 each has."""

MOVING = ("revolute", "continuous", "prismatic")

Fault = tuple[str, str, str]
"""Name of the link or joint, what was found, what is expected."""


def faults(root: ET.Element, joints: list[ET.Element]) -> Iterator[Fault]:
    """Every collision shape that cannot be read, every axis of length 0, every link with two parents."""
    for link in root.iter("link"):
        for collision in link.findall("collision"):
            fault = _shape_fault(collision.find("geometry"))
            if fault is not None:
                yield link.get("name", ""), *fault
    seen: set[str] = set()
    for joint in joints:
        child = joint.find("child")
        name = "" if child is None else child.get("link", "")
        if name in seen:
            yield name, "a link that is the child of two joints", "a tree: one parent for each link"
        seen.add(name)
        axis = joint.find("axis")
        if joint.get("type") in MOVING and axis is not None:
            numbers = _numbers(axis.get("xyz", "1 0 0"))
            if len(numbers) != 3 or not 1e-6 < math.hypot(*numbers) < 1e6:
                yield joint.get("name", ""), f"the axis '{axis.get('xyz')}'", "a direction: three numbers, not all 0"


def _shape_fault(geometry: ET.Element | None) -> tuple[str, str] | None:
    shapes = [] if geometry is None else [shape for shape in geometry if shape.tag in (*SIZES, "mesh")]
    if len(shapes) != 1:
        return f"a <collision> with {len(shapes)} shapes", f"one of: {', '.join(SIZES)}, mesh"
    shape = shapes[0]
    if shape.tag == "mesh":
        scale = shape.get("scale", "1 1 1")
        numbers = _numbers(scale)
        fits = len(numbers) == 3 and all(1e-9 < abs(x) < 1e9 for x in numbers)  # a mirrored mesh has one below 0
        return None if fits else (f"<mesh> with scale '{scale}'", "three numbers, none of them 0")
    for name, count in SIZES[shape.tag].items():
        numbers = _numbers(shape.get(name, ""))
        if len(numbers) != count or not all(0.0 < x < 1e6 for x in numbers):
            expected = "three numbers > 0" if count == 3 else "a number > 0"
            return f"<{shape.tag}> with {name} '{shape.get(name, '')}'", expected
    return None


def _numbers(text: str) -> list[float]:
    """The numbers of a text; none if one of them is no number."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []
