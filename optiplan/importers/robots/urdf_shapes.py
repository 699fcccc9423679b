"""Shapes of a URDF that is written: visual and collision elements, and the files of their meshes."""

import xml.etree.ElementTree as ET
from collections.abc import Hashable

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.importers.robots.polyhedra import stl_bytes
from optiplan.robot.urdf.elements import mark_capsule, number_words, origin_element


class MeshFiles:
    """STL files beside a URDF: `files` has their contents by relative path."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self._written: dict[Hashable, str] = {}

    def element(self, key: Hashable, name: str, vertices: Array, triangles: Triangles) -> ET.Element:
        """The <mesh> of vertices (k, 3), m, and triangles (m, 3); a key that was met has its file already."""
        if key not in self._written:
            plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
            taken = set(self._written.values())
            file = next(f for k in range(len(taken) + 1) if (f := f"meshes/{plain}{k or ''}.stl") not in taken)
            self._written[key] = file
            self.files[file] = stl_bytes(vertices, triangles)
        return ET.Element("mesh", filename=self._written[key])


def add_shape(link: ET.Element, tag: str, X_LS: pin.SE3, shape: ET.Element, colour: Array | None = None) -> None:
    """Add one shape to a link; a capsule is a cylinder that `collision_checking` names, in a picture with two balls.

    Args:
        link: gets the element.
        tag: `visual` or `collision`.
        X_LS: pose of the shape in the link, m.
        shape: a <box>, <sphere>, <cylinder>, <capsule> or <mesh>.
        colour: red, green, blue, opacity (4,) in [0, 1]; None: no material.
    """
    element = ET.SubElement(link, tag)
    origin_element(element, X_LS)
    geometry = ET.SubElement(element, "geometry")
    if shape.tag != "capsule":
        geometry.append(shape)
    else:
        ET.SubElement(geometry, "cylinder", dict(shape.attrib))
    if colour is not None:
        material = ET.SubElement(element, "material", name="rgba_" + "_".join(f"{x:.3g}" for x in colour))
        ET.SubElement(material, "color", rgba=number_words(colour))
    if shape.tag == "capsule" and tag == "collision":
        name = f"{link.get('name')}_{len(link)}"
        element.set("name", name)
        mark_capsule(link, name)
    elif shape.tag == "capsule":
        half = 0.5 * float(shape.get("length", "0"))
        for end in (-half, half):
            ball = ET.Element("sphere", radius=shape.get("radius", "0"))
            add_shape(link, tag, X_LS * pin.SE3(np.eye(3), np.array([0.0, 0.0, end])), ball, colour)
