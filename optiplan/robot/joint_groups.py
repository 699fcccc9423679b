"""The planned joints, the positions of the others, and the model reduced to the planned joints."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Document
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.records import dataclass
from optiplan.robot.mimic_joints import Mimic, MimicError, fold
from optiplan.robot.spec import MecanumSpec, RobotSpec
from optiplan.robot.urdf.mesh_geometries import UrdfBodies
from optiplan.robot.urdf.reader import UrdfSource, build_model, build_visuals, read_collisions

TURNING, SLIDING = ("revolute", "continuous"), ("prismatic",)
MOVABLE = (*TURNING, *SLIDING)


class Reduced(NamedTuple):
    """The robot with all joints fixed except the planned ones and their followers.

    `model` has the planned joints as its degrees of freedom, `plain` the followers as well. `followers` gives the
    leader of each follower, `locked` the positions of the fixed joints, rad or m. `bodies` are those of `plain`.
    """

    model: pin.Model
    plain: pin.Model
    followers: Mapping[str, Mimic]
    bodies: UrdfBodies
    build_visual: Callable[[], pin.GeometryModel]
    locked: Mapping[str, float]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """The planned joints, base to tip; lists in the robot.yaml have one value for each of the `listed` joints.

    `chosen`: the group is the default, and the robot has further joints.
    """

    name: str | None
    joints: tuple[str, ...]
    listed: tuple[str, ...]
    chosen: bool = False

    def pick(self, values: Sequence[float]) -> Array:
        """Select the planned joints' values from one value for each listed joint, (n,)."""
        return np.array([values[self.listed.index(joint)] for joint in self.joints], dtype=np.float64)


def planned_joints(spec: RobotSpec, document: Document, urdf: UrdfSource, name: str | None = None) -> Group:
    """Return the group `name`; without a name `group`, else the first of `groups`, else the longest chain of joints.

    Names joined by `+` select all joints of these groups.

    Raises:
        UnknownChoiceError: there is no such group.
        InputError: a name that is no joint, a joint that cannot be planned, another order than base to tip.
    """
    model = build_model(urdf)
    movable = [joint for joint in model.names if urdf.joint_types.get(joint) in MOVABLE and joint not in urdf.mimics]
    names = [] if name is None else name.split("+")
    for one in names:
        if one not in spec.groups:
            raise UnknownChoiceError("group", one, spec.groups or ["none, since the robot file has no groups"])
    if isinstance(spec.group, str) and spec.group not in spec.groups:
        found = f"unknown group '{spec.group}'"
        raise InputError([document.issue(("group",), found, choices(spec.group, list(spec.groups)))])
    if spec.group is None and not spec.groups:
        if not movable:
            raise InputError([document.issue((), f"a robot without movable joints in {urdf.path}", "at least one")])
        chosen_joints = tuple(movable if spec.dh is not None else _longest_chain(model, urdf, movable))
        return Group(None, chosen_joints, chosen_joints, chosen_joints != tuple(movable))
    unnamed = spec.group if isinstance(spec.group, list) else None
    lists: list[tuple[Place, list[str]]] = [] if unnamed is None else [(("group",), unnamed)]
    lists += [(("groups", key), joints) for key, joints in spec.groups.items()]
    issues = [issue for place, joints in lists for issue in _joint_issues(place, joints, movable, document, urdf)]
    if issues:
        raise InputError(issues)
    listed = tuple(joint for joint in movable if any(joint in joints for _, joints in lists))
    if name is None and unnamed is not None:
        return Group(None, tuple(unnamed), listed)
    chosen = name or (spec.group if isinstance(spec.group, str) else next(iter(spec.groups)))
    joints = {joint for one in names or [chosen] for joint in spec.groups[one]}
    return Group(chosen, tuple(joint for joint in movable if joint in joints), listed)


def _longest_chain(model: pin.Model, urdf: UrdfSource, movable: list[str]) -> list[str]:
    from optiplan.robot.default_group import longest_chain

    return longest_chain(model, urdf, movable)


def mecanum_base(spec: RobotSpec, document: Document, planned: Sequence[str], urdf: UrdfSource) -> MecanumSpec | None:
    """Return the key `mecanum` if all three of its joints are planned.

    Raises:
        InputError: a name that is no joint, or not two that slide and one that turns.
    """
    if spec.mecanum is None:
        return None
    issues: list[Issue] = []
    for k, (name, kinds) in enumerate(zip(spec.mecanum.joints, (SLIDING, SLIDING, TURNING), strict=True)):
        if urdf.joint_types.get(name) not in kinds:
            known = [joint for joint, kind in urdf.joint_types.items() if kind in kinds]
            found = (
                f"the {urdf.joint_types[name]} joint '{name}'"
                if name in urdf.joint_types
                else f"unknown joint '{name}'"
            )
            issues.append(document.issue(("mecanum", "joints", k), found, choices(name, known)))
    if issues:
        raise InputError(issues)
    return spec.mecanum if set(spec.mecanum.joints) <= set(planned) else None


def _joint_issues(
    place: Place, group: Sequence[str], movable: Sequence[str], document: Document, urdf: UrdfSource
) -> Iterator[Issue]:
    if not group:
        yield document.issue(place, "an empty list", "at least one joint")
    wrong = [(index, name) for index, name in enumerate(group) if name not in movable]
    for index, name in wrong:
        kind = urdf.joint_types.get(name)
        found = f"unknown joint '{name}'" if kind is None else f"the {kind} joint '{name}', which cannot be planned"
        if name in urdf.mimics:
            found = f"the mimic joint '{name}', which follows '{urdf.mimics[name].source}'"
        yield document.issue((*place, index), found, choices(name, movable))
    ordered = [name for name in movable if name in group]
    if not wrong and list(group) != ordered:
        yield document.issue(place, f"[{', '.join(group)}]", f"base-to-tip order: [{', '.join(ordered)}]")


def _check_locked(wanted: Mapping[str, float], planned: Sequence[str], urdf: UrdfSource, document: Document) -> None:
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


def reduce_to(planned: Sequence[str], wanted: Mapping[str, float], urdf: UrdfSource, document: Document) -> Reduced:
    """Fix every joint that is not planned: at `wanted`, at its leader's position, or at zero moved into its limits.

    Followers of planned joints move with them, except for joints in `wanted` and what follows those.

    Raises:
        InputError: `wanted` names a planned or an unknown joint; a follower carries its leader; a follower of an
            endless joint has a multiplier that is not whole.
    """
    _check_locked(wanted, planned, urdf, document)
    model = build_model(urdf)
    notes: list[str] = []
    reference = pin.neutral(model)
    locked: dict[str, float] = {}
    mimics = urdf.mimics_beside(wanted)
    followers = {name: mimic for name, mimic in mimics.items() if mimic.source in planned and mimic.multiplier != 0.0}
    _refuse_broken_turns(followers, urdf)
    fixed = [name for name in model.names[1:] if name not in planned and name not in followers]
    for name in fixed:
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            locked[name] = reference[joint.idx_q] = _rest(model, joint.idx_q, name, wanted.get(name), notes)
    for name, mimic in ((name, mimics[name]) for name in fixed if name in mimics):
        value = mimic.multiplier * locked.get(mimic.source, 0.0) + mimic.offset
        locked[name] = reference[model.joints[model.getJointId(name)].idx_q] = value
    for name, mimic in followers.items():
        offset = f" {mimic.offset:+g}" if mimic.offset else ""
        notes.append(f"joint {name} moves with {mimic.source}: q = {mimic.multiplier:g} · {mimic.source}{offset}")
    for name in wanted:
        if name in urdf.mimics and urdf.mimics[name].source in planned:
            notes.append(f"joint {name} is locked here and does not follow {urdf.mimics[name].source}")
        if not model.existJointName(name):
            notes.append(f"joint {name} is fixed in the URDF and stands where the URDF puts it")
    ids = [model.getJointId(name) for name in fixed]

    def build_visual() -> pin.GeometryModel:
        return pin.buildReducedModel(model, build_visuals(urdf, model), ids, reference)[1]

    whole = read_collisions(urdf, model)
    plain, geometry = pin.buildReducedModel(model, whole.geometry, ids, reference)
    try:
        small = fold(plain, followers)
    except MimicError as error:
        raise urdf.error(error.joint, error.found, error.expected) from error
    wide = [(name, kind) for name, kind in urdf.joint_types.items() if kind in ("floating", "planar")]
    notes += [f"joint {name} is {kind}: it is fixed here, where the URDF puts it" for name, kind in wide]
    bodies = UrdfBodies(geometry, whole.meshes)
    return Reduced(small, plain, followers, bodies, build_visual, locked, tuple(notes))


def _refuse_broken_turns(followers: Mapping[str, Mimic], urdf: UrdfSource) -> None:
    """Refuse fractional followers of endless joints: a whole turn of the leader would move the follower."""
    for name, mimic in followers.items():
        revolute = urdf.joint_types[name] != "prismatic" and float(mimic.multiplier).is_integer()
        if urdf.joint_types[mimic.source] == "continuous" and not revolute:
            found = f"<mimic> of '{mimic.source}', which turns without end, by {mimic.multiplier:g}"
            expected = f"a whole multiplier of a joint that turns, or limits for '{mimic.source}' (type revolute)"
            raise urdf.error(name, found, expected)


def _rest(model: pin.Model, index: int, name: str, wanted: float | None, notes: list[str]) -> float:
    lower, upper = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
    if wanted is None:
        return min(max(0.0, lower), upper)
    if not lower <= wanted <= upper:
        notes.append(f"joint {name} is locked at {wanted:g}, beyond its own limits [{lower:g}, {upper:g}]; kept")
    return float(wanted)
