"""Joints of UsdPhysics between two bodies: kind, frames, limits and drive, in metres and radians.

A joint holds a frame F0 in body 0 and F1 in body 1; with J(q) the turn about or the slide along its axis,

    X_B0B1(q) = X_B0F0 J(q) X_B1F1⁻¹.

A generic joint (PhysicsJoint, D6) is what its limits leave free: an axis whose low is above its high is locked.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.importers.robots.urdf_tree import moved
from optiplan.importers.robots.usd.shapes import is_body
from optiplan.importers.robots.usd.stage import UsdStage, schemas
from optiplan.records import dataclass

FIXED, TURNS, SLIDES, FREE = "fixed", "revolute", "prismatic", "free"
TYPES = {
    "PhysicsFixedJoint": FIXED,
    "PhysicsRevoluteJoint": TURNS,
    "PhysicsPrismaticJoint": SLIDES,
    "PhysicsSphericalJoint": "spherical",
    "PhysicsDistanceJoint": FREE,
    "PhysicsJoint": "generic",
}
_AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}
_DEGREES_OF_FREEDOM = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")

ENDLESS = 1e5
"""rad/s, rad or m: what is above stands for no limit."""


@dataclass(frozen=True)
class UsdJoint:
    """One joint; `bodies` are paths of rigid bodies, empty for the world.

    Attributes:
        prim: the joint.
        kind: fixed, revolute, prismatic, free (holds nothing), or what a robot cannot have.
        bodies: body 0 and body 1.
        frames: F0 and F1, each in the frame of its body, m.
        axis: (3,) in F0, a unit vector.
        lower: rad or m; -inf without an end.
        upper: rad or m; inf without an end.
        effort: the largest torque or force of its drive, N·m or N; inf where none is stated.
        velocity: rad/s or m/s; inf where none is stated.
        driven: whether it has a drive.
        in_tree: whether it belongs to the articulation; others close loops.
        mimic: path of the joint that it follows, factor and offset, rad or m; None: it follows none.
    """

    prim: Any
    kind: str
    bodies: tuple[str, str]
    frames: tuple[pin.SE3, pin.SE3]
    axis: Array
    lower: float
    upper: float
    effort: float
    velocity: float
    driven: bool
    in_tree: bool
    mimic: tuple[str, float, float] | None

    @property
    def path(self) -> str:
        """The path of the prim."""
        return str(self.prim.GetPath())

    @property
    def moves(self) -> bool:
        """Whether it has a degree of freedom."""
        return self.kind in (TURNS, SLIDES)


def read_joints(stage: UsdStage, places: Mapping[str, pin.SE3]) -> list[UsdJoint]:
    """All joints that are enabled.

    Args:
        stage: with the joints.
        places: X_WB of every rigid body, by path.

    Raises:
        InputError: a joint without a body, or with limits or axes that are none.
    """
    of_joints = (prim for prim in stage.prims() if str(prim.GetTypeName()) in TYPES)
    return [_joint(stage, one, places) for one in of_joints if bool(stage.value(one, "physics:jointEnabled", True))]


def _joint(stage: UsdStage, prim: Any, places: Mapping[str, pin.SE3]) -> UsdJoint:
    ends = [_end(stage, prim, k, places) for k in (0, 1)]
    if ends[0][0] == ends[1][0]:
        told = "a joint between two prims of one body" if ends[0][0] else "a joint between no two bodies"
        raise stage.issue(prim, told, "physics:body0 and physics:body1, one of them a rigid body")
    kind, axis, key = _kind(stage, prim)
    lower, upper = _limits(stage, prim, kind, key)
    X_0F, X_1F = ends[0][1], ends[1][1]
    if lower == upper:
        X_0F, kind = X_0F * moved(kind == TURNS, axis, lower), FIXED
    drive = key if f"PhysicsDriveAPI:{key}" in schemas(prim) else ""
    return UsdJoint(
        prim,
        kind,
        (ends[0][0], ends[1][0]),
        (X_0F, X_1F),
        axis,
        lower,
        upper,
        _effort(stage, prim, kind, drive),
        _velocity(stage, prim, kind),
        bool(drive),
        not bool(stage.value(prim, "physics:excludeFromArticulation", False)),
        _mimic(stage, prim, kind),
    )


def _end(stage: UsdStage, prim: Any, k: int, places: Mapping[str, pin.SE3]) -> tuple[str, pin.SE3]:
    """The body of an end, and the joint's frame in it; the empty path and a frame in the world without a body."""
    relation = prim.GetRelationship(f"physics:body{k}")
    named = relation.GetForwardedTargets() if relation else []
    targets = stage.targets(prim, f"physics:body{k}")
    if len(named) > 1 or len(targets) < len(named):
        raise stage.issue(prim, ", ".join(map(str, named)), "one prim of the stage", f"physics:body{k}")
    target = targets[0] if targets else None
    A_WT = stage.placed(target)
    position = np.array(stage.value(prim, f"physics:localPos{k}", (0.0, 0.0, 0.0)), float)
    turn = stage.value(prim, f"physics:localRot{k}")
    w, xyz = (1.0, (0.0, 0.0, 0.0)) if turn is None else (float(turn.GetReal()), turn.GetImaginary())
    quaternion = pin.Quaternion(w, *(float(x) for x in xyz))
    if not np.isfinite(position).all() or not quaternion.norm() > 1e-6:
        raise stage.issue(prim, f"{position} and {turn}", "a position and a quaternion", f"physics:localPos{k}")
    R = A_WT.pose().rotation @ quaternion.normalized().toRotationMatrix()
    X_WF = pin.SE3(R, A_WT.points(position[None])[0])
    while target and not target.IsPseudoRoot() and not is_body(stage, target):
        target = target.GetParent()
    body = "" if not target or target.IsPseudoRoot() else str(target.GetPath())
    return (body, places[body].actInv(X_WF)) if body in places else ("", X_WF)


def _kind(stage: UsdStage, prim: Any) -> tuple[str, Array, str]:
    """What moves, about or along what, and the name of its limits and its drive."""
    kind = TYPES[str(prim.GetTypeName())]
    if kind == "generic":
        return _generic(stage, prim)
    axis = str(stage.value(prim, "physics:axis", "X"))
    if axis not in _AXES:
        raise stage.issue(prim, f"'{axis}'", "X, Y or Z", "physics:axis")
    return kind, _AXES[axis], {TURNS: "angular", SLIDES: "linear"}.get(kind, "")


def _generic(stage: UsdStage, prim: Any) -> tuple[str, Array, str]:
    """A joint of six degrees of freedom by what is free: nothing, one axis, all of them, or more than a robot has."""
    free = [name for name in _DEGREES_OF_FREEDOM if not _locked(stage, prim, name)]
    if not free:
        return FIXED, _AXES["X"], ""
    if len(free) == len(_DEGREES_OF_FREEDOM):
        return FREE, _AXES["X"], ""
    if len(free) > 1:
        return f"with {len(free)} free axes ({', '.join(free)})", _AXES["X"], ""
    return (SLIDES if free[0].startswith("trans") else TURNS), _AXES[free[0][-1]], free[0]


def _locked(stage: UsdStage, prim: Any, name: str) -> bool:
    if f"PhysicsLimitAPI:{name}" not in schemas(prim):
        return False
    low = stage.number(prim, f"limit:{name}:physics:low", -np.inf)
    return low > stage.number(prim, f"limit:{name}:physics:high", np.inf)


def _limits(stage: UsdStage, prim: Any, kind: str, key: str) -> tuple[float, float]:
    if kind not in (TURNS, SLIDES):
        return -np.inf, np.inf
    names = ("physics:lowerLimit", "physics:upperLimit")
    if key in _DEGREES_OF_FREEDOM:
        names = (f"limit:{key}:physics:low", f"limit:{key}:physics:high")
    lower, upper = (stage.number(prim, name, end) for name, end in zip(names, (-np.inf, np.inf), strict=True))
    if lower > upper:
        raise stage.issue(prim, f"{lower:g} above {upper:g}", "a lower limit that is not above the upper one", names[0])
    unit = _unit(stage, kind)
    ends = [
        value * unit if abs(value * unit) < ENDLESS else float(np.copysign(np.inf, value)) for value in (lower, upper)
    ]
    return ends[0], ends[1]


def _effort(stage: UsdStage, prim: Any, kind: str, drive: str) -> float:
    """N·m or N; drives of type `acceleration` state what is none."""
    if not drive or str(stage.value(prim, f"drive:{drive}:physics:type", "force")) != "force":
        return np.inf
    name = f"drive:{drive}:physics:maxForce"
    force = stage.number(prim, name, np.inf, "a number >= 0")
    if force < 0.0:
        raise stage.issue(prim, f"{force:g}", "a number >= 0", name)
    return force * stage.kilograms * stage.metres ** (2 if kind == TURNS else 1)


def _velocity(stage: UsdStage, prim: Any, kind: str) -> float:
    """rad/s or m/s, as PhysX states it."""
    value = stage.number(prim, "physxJoint:maxJointVelocity", np.inf)
    rate = value * _unit(stage, kind)
    return rate if 0.0 < value < ENDLESS else np.inf


def _mimic(stage: UsdStage, prim: Any, kind: str) -> tuple[str, float, float] | None:
    """Leader, factor and offset, by Newton's schema (q = c0 + c1 q_L) or that of PhysX (q + g q_L + o = 0).

    There q and q_L are in degrees or units of length of the stage.
    """
    if "NewtonMimicAPI" in schemas(prim) and bool(stage.value(prim, "newton:mimicEnabled", True)):
        leaders = stage.targets(prim, "newton:mimicJoint")
        offset, factor = (stage.number(prim, f"newton:mimicCoef{k}", float(k)) for k in (0, 1))
        return _in_metres(stage, kind, leaders[0], factor, offset) if leaders else None
    for name in (schema.split(":")[1] for schema in schemas(prim) if schema.startswith("PhysxMimicJointAPI:")):
        leaders = stage.targets(prim, f"physxMimicJoint:{name}:referenceJoint")
        gearing = stage.number(prim, f"physxMimicJoint:{name}:gearing", 1.0)
        offset = stage.number(prim, f"physxMimicJoint:{name}:offset", 0.0)
        if leaders:
            return _in_metres(stage, kind, leaders[0], -gearing, -offset)
    return None


def _in_metres(stage: UsdStage, kind: str, leader: Any, factor: float, offset: float) -> tuple[str, float, float]:
    """The path of a leader, and factor and offset of a joint of this kind that follows it, in rad or m."""
    its_kind = _kind(stage, leader)[0] if str(leader.GetTypeName()) in TYPES else kind
    unit = _unit(stage, kind)
    return str(leader.GetPath()), factor * (unit / _unit(stage, its_kind)), offset * unit


def _unit(stage: UsdStage, kind: str) -> float:
    """Degrees in rad, or the stage's unit of length in m."""
    return np.pi / 180.0 if kind == TURNS else stage.metres
