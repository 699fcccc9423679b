"""Read the parts of a robot from its files: the robot.yaml, its URDF or table, SRDF and meshes."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from optiplan import cache
from optiplan.arrays import Array, read_only
from optiplan.config.document import Document, read_yaml, validate
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError
from optiplan.files import bound, read_bytes
from optiplan.records import dataclass
from optiplan.robot.description_files import read_sources
from optiplan.robot.given_configurations import wrong_names
from optiplan.robot.joint_groups import Group, Reduced, mecanum_base, planned_joints, reduce_to
from optiplan.robot.limits import Limits, build_limits
from optiplan.robot.link_geometry import LinkGeometry, treat
from optiplan.robot.mimic_joints import Mimic, turning
from optiplan.robot.reference import DESCRIPTION, UNKNOWN, Reference, description, inline_content, referred, robot_file
from optiplan.robot.self_collision.pairs import Locked, declared_pairs, set_pairs, unchecked_pairs
from optiplan.robot.spec import MecanumSpec, RobotSpec
from optiplan.robot.urdf.reader import UrdfSource
from optiplan.robot.urdf.srdf import LinkPair, Srdf

if TYPE_CHECKING:
    from optiplan.robot.dh.table import DhTable


_TOOL = re.compile(
    r"(^|_)(tcp|tool0|grasp(ing)?(_frame|_link)?|end_effector|eef?|attachment|pinch)($|_)", re.IGNORECASE
)
"""Common names of tool frames."""


@dataclass(frozen=True, eq=False, repr=False)
class RobotParts:
    """The parts of a robot from its files; `Robot` documents each."""

    name: str
    source: Path
    model: pin.Model
    geometry: pin.GeometryModel
    limits: Limits
    joint_names: tuple[str, ...]
    tool_frame: str
    configurations: Mapping[str, Array]
    link_geometry: Mapping[str, str]
    build_visual: Callable[[], pin.GeometryModel]
    notes: tuple[str, ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    allowed: Mapping[LinkPair, str] = field(default_factory=dict)
    files: tuple[Path, ...] = ()
    fingerprint: str = ""
    dh: "DhTable | None" = None
    group: str | None = None
    groups: Mapping[str, Sequence[str]] = field(default_factory=dict)
    tool_frames: Mapping[str, str] = field(default_factory=dict)
    urdf: str = ""
    followers: Mapping[str, Mimic] = field(default_factory=dict)
    over_cover: Mapping[str, float] = field(default_factory=dict)
    mecanum: MecanumSpec | None = None
    reference: Reference = UNKNOWN

    def __post_init__(self) -> None:
        copies = {name: read_only(np.array(q)) for name, q in self.configurations.items()}
        object.__setattr__(self, "configurations", copies)


def read_robot(
    ref: str | Mapping[str, Any], base: Path | None, locked: Mapping[str, float] | None, group: str | None
) -> RobotParts:
    """Read the files of a robot; see `load_robot`."""
    document = description(ref, base) if isinstance(ref, Mapping) else read_yaml(robot_file(ref, base).resolve())
    spec = validate(RobotSpec, document)
    urdf, srdf, srdf_path = read_sources(spec, document)
    planned = planned_joints(spec, document, urdf, group)
    reduced = reduce_to(planned.joints, _wanted(spec, planned, locked or {}), urdf, document)
    limits, limit_notes = build_limits(spec.limits, document, urdf, reduced, planned)
    treated = _bodies(reduced, spec, document)
    tool, chosen = _tool_frame(spec, document, reduced, urdf, planned)
    read = (document.path, urdf.path, srdf_path, *urdf.meshes)
    files = tuple(dict.fromkeys(path for path in read if path is not None and path.name != DESCRIPTION))
    declared = declared_pairs(spec, document, reduced.model, srdf)
    bodies = {str(reduced.model.frames[body.parentFrame].name) for body in treated.geometry.geometryObjects}
    locked_joints = Locked(urdf, reduced.locked, bodies) if srdf is None else None
    allowed, pair_notes = unchecked_pairs(
        reduced.model, treated.geometry, (limits.lower, limits.upper), declared, locked_joints
    )
    set_pairs(reduced.model, treated.geometry, allowed)
    srdf_notes = () if srdf is None else srdf.notes
    return RobotParts(
        name=spec.name,
        source=document.path,
        model=reduced.model,
        geometry=treated.geometry,
        limits=limits,
        joint_names=planned.joints,
        tool_frame=tool,
        configurations=_configurations(spec, document, srdf, planned, reduced.model),
        link_geometry=treated.kinds,
        over_cover=treated.over_cover,
        build_visual=bound(reduced.build_visual),
        notes=(*chosen, *urdf.notes, *srdf_notes, *reduced.notes, *limit_notes, *treated.notes, *pair_notes),
        locked=reduced.locked,
        allowed=allowed,
        files=files,
        fingerprint=cache.digest([*map(read_bytes, files), *inline_content(document, ref)]),
        dh=None if spec.dh is None else spec.dh.table(),
        group=planned.name,
        groups=spec.groups,
        tool_frames=spec.tool_frames,
        urdf=urdf.xml,
        followers=reduced.followers,
        mecanum=mecanum_base(spec, document, planned.joints, urdf),
        reference=Reference(referred(document, ref), group, dict(locked or {}), tool),
    )


def _wanted(spec: RobotSpec, planned: Group, locked: Mapping[str, float]) -> dict[str, float]:
    """Return the positions of locked joints; with several groups, `locked` may include joints of another group."""
    own = {joint: q for joint, q in spec.locked.items() if not (spec.groups and joint in planned.joints)}
    return {**own, **locked}


def _bodies(reduced: Reduced, spec: RobotSpec, document: Document) -> LinkGeometry:
    """Return the collision geometry of the robot.yaml; a robot without any needs `collision: none`."""
    if spec.collision == "none":
        return LinkGeometry(notes=["collision: none: the robot has no bodies, and no contact of it is checked"])
    if not reduced.bodies.geometry.ngeoms:
        found = "a robot without any collision geometry"
        bodies = "bodies for at least one link, such as what its <visual> has as <collision>"
        expected = f"{bodies}, or `collision: none` to have limits checked and no contact"
        raise InputError([document.issue(("urdf",) if spec.dh is None else ("dh",), found, expected)])
    return treat(reduced.model, reduced.bodies, spec.collision, document)


def _tool_frame(
    spec: RobotSpec, document: Document, reduced: Reduced, urdf: UrdfSource, group: Group
) -> tuple[str, list[str]]:
    """Return the group's frame in `tool_frames`, else `tool_frame`, else a link at the end of the last planned joint.

    Returns:
        The frame, and notes on the joints and the frame chosen because the robot.yaml names none.

    Raises:
        InputError: an unknown frame or group.
    """
    frames = [frame.name for frame in reduced.model.frames]
    named: list[tuple[Place, str]] = [(("tool_frames", key), frame) for key, frame in spec.tool_frames.items()]
    named += [] if spec.tool_frame is None else [(("tool_frame",), spec.tool_frame)]
    wrong = [(place, frame) for place, frame in named if frame not in frames]
    issues = [document.issue(place, f"unknown frame '{frame}'", choices(frame, frames)) for place, frame in wrong]
    for key in (key for key in spec.tool_frames if key not in spec.groups):
        issues.append(document.issue(("tool_frames", key), f"unknown group '{key}'", choices(key, list(spec.groups))))
    if issues:
        raise InputError(issues)
    frame = spec.tool_frames.get((group.name or "").partition("+")[0], spec.tool_frame)
    notes = []
    if group.chosen:
        notes.append(f"no group is given: planned is the longest chain of joints, {', '.join(group.joints)}")
    if frame is None:
        frame = _last_link(reduced.model, urdf, group.joints[-1])
        notes.append(f"no tool frame is given: {frame}, at the end of {group.joints[-1]}, is taken")
    return frame, notes


def _last_link(model: pin.Model, urdf: UrdfSource, joint: str) -> str:
    joined = [urdf.children[joint]]
    for link in joined:
        joined += [child for name, child in urdf.children.items() if urdf.fixed_to(name) == link]
    moved = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY and frame.name in joined]
    named = [name for name in moved if _TOOL.search(name)]
    return str((named or moved)[-1])


def _configurations(
    spec: RobotSpec, document: Document, srdf: Srdf | None, group: Group, model: pin.Model
) -> dict[str, Array]:
    """Return the named configurations, each (n,): of the robot.yaml, then further ones of the SRDF.

    Raises:
        InputError: a list of another length, an unknown joint, a joint without a value, or a name that is there twice.
    """
    own = np.array([model.getJointId(joint) - 1 for joint in group.joints])
    turns = turning(model)[own]
    result: dict[str, Array] = {}
    issues = []
    stated: list[tuple[Place, Any]] = [(("configurations", name), given) for name, given in spec.configurations.items()]
    stated += [(("configurations_deg", name), given) for name, given in spec.configurations_deg.items()]
    for place, given in stated:
        name = str(place[1])
        if name in result:
            issues.append(document.issue(place, f"'{name}', which is in `configurations` too", "a name of its own"))
        if isinstance(given, dict):
            wrong = wrong_names(group.listed, given)
            issues += [document.issue(place if j is None else (*place, j), found, so) for j, found, so in wrong]
            if not wrong:
                result[name] = np.array([given[joint] for joint in group.joints], float)
        elif len(given) == len(group.listed):
            result[name] = group.pick(given)
        else:
            found, expected = f"a list of {len(given)} values", f"{len(group.listed)}, one a planned joint"
            issues.append(document.issue(place, found, expected))
        if name in result and place[0] == "configurations_deg":
            result[name] = np.where(turns, np.deg2rad(result[name]), result[name])
    if issues:
        raise InputError(issues)
    for name, values in () if srdf is None else srdf.states:
        if set(group.joints) <= set(values):
            result.setdefault(name, np.array([values[joint] for joint in group.joints]))
    return result
