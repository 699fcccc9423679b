"""A Denavit–Hartenberg table as a URDF: what the rest of OptiPlan reads, and what other programs can.

A URDF link sits in the frame *of its joint*, a standard table's frame beyond it. So a standard row becomes two links:
`NAME_joint_frame`, which the joint moves, and `NAME` fixed to it, the frame of the table, which carries all bodies.
Capsules, which URDF does not have, are written as cylinders that <collision_checking> names as capsules (pinocchio);
another reader sees the cylinders.
"""

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Document
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue
from optiplan.geometry.mass_properties import primitive_inertia
from optiplan.records import dataclass
from optiplan.robot.dh.spec import BodySpec, DhPoseSpec, DhRoundSpec, DhSpec, LinkSpec
from optiplan.robot.dh.table import DhTable, JointKind, along_x, along_z
from optiplan.robot.urdf.elements import (
    inertial_element,
    joint_element,
    mark_capsule,
    number_words,
    origin_element,
    xml_text,
)

PLACE: Place = ("dh",)


def urdf_text(name: str, spec: DhSpec, document: Document) -> str:
    """The URDF of a table.

    Raises:
        InputError: names that come twice, a parent that is not there, a mass without a body; with file, line and row.
    """
    issues = list(_name_issues(spec, document))
    if issues:
        raise InputError(issues)
    writer = _Writer(name, spec, document)
    writer.link(spec.base.name, spec.base, (*PLACE, "base"))
    joined = _before_and_after(spec)
    for index in joined[0]:
        writer.joined(index)
    writer.table(spec.parent or spec.base.name)
    for index in joined[1]:
        writer.joined(index)
    if writer.issues:
        raise InputError(writer.issues)
    ET.indent(writer.root)
    return xml_text(writer.root)


def _name_issues(spec: DhSpec, document: Document) -> Iterator[Issue]:
    named: list[tuple[Place, str]] = [((*PLACE, "base", "name"), spec.base.name)]
    named += [((*PLACE, "rows", i, "name"), name) for i, name in enumerate(spec.row_names())]
    named += [((*PLACE, "links", i, "name"), link.name) for i, link in enumerate(spec.links)]
    named += [((*PLACE, "rows", i, "joint_name"), name) for i, name in enumerate(joint_names(spec)) if name]
    named += [((*PLACE, "links", i, "joint_name"), link.joint_name or "") for i, link in enumerate(spec.links)]
    count = Counter(name for _, name in named if name)
    for place, name in named:
        if count[name] > 1:
            yield document.issue(place, f"the name '{name}', which comes {count[name]} times", "a name of its own")
    links = [spec.base.name, *spec.row_names(), *(link.name for link in spec.links)]
    parents: list[tuple[Place, str]] = [((*PLACE, "links", i, "parent"), x.parent) for i, x in enumerate(spec.links)]
    parents += [((*PLACE, "parent"), spec.parent)] if spec.parent else []
    for place, name in parents:
        if name not in links:
            yield document.issue(place, f"unknown link '{name}'", choices(name, links))
    if spec.parent in spec.row_names():
        yield document.issue((*PLACE, "parent"), f"'{spec.parent}', a row of the table itself", "another link")
    for i, link in enumerate(spec.links):
        if link.parent not in links[: len(links) - len(spec.links) + i] and link.parent in links:
            yield document.issue((*PLACE, "links", i, "parent"), f"'{link.parent}', which comes later", "a link above")


def joint_names(spec: DhSpec) -> list[str]:
    """Joint of each row: its own name, or joint_1, joint_2 … counting joints; empty for a fixed row."""
    names, count = [], 0
    for row in spec.rows:
        count += row.joint is not None
        names.append("" if row.joint is None else row.joint_name or f"joint_{count}")
    return names


def _before_and_after(spec: DhSpec) -> tuple[list[int], list[int]]:
    """Indices of the joined links that the table stands on or that hang on no row, and of the others."""
    rows, after = set(spec.row_names()), []
    for index, link in enumerate(spec.links):
        if link.parent in rows:
            rows.add(link.name)
            after.append(index)
    return [index for index in range(len(spec.links)) if index not in after], after


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of the URDF; `limits` in the unit of the table."""

    name: str
    kind: JointKind | None = None
    limits: list[float] | None = None
    axis: Sequence[float] = (0.0, 0.0, 1.0)


class _Writer:
    """Elements of one URDF; what cannot be written goes to `issues`."""

    def __init__(self, name: str, spec: DhSpec, document: Document) -> None:
        self.root = ET.Element("robot", name=name)
        self.spec, self.document = spec, document
        self.issues: list[Issue] = []

    def table(self, parent: str) -> None:
        """The links and joints of the rows."""
        table, joints = self.spec.table(), joint_names(self.spec)
        bodies = _default_bodies(self.spec)
        start = self._pose(self.spec)
        for i, (row, spec) in enumerate(zip(table.rows, self.spec.rows, strict=True)):
            x, z = along_x(row.a, row.alpha), along_z(np.array([row.d]), np.array([row.theta]))[0]
            before, after = (start @ z, x) if table.convention == "standard" else (start @ x @ z, np.eye(4))
            name = joints[i] or f"{row.name}_fixed"
            if row.joint is None or np.array_equal(after, np.eye(4)):
                self._joint(UrdfJoint(name, row.joint, spec.limits), (parent, row.name), before @ after)
            else:
                middle = f"{row.name}_joint_frame"
                ET.SubElement(self.root, "link", name=middle)
                self._joint(UrdfJoint(name, row.joint, spec.limits), (parent, middle), before)
                self._joint(UrdfJoint(f"{row.name}_fixed"), (middle, row.name), after)
            geometry = bodies[i] if spec.geometry is None else spec.geometry
            self.link(row.name, spec.model_copy(update={"geometry": geometry}), (*PLACE, "rows", i))
            parent, start = row.name, np.eye(4)

    def joined(self, index: int) -> None:
        """A link beside the table and its joint."""
        spec = self.spec.links[index]
        joint = UrdfJoint(spec.joint_name or f"{spec.name}_joint", spec.joint, spec.limits, spec.axis)
        self._joint(joint, (spec.parent, spec.name), self._pose(spec))
        self.link(spec.name, spec, (*PLACE, "links", index))

    def link(self, name: str, spec: LinkSpec, place: Place) -> None:
        """One link with its bodies, for collision and for view, and its inertia."""
        link = ET.SubElement(self.root, "link", name=name)
        if spec.mass is not None:
            if spec.inertia is None and spec.mass > 0 and not sum(_volumes(spec)) > 0:
                lacks = "whose bodies enclose no volume" if spec.geometry else "without a body"
                found = f"a mass of {spec.mass:g} kg {lacks}"
                self.issues.append(self.document.issue((*place, "mass"), found, "geometry, or centre and inertia"))
            else:
                inertial_element(link, _inertia_of(spec, self.spec))
        for i, body in enumerate(spec.geometry or ()):
            self._body(link, body, f"{name}_{i}")

    def _body(self, link: ET.Element, body: BodySpec, name: str) -> None:
        X_LB = _body_pose(body, self.spec)
        for kind in ("visual", "collision"):
            element = ET.SubElement(link, kind)
            origin_element(element, X_LB)
            geometry = ET.SubElement(element, "geometry")
            if body.box is not None:
                ET.SubElement(geometry, "box", size=number_words(body.box))
            elif body.sphere is not None:
                ET.SubElement(geometry, "sphere", radius=repr(body.sphere))
            else:
                round_ = body.cylinder or body.capsule
                assert round_ is not None  # the schema holds exactly one shape
                ET.SubElement(geometry, "cylinder", radius=repr(round_.radius), length=repr(round_.length))
        if body.capsule is not None:
            element.set("name", name)
            mark_capsule(link, name)
            for end in (-0.5, 0.5):
                cap = ET.SubElement(link, "visual")
                origin_element(cap, X_LB * pin.SE3(np.eye(3), np.array([0.0, 0.0, end * body.capsule.length])))
                ET.SubElement(ET.SubElement(cap, "geometry"), "sphere", radius=repr(body.capsule.radius))

    def _pose(self, spec: DhPoseSpec) -> Array:
        pose: Array = _body_pose(spec, self.spec).homogeneous
        return pose

    def _joint(self, joint: UrdfJoint, links: tuple[str, str], X_PJ: Array) -> None:
        endless = joint.kind == "revolute" and joint.limits is None
        kind = "continuous" if endless else joint.kind or "fixed"
        element = joint_element(self.root, joint.name, kind, links, pin.SE3(X_PJ))
        if joint.kind is None:
            return
        ET.SubElement(element, "axis", xyz=number_words(joint.axis))
        limit = ET.SubElement(element, "limit", effort="0", velocity="0")
        if joint.limits is not None:
            turn = self.spec.angle if joint.kind == "revolute" else float
            limit.set("lower", repr(turn(joint.limits[0])))
            limit.set("upper", repr(turn(joint.limits[1])))


def _body_pose(body: DhPoseSpec, spec: DhSpec) -> pin.SE3:
    """Pose X_LB of a body in its link."""
    return pin.SE3(pin.rpy.rpyToMatrix(*spec.rotation(body)), np.array(body.position))


def _default_bodies(spec: DhSpec) -> list[list[BodySpec]]:
    """Capsules of the radius of the table along the offsets that each link spans; none without a radius.

    In the frame of the row. Standard: the row's a lies before its frame, from (-a, 0, 0) to 0, and its d before that,
    against the z axis of the frame before: (0, sin alpha, cos alpha). Modified: the row's d lies before its frame,
    along z, and the a of the *next* row after it, along x. A prismatic joint's d is left out where the row's link does
    not carry it.
    """
    if spec.radius is None:
        return [[] for _ in spec.rows]
    turn = math.degrees if spec.unit == "deg" else float
    return [[_capsule(a, b, spec.radius, turn) for a, b in found] for found in _segments(spec.table())]


def _segments(table: DhTable) -> list[list[tuple[Array, Array]]]:
    origin, result = np.zeros(3), []
    for i, row in enumerate(table.rows):
        if table.convention == "standard":
            corner = np.array([-row.a, 0.0, 0.0])
            found = [(corner, origin)]
            back = row.d * np.array([0.0, math.sin(row.alpha), math.cos(row.alpha)])
            if row.joint != "prismatic":
                found.append((corner - back, corner))
        else:
            after = table.rows[i + 1].a if i + 1 < len(table.rows) else 0.0
            found = [(np.array([0.0, 0.0, -row.d]), origin), (origin, np.array([after, 0.0, 0.0]))]
        result.append([(a, b) for a, b in found if not np.array_equal(a, b)])
    return result


def _capsule(start: Array, end: Array, radius: float, turn: Callable[[float], float]) -> BodySpec:
    """The capsule between two points; `turn` makes the unit of the table from rad."""
    length = float(np.linalg.norm(end - start))
    x, y, z = (end - start) / length
    rpy = [0.0, math.acos(max(-1.0, min(1.0, z))), math.atan2(y, x)]  # Rz(yaw) Ry(pitch) takes z to the direction
    position = [float(value) for value in (start + end) / 2]
    capsule = DhRoundSpec(radius=radius, length=length)
    return BodySpec(capsule=capsule, position=position, rpy=[turn(angle) for angle in rpy])


def _inertia_of(link: LinkSpec, spec: DhSpec) -> pin.Inertia:
    """Spatial inertia of a link in its frame: as stated, else its bodies filled evenly.

    I = Σ_b (m V_b / Σ V) Î_b with Î_b the inertia of body b for 1 kg; bodies that overlap count twice there.
    A link of mass 0 has none.
    """
    mass = link.mass or 0.0
    if link.centre is not None and link.inertia is not None:
        return pin.Inertia(mass, np.array(link.centre), np.diag(link.inertia))
    total, volumes = pin.Inertia.Zero(), _volumes(link)
    if not mass:
        return total
    for body, volume in zip(link.geometry or (), volumes, strict=True):
        own = primitive_inertia(*_primitive(body), mass * volume / sum(volumes))
        total = total + _body_pose(body, spec).act(own)
    return total


def _volumes(link: LinkSpec) -> list[float]:
    """Volumes of the bodies of a link, m³; of tiny ones they underflow to 0."""
    return [primitive_inertia(*_primitive(body)).mass for body in link.geometry or ()]


def _primitive(body: BodySpec) -> tuple[str, Sequence[float]]:
    """Return the kind and the sizes of a body, as `primitive_inertia` takes them."""
    if body.box is not None:
        return "box", body.box
    if body.sphere is not None:
        return "sphere", [body.sphere]
    if body.cylinder is not None:
        return "cylinder", [body.cylinder.radius, body.cylinder.length]
    assert body.capsule is not None  # the schema holds exactly one shape
    return "capsule", [body.capsule.radius, body.capsule.length]
