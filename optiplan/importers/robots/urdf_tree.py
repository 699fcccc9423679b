"""Links and joints of a URDF that is written, with names that nothing else has."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import some
from optiplan.robot.urdf.elements import origin_element, xml_text

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
        element = ET.SubElement(self.root, "joint", name=name, type=kind)
        origin_element(element, X_PJ)
        ET.SubElement(element, "parent", link=links[0])
        ET.SubElement(element, "child", link=links[1])
        return element

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
