"""Whether a robot's state, at the start or at a goal, violates a path constraint: in words, with both values."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from optiplan.collision.named_pairs import NamedPairs
from optiplan.geometry.scene import Scene
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.kinematics.mecanum import wheel_matrix
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.constraints.measures import ROUNDING, FramePoses, measures
from optiplan.problem.constraints.motions import (
    JointCoupling,
    ManipulabilityAbove,
    PairClearance,
    ToolAcceleration,
    ToolSpeed,
    WheelSpeed,
)
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.free_space import TOUCHING
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pairs import WORDS
from optiplan.trajectory.state import State

RATE_SHARE = 1e-3
"""Share of a limit of speed or acceleration by which it may be passed: at the limit there is no margin for a proof."""


class BrokenConstraint:
    """What states violate of one path constraint."""

    def __init__(self, one: PathConstraint, robot: Robot, scene: Scene) -> None:
        self._one, self._robot = one, robot
        self._pairs = NamedPairs(robot, scene, one.pairs) if isinstance(one, PairClearance) else None
        self._allowed = scene.allowed

    @property
    def decided_by_an_end(self) -> bool:
        """Whether stated joint values decide it: endless joints also end whole turns away, where couplings differ."""
        if not isinstance(self._one, JointCoupling):
            return True
        return not any(self._robot.endless[self._robot.joint_names.index(name)] for name in self._one.joints)

    def unchecked(self) -> list[tuple[int, str]]:
        """Return which of the named pairs nothing can hold apart, and why."""
        if self._pairs is None or not isinstance(self._one, PairClearance):
            return []
        known = {frozenset((pair.name_a, pair.name_b)) for pair in self._pairs.pairs}
        return [(k, self._why(*pair)) for k, pair in enumerate(self._one.pairs) if frozenset(pair) not in known]

    def _why(self, a: str, b: str) -> str:
        reasons = {frozenset(pair): reason for pair, reason in self._robot.allowed.items()}
        reason = reasons.get(frozenset((a, b)))
        if frozenset((a, b)) in self._allowed:
            return f"'{a}' and '{b}', which the scene allows to touch"
        if reason is not None:
            return f"'{a}' and '{b}', which are not held apart ({WORDS.get(reason, reason)})"
        return f"'{a}' and '{b}', of which one has no body, or which no planned joint moves against each other"

    def words(self, state: State) -> list[str]:
        """Return in words what a state violates, with both values."""
        one, robot = self._one, self._robot
        match one:
            case PairClearance():
                return self._near(one, state)
            case JointCoupling():
                return _uncoupled(one, robot, state)
            case ManipulabilityAbove():
                return _singular(one, robot, state)
            case WheelSpeed():
                return _wheels(one, robot, state)
            case ToolSpeed():
                return _rate(one, robot, state, pin.getFrameVelocity, ("m/s", "rad/s"))
            case ToolAcceleration():
                return _rate(one, robot, state, pin.getFrameClassicalAcceleration, ("m/s²", "rad/s²"))
            case TipOver():
                return _tipping(one, robot, state)
        return _posed(one, robot, state)

    def _near(self, one: PairClearance, state: State) -> list[str]:
        assert self._pairs is not None
        return [
            f"near by {contact.distance:.4g} m of {one.at_least:.4g} m asked for ('{contact.pair.name_a}' and "
            f"'{contact.pair.name_b}')"
            for contact in self._pairs.contacts(state.q, one.at_least)
            if contact.distance < one.at_least - TOUCHING
        ]


def _posed(one: PathConstraint, robot: Robot, state: State) -> list[str]:
    own = measures(one)
    if not own:
        return []
    X = FramePoses.of(robot, one)(state.q[None])
    values = [(each, float(each.value(X)[0])) for each in own]
    return [
        f"{each.quantity} by {each.shown(value):.4g} {each.unit} of {each.shown(each.limit):.4g} {each.unit} allowed"
        for each, value in values
        if value > each.allowed
    ]


def _tipping(one: TipOver, robot: Robot, state: State) -> list[str]:
    if not robot.has_inertia:
        return [f"of masses that the file of {robot.name} does not give"]
    wrench = base_reaction(robot, state.q[None], state.v[None], state.a[None])
    margin = float(one.polygon.margins(wrench)[0])
    if margin >= one.margin - ROUNDING:
        return []
    return [f"tipping over: a margin of {margin:.4g} m where {one.margin:.4g} m is asked for"]


def _uncoupled(one: JointCoupling, robot: Robot, state: State) -> list[str]:
    names = list(robot.joint_names)
    off = abs(sum(weight * float(state.q[names.index(name)]) for name, weight in one.joints.items()) - one.equals)
    return [] if off <= one.within + ROUNDING else [f"uncoupled by {off:.4g} of {one.within:.4g} allowed"]


def _singular(one: ManipulabilityAbove, robot: Robot, state: State) -> list[str]:
    J = ToolKinematics(robot, one.frame).evaluate(state.q[None])[1][0]
    value = float(np.prod(np.linalg.svd(J, compute_uv=False)))
    if value >= one.at_least - ROUNDING:
        return []
    return [f"near a singularity, of manipulability {value:.4g} where {one.at_least:.4g} is asked for"]


def _wheels(one: WheelSpeed, robot: Robot, state: State) -> list[str]:
    matrix = wheel_matrix(robot, state.q)
    fastest = 0.0 if matrix is None else float(np.abs(matrix @ state.v).max())
    return _too_fast("wheels at", fastest, one.at_most, "rad/s")


def _rate(
    one: ToolSpeed | ToolAcceleration,
    robot: Robot,
    state: State,
    of_frame: Callable[[pin.Model, pin.Data, int, pin.ReferenceFrame], pin.Motion],
    units: tuple[str, str],
) -> list[str]:
    data, frame = robot.model.createData(), robot.frame_id(one.frame)
    pin.forwardKinematics(robot.model, data, state.q, state.v, state.a)
    pin.updateFramePlacements(robot.model, data)
    rate = of_frame(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    found = _too_fast(f"{one.frame} at", float(np.linalg.norm(rate.linear)), one.linear, units[0])
    return found + _too_fast(f"{one.frame} at", float(np.linalg.norm(rate.angular)), one.angular, units[1])


def _too_fast(what: str, value: float, limit: float, unit: str) -> list[str]:
    if value <= limit * (1.0 + RATE_SHARE):
        return []
    return [f"too fast: {what} {value:.4g} {unit} of {limit:.4g} {unit} allowed"]
