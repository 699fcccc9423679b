"""Which joints are planned, where the others stand, and the model reduced to the planned ones."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.model.robot_spec import RobotSpec
from optiplan.model.urdf import UrdfSource, build_collisions, build_model, build_visuals
from optiplan.yaml_lines import Document, Place
from optiplan.yaml_words import choices

MOVABLE = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Reduced:
    """The robot with every joint fixed that is not planned; `locked` holds where those stand (rad, m)."""

    model: pin.Model
    geometry: pin.GeometryModel
    build_visual: Callable[[], pin.GeometryModel]
    locked: Mapping[str, float]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """The planned joints, base to tip; `listed` are those that lists in the robot.yaml hold a value for."""

    name: str | None
    joints: tuple[str, ...]
    listed: tuple[str, ...]

    def pick(self, values: Sequence[float]) -> Array:
        """Of one value for each listed joint those of the planned ones, (n,)."""
        return np.array([values[self.listed.index(joint)] for joint in self.joints], dtype=np.float64)


def planned_joints(spec: RobotSpec, document: Document, urdf: UrdfSource, name: str | None = None) -> Group:
    """The group called `name`; without a name `group`, else the first of `groups`, else all that follow no other.

    Raises:
        UnknownChoiceError: there is no such group.
        InputError: a name that is no joint, a joint that cannot be planned, another order than base to tip.
    """
    movable = [
        joint
        for joint in build_model(urdf).names
        if urdf.joint_types.get(joint) in MOVABLE and joint not in urdf.mimics
    ]
    if name is not None and name not in spec.groups:
        raise UnknownChoiceError("group", name, spec.groups or ["none, since the robot file has no groups"])
    if isinstance(spec.group, str) and spec.group not in spec.groups:
        found = f"unknown group '{spec.group}'"
        raise InputError([document.issue(("group",), found, choices(spec.group, list(spec.groups)))])
    if spec.group is None and not spec.groups:
        _refuse_wide_joints(list(urdf.joint_types), urdf)
        if not movable:
            raise InputError([document.issue((), f"a robot without movable joints in {urdf.path}", "at least one")])
        return Group(None, tuple(movable), tuple(movable))
    unnamed = spec.group if isinstance(spec.group, list) else None
    lists: list[tuple[Place, list[str]]] = [] if unnamed is None else [(("group",), unnamed)]
    lists += [(("groups", key), joints) for key, joints in spec.groups.items()]
    issues = [issue for place, joints in lists for issue in _joint_issues(place, joints, movable, (document, urdf))]
    if issues:
        raise InputError(issues)
    listed = tuple(joint for joint in movable if any(joint in joints for _, joints in lists))
    if name is None and unnamed is not None:
        return Group(None, tuple(unnamed), listed)
    chosen = name or (spec.group if isinstance(spec.group, str) else next(iter(spec.groups)))
    return Group(chosen, tuple(spec.groups[chosen]), listed)


def _joint_issues(
    place: Place, group: Sequence[str], movable: Sequence[str], source: tuple[Document, UrdfSource]
) -> Iterator[Issue]:
    document, urdf = source
    if not group:
        yield document.issue(place, "an empty list", "at least one joint")
    wrong = [(index, name) for index, name in enumerate(group) if name not in movable]
    for index, name in wrong:
        kind = "mimic" if name in urdf.mimics else urdf.joint_types.get(name)
        found = f"unknown joint '{name}'" if kind is None else f"the {kind} joint '{name}', which cannot be planned"
        yield document.issue((*place, index), found, choices(name, movable))
    ordered = [name for name in movable if name in group]
    if not wrong and list(group) != ordered:
        yield document.issue(place, f"[{', '.join(group)}]", f"base-to-tip order: [{', '.join(ordered)}]")


def _refuse_wide_joints(names: Sequence[str], urdf: UrdfSource) -> None:
    for name in names:
        if urdf.joint_types[name] in ("floating", "planar"):
            raise urdf.error(name, f"a {urdf.joint_types[name]} joint", "a `group` of joints that leaves it out")


def check_locked(wanted: Mapping[str, float], planned: Sequence[str], urdf: UrdfSource, document: Document) -> None:
    """Refuse positions of joints that are planned or are not there.

    Raises:
        InputError: with an issue for each, in the field `locked.<joint>`.
    """
    names = list(urdf.joint_types)
    free = [name for name in names if name not in planned and urdf.joint_types[name] != "fixed"]
    issues: list[Issue] = []
    for name in wanted:
        if name not in names:
            issues.append(document.issue(("locked", name), f"unknown joint '{name}'", choices(name, free)))
        elif name in planned:
            issues.append(document.issue(("locked", name), f"the planned joint '{name}'", "a joint outside the group"))
    if issues:
        raise InputError(issues)


def reduce_to(planned: Sequence[str], wanted: Mapping[str, float], urdf: UrdfSource) -> Reduced:
    """Fix every joint that is not planned: at `wanted`, where it follows another, or at zero moved into its limits."""
    model = build_model(urdf)
    notes: list[str] = []
    reference = pin.neutral(model)
    locked: dict[str, float] = {}
    fixed = [name for name in model.names[1:] if name not in planned]
    for name in fixed:
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            locked[name] = reference[joint.idx_q] = _rest(model, joint.idx_q, name, wanted.get(name), notes)
    for name in (name for name in fixed if name in urdf.mimics and name not in wanted):
        mimic = urdf.mimics[name]
        value = mimic.multiplier * locked.get(mimic.source, 0.0) + mimic.offset
        locked[name] = reference[model.joints[model.getJointId(name)].idx_q] = value
        if mimic.source in planned:
            notes.append(f"joint {name} follows the planned joint {mimic.source}; it is fixed at {value:g}")
    for name in wanted:
        if not model.existJointName(name):
            notes.append(f"joint {name} is fixed in the URDF and stands where the URDF puts it")
    ids = [model.getJointId(name) for name in fixed]

    def build_visual() -> pin.GeometryModel:
        return pin.buildReducedModel(model, build_visuals(urdf, model), ids, reference)[1]

    small, geometry = pin.buildReducedModel(model, build_collisions(urdf, model), ids, reference)
    return Reduced(small, geometry, build_visual, locked, tuple(notes))


def _rest(model: pin.Model, index: int, name: str, wanted: float | None, notes: list[str]) -> float:
    lower, upper = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
    if wanted is None:
        return min(max(0.0, lower), upper)
    if not lower <= wanted <= upper:
        notes.append(f"joint {name} is locked at {wanted:g}, beyond its own limits [{lower:g}, {upper:g}]; kept")
    return float(wanted)
