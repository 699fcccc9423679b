"""A URDF that is written: links and joints with names that nothing else has, shapes and the files of their meshes."""

import xml.etree.ElementTree as ET
from collections.abc import Hashable, Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import some
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.importers.robots.polyhedra import mesh_file, stl_bytes
from optiplan.robot.urdf.elements import joint_element, mark_capsule, number_words, origin_element, xml_text

FAR = 100.0
"""m; a slide without limits is given these, since a URDF has no endless ones."""

WORLD = "world"


class UrdfTree:
    """A URDF that grows by links and joints.

    Attributes:
        root: its <robot>.
    """

    def __init__(self, name: str, taken: Iterable[str]) -> None:
        """Begin a robot of this name; `taken` are the names that its links and joints have or will have."""
        self.root = ET.Element("robot", name=name)
        self._taken = set(taken)

    def link(self, name: str) -> ET.Element:
        """Add an empty link."""
        return ET.SubElement(self.root, "link", name=name)

    def joint(self, name: str, kind: str, links: tuple[str, str], X_PJ: pin.SE3) -> ET.Element:
        """Add a joint between two links, the parent first, at a pose in the parent's frame, m."""
        return joint_element(self.root, name, kind, links, X_PJ)

    def free(self, name: str) -> str:
        """Return a name that nothing has yet, taken now."""
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def text(self) -> str:
        """The whole file."""
        ET.indent(self.root)
        return xml_text(self.root)


def torques_without(named: Mapping[str, Sequence[str]]) -> list[str]:
    """Remarks on what a robot here is without, though its source states it: the names of joints by kind."""
    kinds = ((kind, some(joints, 6)) for kind, joints in named.items() if joints)
    return [f"left out, torques are without it: {kind} of {joints}" for kind, joints in kinds]


def moved(turns: bool, axis: Array, q: float) -> pin.SE3:
    """The motion of a joint: the turn about an axis by q rad, or the slide along it by q m."""
    if turns:
        return pin.SE3(pin.exp3(axis * q), np.zeros(3))
    return pin.SE3(np.eye(3), axis * q)


class MeshFiles:
    """STL files beside a URDF: `files` has their contents by relative path."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self._written: dict[Hashable, str] = {}

    def element(self, key: Hashable, name: str, vertices: Array, triangles: Triangles) -> ET.Element:
        """The <mesh> of vertices (k, 3), m, and triangles (m, 3); a key that was met has its file already."""
        if key not in self._written:
            self._written[key] = file = mesh_file(name, "meshes/{}.stl", self.files)
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
