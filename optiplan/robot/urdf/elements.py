"""XML files that are read, and elements of a URDF that is written: poses, inertias, rows of numbers."""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.files import read_bytes


def parsed_xml(
    path: Path, kind: str, text: str | None = None, broken: Callable[[Path], None] = lambda path: None
) -> ET.Element:
    """Return the root of an XML file, or of the text in place of its own; `kind` is `urdf`, `srdf` or `sdf`.

    Raises:
        InputError: it cannot be read, or is no XML; then `broken` is called first, which may know better.
    """
    try:
        return ET.fromstring(read_bytes(path) if text is None else text.encode())
    except OSError as error:
        found = error.strerror or str(error)
        raise InputError([Issue(str(path), None, kind, found, f"a readable {kind.upper()} file")]) from error
    except (ET.ParseError, ValueError, LookupError) as error:
        broken(path)
        line = error.position[0] if isinstance(error, ET.ParseError) else None
        raise InputError([Issue(str(path), line, kind, str(error), "well-formed XML")]) from error


def xml_text(root: ET.Element) -> str:
    """An XML file of this root."""
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def number_words(values: Sequence[float] | Array) -> str:
    """Numbers as an attribute, each in full: reading them gives the same bits."""
    return " ".join(repr(float(value)) for value in values)


def origin_element(element: ET.Element, X: pin.SE3) -> None:
    """Add the <origin> of a pose X, lengths in m, angles in rad."""
    rpy = pin.rpy.matrixToRpy(X.rotation)
    ET.SubElement(element, "origin", xyz=number_words(X.translation), rpy=number_words(rpy))


def joint_element(root: ET.Element, name: str, kind: str, links: tuple[str, str], X_PJ: pin.SE3) -> ET.Element:
    """Add a joint between two links, the parent first, at a pose in the parent's frame, m."""
    element = ET.SubElement(root, "joint", name=name, type=kind)
    origin_element(element, X_PJ)
    ET.SubElement(element, "parent", link=links[0])
    ET.SubElement(element, "child", link=links[1])
    return element


def mark_capsule(link: ET.Element, name: str) -> None:
    """Mark the cylinder called `name` of a link as a capsule; pinocchio reads the first <collision_checking> only."""
    first = link.find("collision_checking")
    ET.SubElement(ET.SubElement(link, "collision_checking") if first is None else first, "capsule", name=name)


def inertial_element(link: ET.Element, inertia: pin.Inertia) -> None:
    """Add the <inertial> of a spatial inertia in the frame of the link: kg, m and kg·m² about the centre of mass."""
    element = ET.SubElement(link, "inertial")
    ET.SubElement(element, "origin", xyz=number_words(inertia.lever))
    ET.SubElement(element, "mass", value=repr(float(inertia.mass)))
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = np.asarray(inertia.inertia)[np.triu_indices(3)]
    ET.SubElement(element, "inertia", {name: repr(float(v)) for name, v in zip(names, values, strict=True)})
