"""Groups, end effectors and passive joints of an SRDF, as the groups and tool frames of a robot.yaml."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import field
from pathlib import Path

from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass
from optiplan.robot.joint_groups import MOVABLE
from optiplan.robot.urdf.reader import UrdfSource, build_model


@dataclass
class SrdfGroups:
    """Joints (base to tip) and tool frame of each group, groups in the order of the file; remarks."""

    groups: dict[str, list[str]] = field(default_factory=dict)
    tools: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def read_groups(root: ET.Element, path: Path, urdf: UrdfSource) -> SrdfGroups:
    """Read the groups of an SRDF; a group without a joint that moves is left out with a remark.

    Args:
        root: of the SRDF.
        path: of its file, for messages.
        urdf: the robot's.

    Raises:
        InputError: a group names a joint, link or group that is not there.
    """
    return _Reader(root, path, urdf).read()


class _Reader:
    def __init__(self, root: ET.Element, path: Path, urdf: UrdfSource) -> None:
        self.root, self.path, self.urdf = root, path, urdf
        self.found = SrdfGroups()
        self.elements = {group.get("name", ""): group for group in root.findall("group")}
        self.parents = {child: parent for parent, child in urdf.edges}
        self.joint_of = {child: joint for joint, child in urdf.children.items()}
        self.passive = {joint.get("name", "") for joint in root.findall("passive_joint")}
        self.links = {*self.parents, *self.parents.values()}

    def read(self) -> SrdfGroups:
        movable = [
            str(name)
            for name in build_model(self.urdf).names
            if self.urdf.joint_types.get(name) in MOVABLE and name not in self.urdf.mimics
        ]
        for name in self.elements:
            joints = self._joints(name, ())
            planned = [joint for joint in movable if joint in joints and joint not in self.passive]
            if planned:
                self.found.groups[name] = planned
                tip = self._tip(name, ())
                if tip:
                    self.found.tools[name] = tip
            else:
                self.found.notes.append(f"left out: group {name}, which has no joint that moves by itself")
        if self.passive:
            self.found.notes.append(f"passive joints are not planned: {', '.join(sorted(self.passive))}")
        self._end_effectors()
        self._virtual_joints()
        return self.found

    def _joints(self, name: str, within: tuple[str, ...]) -> set[str]:
        """Names of all joints of a group, of the groups in it too."""
        self._known(name, self.elements, "group")
        if name in within:
            raise self._issue(f"group '{name}', which contains itself", "groups of other groups")
        joints: set[str] = set()
        for element in self.elements[name]:
            if element.tag == "joint":
                self._known(element.get("name", ""), self.urdf.joint_types, "joint", also=self._virtual())
                joints.add(element.get("name", ""))
            elif element.tag == "link":
                self._known(element.get("name", ""), self.links, "link")
                joints |= {self.joint_of[link] for link in [element.get("name", "")] if link in self.joint_of}
            elif element.tag == "chain":
                joints |= self._chain(element.get("base_link", ""), element.get("tip_link", ""))
            elif element.tag == "group":
                joints |= self._joints(element.get("name", ""), (*within, name))
        return joints

    def _chain(self, base: str, tip: str) -> set[str]:
        """The joints between two links: up from each to where the ways meet."""
        ways = []
        for link in (base, tip):
            self._known(link, self.links, "link")
            way = [link]
            while way[-1] in self.parents:
                way.append(self.parents[way[-1]])
            ways.append(way)
        return {self.joint_of[link] for way, other in (ways, ways[::-1]) for link in way if link not in other}

    def _tip(self, name: str, within: tuple[str, ...]) -> str:
        """The tip link of the last chain of a group, or of the first group in it that has one."""
        chains = [chain.get("tip_link", "") for chain in self.elements[name].findall("chain")]
        if chains:
            return self.urdf.renamed.get(chains[-1], chains[-1])
        inner = [group.get("name", "") for group in self.elements[name].findall("group")]
        tips = (self._tip(one, (*within, name)) for one in inner if one not in within)
        return next((tip for tip in tips if tip), "")

    def _end_effectors(self) -> None:
        for effector in self.root.findall("end_effector"):
            name, link = effector.get("name", ""), effector.get("parent_link", "")
            self._known(link, self.links, "link")
            parent = effector.get("parent_group") or next((g for g, tip in self.found.tools.items() if tip == link), "")
            if parent in self.found.groups:
                self.found.tools.setdefault(parent, self.urdf.renamed.get(link, link))
            told = f"end effector {name} ({effector.get('group', 'no group')}) is carried by {link}"
            self.found.notes.append(f"{told}; its joints are a group of their own, or stand still")

    def _virtual(self) -> Sequence[str]:
        return [joint.get("name", "") for joint in self.root.findall("virtual_joint")]

    def _virtual_joints(self) -> None:
        for joint in self.root.findall("virtual_joint"):
            kind = joint.get("type", "")
            if kind != "fixed":
                name = joint.get("name")
                self.found.notes.append(
                    f"left out: the {kind} virtual joint {name}; `base` of a problem places the robot"
                )
        for tag in ("disable_default_collisions", "enable_collisions", "link_sphere_approximation", "joint_property"):
            if self.root.find(tag) is not None:
                self.found.notes.append(f"left out: <{tag}> of {self.path.name}")

    def _known(self, name: str, known: Iterable[str], kind: str, also: Sequence[str] = ()) -> None:
        names = [*known, *also]
        if name not in names:
            raise self._issue(f"unknown {kind} '{name}'", choices(name, sorted(names)), name)

    def _issue(self, found: str, expected: str, name: str = "") -> InputError:
        from optiplan.robot.urdf.reader import element_error

        if name:
            line = element_error(self.path, name, found, expected).issues[0].line
            return InputError([Issue(str(self.path), line, "group", found, expected)])
        return InputError([Issue(str(self.path), None, "group", found, expected)])
