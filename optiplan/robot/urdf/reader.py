"""URDF files, also messy ones, to pinocchio models.

The XML is normalised before pinocchio reads it. Mesh paths become absolute, and visuals without a file are dropped.
Continuous joints become revolute ones without limits, so that nq = nv.
"""

import logging
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from optiplan.config.messages import some
from optiplan.errors import InputError, Issue, plain_reason
from optiplan.files import is_file, is_folder, read_bytes
from optiplan.records import dataclass
from optiplan.robot.mimic_joints import Mimic, MimicError, leaders_first, resolve
from optiplan.robot.reference import DESCRIPTION
from optiplan.robot.urdf.elements import parsed_xml, xml_text
from optiplan.robot.urdf.mesh_geometries import UrdfBodies, read_bodies
from optiplan.robot.urdf.ros_packages import RosPackages
from optiplan.robot.urdf.unused_elements import leave_out
from optiplan.robot.urdf.validation import MOVING, faults, odd_inertias, odd_turns

log = logging.getLogger(__name__)

ENDLESS = 1e31
"""Stands for infinity in the XML of `continuous` joints; replaced by inf in the pinocchio model.

More than a file may say (`validation`), so that no other joint has it.
"""


@dataclass(frozen=True)
class UrdfSource:
    """A URDF put in order; `renamed` holds the new names of links that shared theirs with a joint.

    `mimics` are the joints that follow another one in the end.
    """

    path: Path
    xml: str
    renamed: Mapping[str, str]
    joint_types: Mapping[str, str]
    mimics: Mapping[str, Mimic]
    edges: tuple[tuple[str, str], ...]
    meshes: tuple[Path, ...]
    notes: tuple[str, ...]

    @cached_property
    def children(self) -> dict[str, str]:
        """The link behind every joint, by the joint's name."""
        return {joint: child for joint, (_, child) in zip(self.joint_types, self.edges, strict=True)}

    @cached_property
    def _joints(self) -> dict[str, ET.Element]:
        joints = ET.fromstring(self.xml).findall("joint")
        return {joint.get("name", ""): joint for joint in joints if joint.find("parent") is not None}

    def limit(self, joint: str, *keys: str) -> float:
        """The smallest of these limits that the <limit> of a joint states; 0 where it states none."""
        stated = [float(limit.get(key, "0")) for limit in self._joints[joint].findall("limit") for key in keys]
        return min((value for value in stated if value > 0.0), default=0.0)

    def mimics_beside(self, locked: Container[str]) -> dict[str, Mimic]:
        """The joints that follow another one where some are locked: what follows a locked joint has it as its leader.

        Raises:
            InputError: a multiplier out of its range.
        """
        joints = [self._joints[name] for name in self.joint_types if name not in locked]
        return _mimics(joints, self.joint_types, self.path)

    def fixed_to(self, joint: str) -> str | None:
        """The link in front of a fixed joint; None for one that moves."""
        if self.joint_types[joint] != "fixed":
            return None
        return dict(zip(self.joint_types, (parent for parent, _ in self.edges), strict=True))[joint]

    def error(self, name: str, found: str, expected: str) -> InputError:
        """An `InputError` about the element called `name`."""
        return element_error(self.path, name, found, expected)


def element_error(path: Path, name: str, found: str, expected: str) -> InputError:
    """An `InputError` about the element called `name` of an XML file, with the line where it stands.

    That is a link or a joint of that name, else the first element that has it. A robot inline in a problem has no file;
    its URDF is made of its key `dh`.
    """
    if path.name == DESCRIPTION:
        return InputError([Issue(str(path), None, "dh", f"{name}: {found}", expected, ("dh",))])
    text = read_bytes(path).decode("utf-8", errors="replace")
    called = rf"\bname\s*=\s*[\"']{re.escape(name)}[\"']"
    match = re.search(rf"<(?:link|joint)\b[^>]*?{called}", text) or re.search(called, text)
    line = None if match is None else text.count("\n", 0, match.start()) + 1
    return InputError([Issue(str(path), line, name, found, expected)])


def read_urdf(path: Path, folder: Path, text: str | None = None) -> UrdfSource:
    """Read a URDF whose meshes are looked for from its own folder and from `folder`, that of the robot.yaml.

    Args:
        path: the URDF, or the file that `text` was made from.
        folder: where meshes are looked for too.
        text: the URDF itself, where it stands in no file.

    Raises:
        InputError: no URDF, or one that cannot be planned with; names link or joint and what was tried.
    """
    root = _parse(path, text)
    if text is None:
        _refuse_xacro(path, root)
    notes: list[str] = []
    finder = _MeshFinder(path, folder)
    joints = [joint for joint in root.findall("joint") if joint.find("parent") is not None]
    issues = [element_error(path, *fault).issues[0] for fault in faults(root, joints)]
    if issues:
        raise InputError(issues)
    notes += (*odd_inertias(root), *odd_turns(joints))
    notes += leave_out(root, joints)
    for link in root.findall("link"):
        _settle_visuals(link, finder, notes)
        _settle_collisions(link, finder)
    notes += finder.notes
    renamed = _rename_links(root, joints)
    notes += [f"link {old} is called {new}, since a joint is called {old} too" for old, new in renamed.items()]
    types = {joint.get("name", ""): joint.get("type", "") for joint in joints}
    mimics = _mimics(joints, types, path)
    for joint in joints:
        _settle_joint(joint, path)
    xml = ET.tostring(root, encoding="unicode")
    meshes, remarks = tuple(finder.collision), tuple(notes)
    return UrdfSource(path, xml, renamed, types, mimics, _edges(joints), meshes, remarks)


def with_found_meshes(path: Path, folder: Path, text: str) -> tuple[str, tuple[str, ...]]:
    """Return a URDF with the absolute paths of its meshes, and notes on packages that were not found.

    Meshes are looked for as by `read_urdf`; those that are missing stay as they are.
    """
    root = _parse(path, text)
    finder = _MeshFinder(path, folder)
    for mesh in root.iter("mesh"):
        found = finder.find(mesh.get("filename", ""))
        if found is not None:
            mesh.set("filename", str(found.resolve()))
    return xml_text(root), tuple(finder.notes)


def build_model(source: UrdfSource) -> pin.Model:
    """Pinocchio model of the whole robot; joints that turn without end have infinite position limits.

    Raises:
        InputError: with the reason of the URDF parser.
    """
    try:
        model = pin.buildModelFromXML(source.xml)
    except (ValueError, RuntimeError) as error:
        raise _unreadable(source, error, "a URDF that pinocchio can read") from error
    model.lowerPositionLimit = np.where(model.lowerPositionLimit <= -ENDLESS, -np.inf, model.lowerPositionLimit)
    model.upperPositionLimit = np.where(model.upperPositionLimit >= ENDLESS, np.inf, model.upperPositionLimit)
    return leaders_first(model, source.mimics)


def read_collisions(source: UrdfSource, model: pin.Model) -> UrdfBodies:
    """Collision bodies of the whole robot.

    Raises:
        InputError: with the reason of the mesh reader.
    """
    try:
        bodies = read_bodies(model, source.xml, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise _unreadable(source, error, "collision meshes that can be read") from error
    given = [capsule for link in ET.fromstring(source.xml).findall("link") for capsule in _are_capsules(link)]
    read = [isinstance(body.geometry, coal.Capsule) for body in bodies.geometry.geometryObjects]
    for kind, stated, found in (("shapes", len(given), len(read)), ("capsules", sum(given), sum(read))):
        if found != stated:  # what the parser drops would never be checked
            words = f"{stated} collision {kind}, of which the parser could read {found} (see its messages above)"
            raise InputError([Issue(str(source.path), None, "urdf", words, "shapes and origins of plain numbers")])
    return bodies


def _are_capsules(link: ET.Element) -> Iterator[bool]:
    """Yield whether each shape of a link is a capsule, or a cylinder that the link marks as one."""
    marked = _capsules(link)
    for collision in link.findall("collision"):
        cylinder = collision.find("geometry/cylinder") is not None
        yield (cylinder and collision.get("name") in marked) or collision.find("geometry/capsule") is not None


def build_visuals(source: UrdfSource, model: pin.Model) -> pin.GeometryModel:
    """Visual geometry of the whole robot; the collision geometry where that cannot be read."""
    try:
        return read_bodies(model, source.xml, pin.GeometryType.VISUAL).with_meshes()
    except (ValueError, RuntimeError) as error:
        log.warning("%s: visual meshes cannot be read, collision shapes are shown: %s", source.path, error)
        return read_collisions(source, model).with_meshes()


def _unreadable(source: UrdfSource, error: Exception, expected: str) -> InputError:
    return InputError([Issue(str(source.path), None, "urdf", plain_reason(error), expected)])


def _parse(path: Path, text: str | None) -> ET.Element:
    root = parsed_xml(path, "urdf", text, broken=_refuse_xacro)
    if root.tag != "robot":
        raise InputError([Issue(str(path), 1, "urdf", f"an XML file of <{root.tag}>", "a URDF, whose root is <robot>")])
    return root


def _refuse_xacro(path: Path, root: ET.Element | None = None) -> None:
    """Raise an `InputError` for a file of macros, which another program turns into a URDF."""
    tags = () if root is None else (str(element.tag) for element in root.iter())
    if path.suffix == ".xacro" or any(tag.startswith("{") and "xacro" in tag for tag in tags):
        command = f"`optiplan robots init {path.name}` expands it"
        raise InputError([Issue(str(path), None, "urdf", "this is xacro", f"a URDF; {command}")])


class _MeshFinder:
    def __init__(self, urdf: Path, folder: Path) -> None:
        self.urdf = urdf
        self.collision: list[Path] = []
        self.notes: list[str] = []
        self._packages = RosPackages(urdf.parent, folder)

    def find(self, name: str) -> Path | None:
        """Return the first file of the candidates; a note says where a package is not found, or not near."""
        package, inside = _in_package(name)
        found, guess = (next(filter(is_file, paths), None) for paths in (self._stated(name), self._guesses(name)))
        if found is not None and inside:
            self._note_copies(package, inside, found)
        if guess is None or (found is None and self._packages.find(package) is not None):
            return found
        folder, near = (Path(str(path).removesuffix(inside)) for path in (found or guess, guess))
        note = f"meshes of package {package} are read from {folder}, not from {near}"
        if found is None:
            note = f"package {package} is not found; its meshes are read from {near}"
        elif {folder, folder.parent} & {*self._packages.roots}:
            return found
        self._note(note)
        return found or guess

    def _note_copies(self, package: str, inside: str, found: Path) -> None:
        copies = self._packages.copies(package, inside)
        if others := [str(folder) for folder in copies if folder / inside != found]:
            taken = str(found).removesuffix(inside)
            self._note(f"meshes of package {package} are read from {Path(taken)}, not from {some(others)}")

    def _note(self, note: str) -> None:
        self.notes += [note] if note not in self.notes else []

    def candidates(self, name: str) -> list[Path]:
        """Return where `find` looks, with the usual folders that there are not."""
        package, inside = _in_package(name)
        known = not inside or self._packages.find(package) is not None
        usual = [] if known else [*(root / package / inside for root in self._packages.roots), *self._guesses(name)]
        return list(dict.fromkeys([*self._stated(name), *usual]))

    def _stated(self, name: str) -> Iterator[Path]:
        """Yield where the file may be, the likeliest first."""
        package, inside = _in_package(name)
        path = Path(name.removeprefix("file://"))
        if package:
            yield from (folder / inside for folder in self._packages.folders(package))
        else:
            yield from [path] if path.is_absolute() else [root / path for root in self._packages.roots]

    def _guesses(self, name: str) -> list[Path]:
        """Return where the file of a package that is not found may be: in folders that are no other package."""
        package, inside = _in_package(name)
        roots = self._packages.roots if inside else []
        return [root / inside for root in roots if self._packages.name_of(root) in ("", package)]


def _in_package(name: str) -> tuple[str, str]:
    """Return the package of a mesh and its path there; both are empty where it names none."""
    scheme, separator, rest = name.partition("://")
    package, _, inside = rest.lstrip("/").partition("/")  # package:///NAME/… is written, too
    return (package, inside) if separator and scheme != "file" else ("", "")


def _settle_visuals(link: ET.Element, finder: _MeshFinder, notes: list[str]) -> None:
    for visual in link.findall("visual"):
        for mesh in visual.iter("mesh"):
            found = finder.find(mesh.get("filename", ""))
            if found is None:
                link.remove(visual)
                notes.append(f"link {link.get('name')}: visual mesh {mesh.get('filename')} is missing, not shown")
                break
            mesh.set("filename", str(found))


def _capsules(link: ET.Element) -> set[str]:
    """Names of the cylinders of a link that are capsules."""
    return {capsule.get("name", "") for capsule in link.iterfind("collision_checking/capsule")}


def _settle_collisions(link: ET.Element, finder: _MeshFinder) -> None:
    marks = link.findall("collision_checking")
    for mark in marks[1:]:  # pinocchio reads the first only, and takes the capsules of others for cylinders
        marks[0].extend(list(mark))
        link.remove(mark)
    marked = _capsules(link)
    for collision in link.findall("collision"):
        if collision.get("name") not in marked:  # names come twice in messy files; pinocchio makes its own
            collision.attrib.pop("name", None)
        for mesh in collision.iter("mesh"):
            name = mesh.get("filename", "")
            found = finder.find(name)
            if found is None:
                tried = finder.candidates(name)
                message = f"collision mesh {name}, which is missing (tried {', '.join(map(str, tried)) or 'nothing'})"
                near = next(filter(None, map(_but_for_capitals, tried)), None)
                expected = "a mesh file" if near is None else f"a mesh file, such as {near}, whose capitals differ"
                raise element_error(finder.urdf, link.get("name", ""), message, expected)
            finder.collision.append(found)
            mesh.set("filename", str(found))


def _but_for_capitals(path: Path) -> Path | None:
    """Return the file whose path is this one but for capital letters: on Windows that is no difference."""
    here = Path(path.anchor)
    for part in Path(os.path.normpath(path)).parts[1:]:
        names: list[str] = []
        with suppress(OSError):  # a folder that may not be read
            names = os.listdir(here) if is_folder(here) else []
        alike = part if part in names else next((name for name in names if name.lower() == part.lower()), None)
        if alike is None:
            return None
        here /= alike
    return here


def _rename_links(root: ET.Element, joints: list[ET.Element]) -> dict[str, str]:
    """Give links another name that share theirs with a joint: pinocchio cannot tell such frames apart."""
    links = {link.get("name", ""): link for link in root.findall("link")}
    taken = {*links, *(joint.get("name", "") for joint in joints)}
    renamed: dict[str, str] = {}
    for name in (joint.get("name", "") for joint in joints):
        if name in links:
            renamed[name] = next(new for count in range(1, 99) if (new := name + "_link" * count) not in taken)
            links[name].set("name", renamed[name])
            taken.add(renamed[name])
    for end in (end for joint in joints for end in (joint.find("parent"), joint.find("child")) if end is not None):
        end.set("link", renamed.get(end.get("link", ""), end.get("link", "")))
    return renamed


def _edges(joints: list[ET.Element]) -> tuple[tuple[str, str], ...]:
    ends = [(joint.find("parent"), joint.find("child")) for joint in joints]
    return tuple((a.get("link", ""), b.get("link", "")) for a, b in ends if a is not None and b is not None)


def stated_mimics(joints: Iterable[ET.Element]) -> dict[str, Mimic]:
    """What the <mimic> of joints states, by the name of the joint that has one."""
    return {
        joint.get("name", ""): Mimic(
            mimic.get("joint", ""), float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
        )
        for joint in joints
        for mimic in joint.findall("mimic")
    }


def _mimics(joints: list[ET.Element], types: Mapping[str, str], path: Path) -> dict[str, Mimic]:
    """The joints that follow another, and which one that is in the end."""
    movable = [name for name, kind in types.items() if kind in MOVING]
    try:
        return resolve(stated_mimics(joints), movable)
    except MimicError as error:
        raise element_error(path, error.joint, error.found, error.expected) from error


def _settle_joint(joint: ET.Element, path: Path) -> None:
    name, kind = joint.get("name", ""), joint.get("type", "")
    limit = joint.find("limit")
    if kind == "continuous":
        joint.set("type", "revolute")
        limit = ET.SubElement(joint, "limit") if limit is None else limit
        limit.set("lower", str(-ENDLESS))
        limit.set("upper", str(ENDLESS))
    elif kind in ("revolute", "prismatic") and limit is None:
        raise element_error(path, name, f"a {kind} joint without <limit>", "its limits")
    if limit is not None:
        for key in ("effort", "velocity"):
            limit.set(key, limit.get(key) or "0")
