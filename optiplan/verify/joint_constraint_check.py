"""Checks of path constraints on joints, wheels, accelerations and manipulability."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.problem.constraints.base import WHOLE
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.motions import JointCoupling, ManipulabilityAbove, ToolAcceleration
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.constraints.states import RATE_SHARE
from optiplan.problem.problem import Problem
from optiplan.robot.limits import joint_units
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.samples import samples_of_pieces
from optiplan.trajectory.trajectory import States, Trajectory
from optiplan.verify.report import Check
from optiplan.verify.tolerances import POSITION_ROUNDING

_STEP, _LEAST, _MOST = 1e-3, 200, 200_000
"""s between samples, at most; samples in all at least, and about at most: a motion of minutes is slow."""

_IN_A_PIECE = 5
"""Samples of every piece, at least."""


def joint_coupling(problem: Problem, trajectory: Trajectory, one: JointCoupling) -> Check:
    """Check |sum_j c_j q_j - equals| <= within, by the exact extrema of a polynomial.

    With a tracking error e it is less by sum_j |c_j| e_j.
    """
    part, begin = part_of(trajectory, one.during)
    names = list(problem.robot.joint_names)
    weights = np.zeros(len(names))
    for name, weight in one.joints.items():
        weights[names.index(name)] = weight
    sum_ = Trajectory(("sum",), part.breakpoints, (part.coefficients @ weights)[:, :, None])
    found = sum_.extrema_at(0)
    ends = [
        (float(found.low[0]) - one.equals, float(found.t_low[0])),
        (float(found.high[0]) - one.equals, float(found.t_high[0])),
    ]
    worst, when = max((abs(value), begin + time) for value, time in ends)
    place = " + ".join(f"{weight:g} {name}" for name, weight in one.joints.items())
    off = float(np.abs(weights) @ problem.tracking_error)
    passed = worst + off <= one.within + POSITION_ROUNDING
    unit = joint_units("position", problem.robot.revolute[weights != 0.0])
    detail = f"{'holds at all times' if passed else 'beyond its limit'}{of_the_motion(one)}"
    return Check(title(one), "exact", passed, worst, one.within - off, unit, when, place, detail)


def manipulability(problem: Problem, trajectory: Trajectory, one: ManipulabilityAbove) -> Check:
    """Check Yoshikawa's measure of the frame's Jacobian at samples."""
    sampled = _Sampled.of(trajectory, one)
    J = ToolKinematics(problem.robot, one.frame).evaluate(sampled.states[0])[1]
    value = np.prod(np.linalg.svd(J, compute_uv=False), axis=1)
    k = int(np.argmin(value))
    passed = bool(value[k] >= one.at_least - POSITION_ROUNDING)
    found = Check(title(one), "sampled", passed, float(value[k]), one.at_least, place=one.frame)
    return sampled.worst(found, k, one)


def tool_acceleration(problem: Problem, trajectory: Trajectory, one: ToolAcceleration) -> list[Check]:
    """Check the acceleration of the frame's origin and its angular acceleration at samples."""
    sampled, model = _Sampled.of(trajectory, one), problem.robot.model
    data, frame = model.createData(), problem.robot.frame_id(one.frame)
    found = np.empty((len(sampled.times), 6))
    for k, state in enumerate(zip(*sampled.states, strict=True)):
        pin.forwardKinematics(model, data, *state)
        pin.updateFramePlacement(model, data, frame)
        found[k] = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).vector
    limits = [
        ("acceleration", one.linear, "m/s²", slice(0, 3)),
        ("angular acceleration", one.angular, "rad/s²", slice(3, 6)),
    ]
    checks = []
    for quantity, limit, unit, part in limits:
        if limit != np.inf:
            value = np.linalg.norm(found[:, part], axis=1)
            k = int(np.argmax(value))
            passed, place = bool(value[k] <= limit * (1.0 + RATE_SHARE)), f"{one.frame}: {quantity}"
            check = Check(title(one), "sampled", passed, float(value[k]), limit, unit, place=place)
            checks.append(sampled.worst(check, k, one))
    return checks


def expression(problem: Problem, trajectory: Trajectory, one: Expression) -> Check:
    """Check a user's own expression at samples."""
    sampled = _Sampled.of(trajectory, one)
    try:
        value, _ = one.batched(problem.robot)(list(sampled.states))
    except InputError as error:  # such as a frame of an object that is not held then
        return Check(f"{one.name} constraint", "unchecked", False, detail=str(error))
    violation = one.violations(value)
    wrong = ~np.isfinite(violation)
    k = int(np.flatnonzero(wrong)[0]) if wrong.any() else int(np.argmax(violation))
    passed = not wrong.any() and bool(violation[k] <= POSITION_ROUNDING)
    below = np.isfinite(one.lower) and (
        not np.isfinite(one.upper) or value[k].min() - one.lower <= one.upper - value[k].max()
    )
    worst, limit = (value[k].min(), one.lower) if below else (value[k].max(), one.upper)
    check = Check(f"{one.name} constraint", "sampled", passed, float(worst), float(limit), place=one.name)
    found = sampled.worst(check, k, one)
    return replace(found, detail="not finite") if wrong.any() else found


class _Sampled(NamedTuple):
    """Samples of a part of a motion, both sides of every knot among them: times (k,), s, and `states` (k, n) there."""

    times: Array
    states: States

    @classmethod
    def of(cls, trajectory: Trajectory, one: PathConstraint) -> "_Sampled":
        """Return those of the part that a constraint is about."""
        part, begin = part_of(trajectory, one.during)
        least = max(_IN_A_PIECE, -(-_LEAST // len(part.widths)))
        times = samples_of_pieces(part, _STEP, least, _MOST)
        return cls(begin + times, States(*(part(times, order) for order in range(3))))

    def worst(self, check: Check, k: int, one: PathConstraint) -> Check:
        """Return a check with the time and the configuration of its worst sample k, and the number of samples."""
        words = "holds" if check.passed else "beyond its limit"
        detail = f"{words} at {len(self.times)} samples{of_the_motion(one)}"
        return replace(check, time=float(self.times[k]), detail=detail, witness={"q": self.states.q[k].tolist()})


def title(one: PathConstraint) -> str:
    """Return the name of a constraint's check, by its key in a problem file."""
    return f"{getattr(one, 'KEY', type(one).__name__).replace('_', ' ')} constraint"


def of_the_motion(one: PathConstraint) -> str:
    """Return the part of the motion that a constraint is about, in words; nothing where it is all of it."""
    return "" if tuple(one.during) == WHOLE else f" of {one.during[0]:g} to {one.during[1]:g} of the motion"


def part_of(trajectory: Trajectory, during: tuple[float, float]) -> tuple[Trajectory, float]:
    """Return a part of a motion, and when it begins, s."""
    low, high = (share * trajectory.duration for share in during)
    if (low, high) == (0.0, trajectory.duration):
        return trajectory, 0.0
    return cut_trajectory(trajectory, low, max(high, np.nextafter(low, np.inf))), low
