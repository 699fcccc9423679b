"""Mimic joints: a follower moves with its leader, q_follower = multiplier · q_leader + offset.

A robot's pinocchio model has nq = nv = n planned joints; its followers are joints without a degree of freedom.
Pinocchio's derivatives of inverse dynamics do not support such joints; `unfold` returns a plain model for them.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags
from optiplan.records import dataclass

if TYPE_CHECKING:
    from optiplan.robot.robot import Robot

SMALLEST, LARGEST = 1e-6, 1e6
"""Bounds of |multiplier|, rad or m of the follower a rad or m of the leader; 0 is a follower that stands still."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: q = multiplier · q_source + offset."""

    source: str
    multiplier: float
    offset: float


class MimicError(ValueError):
    """An impossible mimic joint: `joint`, what was `found` and what is `expected`."""

    def __init__(self, joint: str, found: str, expected: str) -> None:
        super().__init__(f"{joint}: {found}; expected {expected}")
        self.joint, self.found, self.expected = joint, found, expected


def resolve(mimics: Mapping[str, Mimic], movable: Sequence[str]) -> dict[str, Mimic]:
    """Return every mimic joint with a leader that follows no other: m = m_1 m_2, o = m_1 o_2 + o_1.

    Raises:
        MimicError: joints that follow each other in a circle, or a leader that is unknown or fixed.
    """
    return {name: _resolved(name, mimics, movable) for name in mimics}


def _resolved(name: str, mimics: Mapping[str, Mimic], movable: Sequence[str]) -> Mimic:
    followed, multiplier, offset = [name], 1.0, 0.0
    while followed[-1] in mimics:
        step = mimics[followed[-1]]
        offset, multiplier = multiplier * step.offset + offset, multiplier * step.multiplier
        if step.source in followed:
            raise MimicError(name, f"a circle: {' follows '.join([*followed, step.source])}", "a joint that is free")
        if step.source not in movable:
            found = f"<mimic> of '{step.source}', which is no joint that moves"
            raise MimicError(followed[-1], found, f"one of: {', '.join(sorted(set(movable) - set(mimics)))}")
        followed.append(step.source)
    if multiplier != 0.0 and not (SMALLEST <= abs(multiplier) <= LARGEST and abs(offset) <= LARGEST):
        found = f"<mimic> with multiplier {multiplier:g} and offset {offset:g} of '{followed[-1]}'"
        raise MimicError(
            name, found, f"0, or a multiplier of {SMALLEST:g} to {LARGEST:g}; an offset within {LARGEST:g}"
        )
    return Mimic(followed[-1], multiplier, offset)


def leaders_first(model: pin.Model, mimics: Mapping[str, Mimic]) -> pin.Model:
    """Return the model with leaders before their followers, where such an order of joints exists.

    That order need not be depth first; `unfold` restores a depth-first order.
    """
    leader = {model.getJointId(name): model.getJointId(mimic.source) for name, mimic in mimics.items()}
    if all(source < follower for follower, source in leader.items()):
        return model
    order: list[int] = []
    left = list(range(1, model.njoints))
    while left:
        placed = {0, *order}
        ready = [j for j in left if model.parents[j] in placed]
        chosen = next((j for j in ready if leader.get(j, 0) in placed), ready[0])
        order.append(chosen)
        left.remove(chosen)
    return _rebuilt(model, order, {})


def fold(model: pin.Model, mimics: Mapping[str, Mimic]) -> pin.Model:
    """Return the model in which each joint of `mimics` moves with its leader, without a degree of freedom.

    Raises:
        MimicError: a follower that carries its leader.
    """
    for name, mimic in mimics.items():
        leader, follower = model.getJointId(mimic.source), model.getJointId(name)
        if leader > follower:
            found = f"<mimic> of '{mimic.source}', a joint that it carries or that is tangled with it"
            raise MimicError(name, found, f"'{mimic.source}' outside the group of planned joints")
        model = pin.transformJointIntoMimic(model, leader, follower, mimic.multiplier, mimic.offset)
    return model


def coupling(model: pin.Model) -> tuple[Array, Array]:
    """Return A (J, n) and b (J,): A q + b are the positions, rad or m, of all J joints, planned and followers."""
    A, b = np.zeros((model.njoints - 1, model.nv)), np.zeros(model.njoints - 1)
    for j in range(1, model.njoints):
        mimic = _mimic_of(model, j)
        A[j - 1, model.joints[j].idx_v] = 1.0 if mimic is None else mimic.scaling
        b[j - 1] = 0.0 if mimic is None else mimic.offset
    return A, b


def screws(model: pin.Model) -> Array:
    """Return the unit screw (J, 6), linear part first, of each joint in its own frame."""
    data = model.createData()
    columns = pin.computeJointJacobians(model, data, pin.neutral(model)).reshape(6, -1)  # of one joint it is (6,)
    found = np.empty((model.njoints - 1, 6))
    for j in range(1, model.njoints):
        mimic = _mimic_of(model, j)
        # A column is the joint's screw seen from the world, times the multiplier; seen from the joint it is constant.
        found[j - 1] = data.oMi[j].actInv(pin.Motion(columns[:, model.joints[j].idx_vExtended])).vector
        found[j - 1] /= 1.0 if mimic is None else mimic.scaling
    return found


def turning(model: pin.Model) -> Flags:
    """Return which joints of a model turn, (J,), followers included; the others slide."""
    return np.asarray(np.linalg.norm(screws(model)[:, 3:], axis=1) > 0.5)


class Unfolded(NamedTuple):
    """A model without followers, of J joints, behind one of n: q_J = A q + b, v_J = A v, and tau = A^T tau_J.

    Its joints are in depth-first order, which pinocchio's derivatives and mass matrices require.
    """

    model: pin.Model
    A: Array
    b: Array


def unfold(model: pin.Model) -> Unfolded:
    """Return the plain model of a model with followers; without followers the model itself, with A the identity."""
    followers = {j: _mimic_of(model, j) for j in range(1, model.njoints)}
    if not any(followers.values()):
        return Unfolded(model, np.eye(model.nv), np.zeros(model.nv))
    A, b = coupling(model)
    order = _depth_first(model, 0)[1:]
    rows = [j - 1 for j in order]
    plain = {j: _plain_joint(screw) for j, screw in enumerate(screws(model), 1) if followers[j] is not None}
    return Unfolded(_rebuilt(model, order, plain), A[rows], b[rows])


def _depth_first(model: pin.Model, j: int) -> list[int]:
    order, stack = [], [j]
    while stack:
        order.append(stack.pop())
        stack += reversed(list(model.children[order[-1]]))
    return order


def _mimic_of(model: pin.Model, j: int) -> pin.JointModelMimic | None:
    joint = model.joints[j]
    return joint.extract() if joint.shortname() == "JointModelMimic" else None


def _plain_joint(screw: Array) -> pin.JointModel:
    if np.linalg.norm(screw[3:]) > 0.5:
        return pin.JointModelRevoluteUnaligned(screw[3:])
    return pin.JointModelPrismaticUnaligned(screw[:3])


def _rebuilt(model: pin.Model, order: Sequence[int], kinds: Mapping[int, pin.JointModel]) -> pin.Model:
    """Return the model with its joints in another order (parents first), some of another kind."""
    result = pin.Model()
    result.name, result.gravity, result.inertias[0] = model.name, model.gravity, model.inertias[0]
    place = {0: 0}
    for j in order:
        joint = model.joints[j]
        kind = kinds.get(j, joint)
        limits = list(_limits(model, joint)) if j not in kinds else [np.full(1, x) for x in _FREE]
        parent = place[model.parents[j]]
        place[j] = result.addJoint(parent, kind, model.jointPlacements[j], model.names[j], *limits)
        result.appendBodyToJoint(place[j], model.inertias[j], pin.SE3.Identity())
        if j not in kinds:
            new = result.joints[place[j]]
            result.armature[new.idx_v : new.idx_v + new.nv] = model.armature[joint.idx_v : joint.idx_v + joint.nv]
    # Frames stand in the order of their joints: pinocchio's reduction relies on it.
    frames = sorted(range(1, model.nframes), key=lambda index: place[model.frames[index].parentJoint])
    index_of = {0: 0} | {old: new for new, old in enumerate(frames, 1)}
    for frame in (model.frames[index] for index in frames):
        ends = place[frame.parentJoint], index_of[frame.parentFrame]
        result.addFrame(pin.Frame(frame.name, *ends, frame.placement, frame.type), False)
    return result


_FREE = (np.inf, np.inf, -np.inf, np.inf)
"""Effort, velocity, lower and upper position limit of a joint without known limits."""


def _limits(model: pin.Model, joint: pin.JointModel) -> Iterator[Array]:
    rates = slice(joint.idx_v, joint.idx_v + joint.nv)
    positions = slice(joint.idx_q, joint.idx_q + joint.nq)
    yield from (model.upperEffortLimit[rates], model.upperVelocityLimit[rates])
    yield from (model.lowerPositionLimit[positions], model.upperPositionLimit[positions])


def held_model(
    model: pin.Model, geometry: pin.GeometryModel, followers: Mapping[str, Mimic], held: Mapping[str, float]
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return model and bodies with some joints and their followers fixed; pairs of bodies stay the same.

    Args:
        model: with `followers` as joints without a degree of freedom.
        geometry: its bodies.
        followers: by name.
        held: positions, rad or m, of planned joints.
    """
    plain = leaders_first(unfold(model).model, followers)
    bodies = geometry.copy()
    for body in bodies.geometryObjects:  # joints may stand in another order in the plain model
        body.parentJoint = plain.getJointId(model.names[body.parentJoint])
        frame = model.frames[body.parentFrame]
        body.parentFrame = plain.getFrameId(frame.name, frame.type)
    fixed = dict(held)
    for name, mimic in followers.items():
        if mimic.source in held:
            fixed[name] = mimic.multiplier * held[mimic.source] + mimic.offset
    q = pin.neutral(plain)
    for name, value in fixed.items():
        q[plain.joints[plain.getJointId(name)].idx_q] = value
    ids = [plain.getJointId(name) for name in fixed]
    reduced, around = pin.buildReducedModel(plain, bodies, ids, q)
    left = {name: mimic for name, mimic in followers.items() if name not in fixed}
    return fold(reduced, left), around


def held_parts(robot: "Robot", held: Mapping[str, float]) -> dict[str, Any]:
    """Return what differs in a robot, by attribute, where these planned joints are fixed, rad or m."""
    model, geometry = held_model(robot.model, robot.geometry, robot.followers, held)
    kept = [j for j, name in enumerate(robot.joint_names) if name not in held]
    names = tuple(robot.joint_names[j] for j in kept)
    wheels = robot.mecanum is not None and set(robot.mecanum.joints) <= set(names)
    return {
        "model": model,
        "geometry": geometry,
        "limits": robot.limits.of_joints(kept),
        "joint_names": names,
        "configurations": {name: q[kept] for name, q in robot.configurations.items()},
        "build_visual": lambda: held_model(robot.model, robot.build_visual(), robot.followers, held)[1],
        "locked": {**robot.locked, **held},
        "followers": {name: one for name, one in robot.followers.items() if one.source not in held},
        "mecanum": robot.mecanum if wheels else None,
        "held": {**robot.held, **held},
    }
