"""Checks of path constraints, proved for all times of their part of the motion."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.collision.moving_obstacles import joint_count
from optiplan.collision.named_pairs import NamedPairs
from optiplan.kinematics.mecanum import wheel_matrix
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.measures import Measure, measures
from optiplan.problem.constraints.motions import (
    JointCoupling,
    ManipulabilityAbove,
    PairClearance,
    ToolAcceleration,
    ToolSpeed,
    WheelSpeed,
)
from optiplan.problem.constraints.poses import RelativePose
from optiplan.problem.constraints.statements import PathConstraint, frame_of
from optiplan.problem.constraints.states import RATE_SHARE
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import with_obstacles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.balance_check import tip_over
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.frame_motion import FrameMotion
from optiplan.verify.halving import FrameProof, TimeParts, Values
from optiplan.verify.joint_constraint_check import (
    expression,
    joint_coupling,
    manipulability,
    of_the_motion,
    part_of,
    title,
    tool_acceleration,
)
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import constraint, covering

_FIRST, _MOST_FIRST = 0.02, 20_000
"""s; intervals to begin with, and about how many at most: a motion of hours is slow, so longer ones do."""


def path_constraints(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    """Return a check for each constraint, or for each of the quantities that it bounds; never none of a constraint."""
    found = []
    for k, one in enumerate(problem.path_constraints):
        low, high = one.during
        checks = _checks_of(one)(problem, trajectory, policy, one) if 0.0 <= low <= high <= 1.0 else []
        found += [covering(check, constraint(k)) for check in checks or [_nothing(one)]]
    return found


def in_tube(one: PathConstraint) -> bool:
    """Return whether the check of a constraint holds wherever the joints are within the tracking error."""
    return isinstance(one, PairClearance | JointCoupling) or bool(measures(one))


def _nothing(one: PathConstraint) -> Check:
    """Return the failed check of a constraint that no check was made of."""
    key = getattr(one, "KEY", type(one).__name__)
    detail = f"no check is known of '{key}' as it is stated here, so nothing was checked of it"
    return Check(title(one), "unchecked", False, detail=detail)


ChecksOf = Callable[[Problem, Trajectory, VerifyPolicy, Any], list[Check]]


def _checks_of(one: PathConstraint) -> ChecksOf:
    """Return what checks a constraint of this kind: without an entry of its own, by what it measures at poses."""
    return _CHECKS.get(type(one), _poses)


def _wheel_speed(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, one: WheelSpeed) -> list[Check]:
    proof = _ConstraintProof(FrameMotion(problem.robot, problem.robot.tool_frame), trajectory, policy)
    limit = one.at_most * (1.0 + RATE_SHARE)
    return [proof.check(one, _Limit("the fastest wheel", "rad/s", limit, _wheels(problem.robot)))]


def _tool_speed(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, one: ToolSpeed) -> list[Check]:
    proof = _ConstraintProof(FrameMotion(problem.robot, one.frame), trajectory, policy)
    limits = [("speed", one.linear, "m/s", 0), ("turning speed", one.angular, "rad/s", 1)]
    return [
        proof.check(one, _Limit(f"{one.frame}: {quantity}", unit, limit * (1.0 + RATE_SHARE), _speeds(which)))
        for quantity, limit, unit, which in limits
        if limit != np.inf
    ]


def _poses(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, one: PathConstraint) -> list[Check]:
    base, frame = one.to if isinstance(one, RelativePose) else None, frame_of(one) or problem.robot.tool_frame
    at = frame if base is None else f"{frame} in {base}"
    proof = _ConstraintProof(FrameMotion(problem.robot, frame, base), trajectory, policy, problem.tracking_error)
    return [
        proof.check(one, _Limit(f"{at}: {each.quantity}", each.unit, each.allowed, _of_pose(each), each.shown))
        for each in measures(one)
    ]


Evaluate = Callable[["_ConstraintProof", TimeParts], Values]


@dataclass(frozen=True, eq=False)
class _Limit:
    """A quantity and its limit; `shown` as of `Measure`."""

    place: str
    unit: str
    limit: float
    values: Evaluate
    shown: Callable[[float], float] = float


class _ConstraintProof(FrameProof):
    """The proof of one quantity of a path constraint."""

    def check(self, one: PathConstraint, limit: _Limit) -> Check:
        """Prove a limit, or refuse it where it is exceeded, or cannot be proved."""
        spans = TimeParts.of(self.trajectory, _FIRST, _MOST_FIRST, one.during)
        found = self.prove(spans, lambda part: limit.values(self, part), limit.limit)
        witness: dict[str, Any] = {"q": self.trajectory(found.time).tolist()}
        worst, allowed, detail = limit.shown(found.worst), limit.shown(limit.limit), found.words(of_the_motion(one))
        proved = not found.reason
        return Check(
            title(one), "continuous", proved, worst, allowed, limit.unit, found.time, limit.place, detail, witness
        )


def _of_pose(measure: Measure) -> Evaluate:
    """Return the values of a measure, with what lies between the ends of intervals.

    A function that is not convex says by itself how much it grows from the middle on. A vector function y deviates
    by at most width² / 8 max |y''| from the chord between its ends, on which a convex function is nowhere larger than
    at the ends; or it is as far from its middle as it can have travelled.
    """

    def values(proof: _ConstraintProof, spans: TimeParts) -> Values:
        poses = [proof.motion.poses(proof.state(spans, share)) for share in (0.0, 0.5, 1.0)]
        ends = [measure.value(X) for X in poses]
        bounds = proof.bounds(spans)
        travel, curvature, step = bounds.travel, bounds.curvature, bounds.step
        if measure.feature != "point":
            factor = 1.0 if measure.feature == "axis" else np.sqrt(3.0)  # three columns
            turning = bounds.turn, bounds.turn_curvature, bounds.turn_step
            travel, curvature, step = (factor * bound for bound in turning)
        chord = np.maximum(ends[0], ends[2]) + 0.125 * spans.width**2 * curvature + step
        met = np.stack(ends)
        which = met.argmax(axis=0)
        times = np.stack([proof.time(spans, share) for share in (0.0, 0.5, 1.0)])
        columns = np.arange(len(which))
        if measure.growth is None:
            bound, least = np.minimum(chord, ends[1] + travel), ends[1] + step
        else:
            bound = ends[1] + measure.growth(poses[1], bounds.travel, bounds.turn)
            least = ends[1] + measure.growth(poses[1], bounds.step, bounds.turn_step)
        return Values(met[which, columns], times[which, columns], bound, least if proof.tubed else ends[1])

    return values


def _speeds(which: int) -> Evaluate:
    """Return the values of the frame's speed (0) or turning speed (1): |v(t)| <= |v(middle)| + width / 2 max |v'|."""

    def values(proof: _ConstraintProof, spans: TimeParts) -> Values:
        speed = np.linalg.norm(proof.motion.twists(proof.state(spans, 0.5), proof.state(spans, 0.5, 1))[which], axis=1)
        bounds = proof.bounds(spans)
        rate = (bounds.curvature, bounds.turn_curvature)[which]
        return Values(speed, proof.time(spans, 0.5), speed + 0.5 * spans.width * rate, speed)

    return values


def _wheels(robot: Robot) -> Evaluate:
    """Return the rate of the fastest wheel: |w(t)| <= |w(middle)| + width / 2 max |w'|.

    With M the wheels' matrix and R(yaw) the base's rotation, w = M diag(R^T, 1) v and w' = M diag(R^T, 1) a +
    M d(R^T)/d(yaw) yaw' v: a row of M has entries 1, 1 and k over the radius, and |x| + |y| <= sqrt(2) |(x, y)|.
    """
    spec = robot.mecanum
    if spec is None:
        raise TypeError(f"{robot.name} has no wheels")
    place = [robot.joint_names.index(name) for name in spec.joints]
    k = spec.half_wheelbase + spec.half_track

    def values(proof: _ConstraintProof, spans: TimeParts) -> Values:
        q, v = proof.state(spans, 0.5), proof.state(spans, 0.5, 1)
        rates = np.array([np.abs(wheel_matrix(robot, at) @ rate).max() for at, rate in zip(q, v, strict=True)])
        speed, acceleration = proof.rates(spans)[..., place]
        change = np.hypot(acceleration[:, 0], acceleration[:, 1]) + speed[:, 2] * np.hypot(speed[:, 0], speed[:, 1])
        rate = (np.sqrt(2.0) * change + k * acceleration[:, 2]) / spec.radius
        return Values(rates, proof.time(spans, 0.5), rates + 0.5 * spans.width * rate, rates)

    return values


def _clearance(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, one: PairClearance) -> Check:
    """Check that named pairs stay apart, by the certificate."""
    model = NamedPairs(problem.robot, problem.scene, one.pairs)
    part, begin = part_of(with_obstacles(trajectory, model.motions), one.during)
    error = np.append(problem.tracking_error, np.zeros(joint_count(model.motions)))
    proof = certify(model, part, replace(policy, clearance=one.at_least), error=error)
    near = proof.nearest
    known = {frozenset((pair.name_a, pair.name_b)) for pair in model.pairs}
    missing = [" – ".join(pair) for pair in one.pairs if frozenset(pair) not in known]
    passed = proof.proved and bool(one.pairs) and not missing
    detail = f"{'proved at all times' if proof.proved else proof.reason}: {proof.intervals} intervals"
    if missing or not one.pairs:
        detail = f"no pair that is checked: {', '.join(missing) or 'none is named'}"
    place = ", ".join(" – ".join(pair) for pair in one.pairs) if near is None else " – ".join(near.pair)
    worst = proof.clearance if proof.proved else None if near is None else near.distance
    time = None if near is None else begin + near.time
    witness = {} if near is None else near.witness(trajectory.n)
    finite = worst if worst is not None and np.isfinite(worst) else None
    return Check("clearance constraint", "continuous", passed, finite, one.at_least, "m", time, place, detail, witness)


_CHECKS: Mapping[type[PathConstraint], ChecksOf] = {
    PairClearance: lambda problem, trajectory, policy, one: [_clearance(problem, trajectory, policy, one)],
    Expression: lambda problem, trajectory, policy, one: [expression(problem, trajectory, one)],
    JointCoupling: lambda problem, trajectory, policy, one: [joint_coupling(problem, trajectory, one)],
    WheelSpeed: _wheel_speed,
    ManipulabilityAbove: lambda problem, trajectory, policy, one: [manipulability(problem, trajectory, one)],
    ToolAcceleration: lambda problem, trajectory, policy, one: tool_acceleration(problem, trajectory, one),
    ToolSpeed: _tool_speed,
    TipOver: lambda problem, trajectory, policy, one: [tip_over(problem, trajectory, policy, one)],
}
