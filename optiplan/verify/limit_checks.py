"""Checks other than collision: each function takes (problem, trajectory, policy) and returns a `Check`."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.problem.goals_and_vias import AllOfGoal
from optiplan.problem.problem import GoalEnd, JointGoal, PoseGoal, Problem, RegionGoal
from optiplan.robot.frames import frame_pose
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.pieces import Defect, defect
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.polynomial_bounds import prove_bounds
from optiplan.verify.continuous.torque import torque
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import covering, masses, tube
from optiplan.verify.tolerances import LARGEST, POSITION_ROUNDING

_MOST_SIZE, _MOST_TIME = 1e15, 1e13  # rad or m, s: sums and powers of larger numbers overflow, or have no digits
_LIFTED = "; `limits: {jerk: none}` in the problem lifts this"


def same_problem(record: Mapping[str, Any], problem: Problem) -> Check:
    """Check that the hash in the record of a run, which every record has, is that of the problem."""
    found = str(record.get("hash") or "")
    if not found:
        return Check("problem", "unchecked", False, detail="run.json has no hash of the problem the run was made from")
    if found == problem.hash:
        return Check("problem", "exact", True, detail="the run was made from this very problem")
    detail = (
        f"the run was made from another problem, '{record.get('name')}' with hash {found:.12}; this one has "
        f"{problem.hash:.12}. To judge its motion alone, give a copy of its trajectory.json outside the folder"
    )
    return Check("problem", "exact", False, detail=detail)


def form(trajectory: Trajectory) -> Check:
    """Check that the data form a trajectory: shapes fit, every number is finite, time increases.

    Sums and shifts of finite numbers may overflow. So sum_k |c_k| h^k is below 1e15 in every piece of h seconds, and
    the motion lasts at most 1e13 s.
    """
    try:
        problem = defect(tuple(trajectory.joint_names), trajectory.breakpoints, trajectory.coefficients)
    except (AttributeError, TypeError, ValueError, IndexError) as error:
        return Check("finite", "exact", False, detail=f"not a trajectory: {error}")
    kinds = {array.dtype for array in (trajectory.breakpoints, trajectory.coefficients)}
    if problem is None and kinds != {np.dtype(np.float64)}:
        problem = Defect("coefficients", f"numbers of type {', '.join(sorted(map(str, kinds)))}", "float64")
    if problem is None:
        problem = _overflow(trajectory)
    if problem is None:
        return Check("finite", "exact", True, detail="shapes fit, numbers are finite, time increases")
    detail = f"found {problem.found}; expected {problem.expected}"
    return Check("finite", "exact", False, place=problem.field, detail=detail)


def _overflow(trajectory: Trajectory) -> Defect | None:
    """Return where numbers are too large to compute with; None where they are not."""
    if trajectory.breakpoints[-1] > _MOST_TIME:
        return Defect("breakpoints", f"a motion of {trajectory.breakpoints[-1]:.3g} s", f"at most {_MOST_TIME:g} s")
    powers = np.diff(trajectory.breakpoints)[:, None] ** np.arange(trajectory.coefficients.shape[1])
    with np.errstate(over="ignore"):
        size = np.einsum("mkn,mk->mn", np.abs(trajectory.coefficients), powers).max(axis=1)
    piece = int(np.argmax(size))
    if size[piece] < _MOST_SIZE:
        return None
    found = f"terms of {size[piece]:.3g} rad or m in piece {piece + 1}"
    return Defect("coefficients", found, f"terms below {_MOST_SIZE:g}, so that sums of them mean something")


def joints(problem: Problem, trajectory: Trajectory) -> Check:
    """Check that the columns are the robot's planned joints, in its order."""
    found, expected = trajectory.joint_names, problem.robot.joint_names
    if found == expected:
        return Check("joints", "exact", True, detail="names and order are the robot's", covers=("robot.joints",))
    return Check("joints", "exact", False, detail=f"found {', '.join(found)}; expected {', '.join(expected)}")


def far_motions(problem: Problem, trajectory: Trajectory) -> Iterator[Check]:
    """Yield a failed check of each motion of the scene, or of what a step goes with, whose terms are beyond `LARGEST`.

    At later times its polynomials are sums of these terms, known to a share of the largest one only.
    """
    moving = {one.name: one.motion for one in problem.scene.dynamic_obstacles}
    moving |= {one.ride.mover.name: one.ride.mover.motion for one in problem.task if one.ride is not None}
    for name, motion in moving.items():
        largest = 0.0 if motion is None else motion.largest_term(trajectory.duration)
        if not largest <= LARGEST:
            detail = f"the motion of '{name}' has terms of {largest:.3g} m or rad; above {LARGEST:g} no digits are left"
            yield Check("motion", "exact", False, largest, LARGEST, "m or rad", trajectory.duration, name, detail)


def start_position(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """max_j |q_j(0) - start_j| <= position_tolerance."""
    error = np.abs(trajectory.start - problem.start)
    allowed = np.full(len(error), policy.position_tolerance)
    blank = Check("start", "exact", False, covers=("start",))
    return _largest(problem, blank, "position", error, allowed, np.zeros(len(error)))


def goal(problem: Problem, trajectory: Trajectory) -> Check:
    """Check that the end lies in one of the goals, each within its own tolerance.

    A goal that nothing can be measured of is not reached.
    """
    found = [parts for one in problem.goal if (parts := miss(problem, one, trajectory.end))]
    if not found:
        return Check("goal", "unchecked", False, detail="there is no goal that anything can be measured of")
    worsts = [max(parts, key=lambda part: (np.isnan(part.ratio), part.ratio)) for parts in found]
    ratios = [np.inf if np.isnan(worst.ratio) else worst.ratio for worst in worsts]
    nearest = int(np.argmin(ratios))
    worst = worsts[nearest]
    detail = f"nearest is goal {nearest + 1} of {len(found)}" if len(found) > 1 else ""
    passed = bool(ratios[nearest] <= 1.0)
    time = trajectory.duration
    return Check("goal", "exact", passed, worst.error, worst.limit, worst.unit, time, worst.what, detail)


class Miss(NamedTuple):
    """How far a part of a goal or via is missed, and by how much it may be, in `unit`."""

    error: float
    limit: float
    what: str
    unit: str

    @property
    def ratio(self) -> float:
        """Share of the tolerance and its rounding: at most 1 where it is met."""
        return self.error / (self.limit + POSITION_ROUNDING)


def miss(problem: Problem, one: GoalEnd, q: Array) -> list[Miss]:
    """Return how far q misses each part of a goal: joints together, or coordinates of a pose; nothing of another."""
    robot = problem.robot
    if isinstance(one, JointGoal):
        error = q - one.q
        turned = np.remainder(error + np.pi, 2.0 * np.pi) - np.pi
        error = np.abs(np.where(robot.endless, turned, error))
        worst = int(np.argmax(error))
        return [Miss(float(error[worst]), one.tolerance, robot.joint_names[worst], robot.unit("position", worst))]
    if isinstance(one, AllOfGoal):
        parts = [miss(problem, part, q) for part in one.parts]
        return [found for part in parts for found in part] if parts and all(parts) else []
    if not isinstance(one, PoseGoal | RegionGoal):
        return []
    X_WF = frame_pose(robot, q, one.frame)
    if isinstance(one, RegionGoal):
        return _out_of_region(one, X_WF)
    offset, angle = pose_error(one.X_WG, X_WF)
    return [
        Miss(offset, one.position, f"{one.frame} position", "m"),
        Miss(angle, one.orientation, f"{one.frame} orientation", "rad"),
    ]


def _out_of_region(one: RegionGoal, X_WF: pin.SE3) -> list[Miss]:
    """Return the miss of each bounded coordinate: its distance from the middle, or from one bound."""
    parts = []
    for k, (c, low, high) in enumerate(zip(one.coordinates(X_WF), one.low, one.high, strict=True)):
        way = f"{'along' if k < 3 else 'about'} {'xyz'[k % 3]} {'position' if k < 3 else 'orientation'}"
        unit = "m" if k < 3 else "rad"
        if np.isfinite(low) and np.isfinite(high):
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            parts.append(Miss(float(abs(c - middle)), float(half), f"{one.frame} {way}", unit))
        elif np.isfinite(low) or np.isfinite(high):
            beyond = low - c if np.isfinite(low) else c - high
            parts.append(Miss(max(0.0, float(beyond)), 0.0, f"{one.frame} {way}", unit))
    return parts


def of_the_whole(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    """Return the checks of ends and limits, which are the same of a task and of a motion to one goal."""
    return [
        covering(rest(problem, trajectory, policy), "start_velocity", "start_acceleration"),
        continuity(problem, trajectory, policy),
        covering(position(problem, trajectory, policy), "limits.lower", "limits.upper", *tube(problem, "limits")),
        *(covering(rate(problem, trajectory, policy, k), f"limits.{ORDERS[k]}") for k in (1, 2, 3)),
    ]


def rest(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Velocity and, of joints with a jerk limit, acceleration vanish at both ends; else the jerk would be infinite.

    Where the problem states velocities or accelerations at an end (then the check is called `ends`), the motion has
    them: a stated acceleration also in joints whose jerk is not limited. The motion is held against the state of each
    goal within whose tolerance it ends, of all goals where there is none; the nearest is reported.
    """
    ends, limits = np.array([0.0, trajectory.duration]), problem.limits
    found = np.stack(trajectory.states(ends)[1:])  # (order, end, n)
    checks = []
    for state in _arrivals(problem, trajectory.end):
        stated = np.stack([[problem.start_velocity, state.v], [problem.start_acceleration, state.a]])
        free = np.isinf(limits.jerk) & (stated[1] == 0.0)
        acceleration = np.where(free, np.inf, policy.rest_tolerance * limits.acceleration)
        allowed = np.stack([np.broadcast_to(policy.rest_tolerance * limits.velocity, free.shape), acceleration])
        checks.append(_at_ends(problem, np.abs(found - stated), allowed, trajectory.duration))
    return min(checks, key=lambda pair: pair[1])[0]


def _arrivals(problem: Problem, q: Array) -> list[State]:
    """Return the states in which a motion to q (n,) may arrive: those of the goals reached, so of no other goal."""
    misses = [(one, miss(problem, one, q)) for one in problem.goal]
    reached = [one for one, parts in misses if parts and all(part.ratio <= 1.0 for part in parts)]
    states = [one.state if isinstance(one, JointGoal) else State(q) for one in reached or problem.goal]
    return states or [State(q)]


def _at_ends(problem: Problem, value: Array, allowed: Array, duration: float) -> tuple[Check, float]:
    """Return the check of deviations (order, end, n) at both ends, and the largest share of what is allowed."""
    order, end, j = _worst(value, allowed)
    name = "ends" if problem.nonzero_ends else "rest"
    what = f"{ORDERS[order + 1]} at the {'end' if end else 'start'}"
    detail = f"{what}, off what the problem states" if problem.nonzero_ends else what
    worst, limit = float(value[order, end, j]), float(allowed[order, end, j])
    passed = bool((value <= allowed).all())
    detail += "" if passed or order == 0 or problem.nonzero_ends else _LIFTED
    time = duration if end else 0.0
    joint, unit = problem.robot.joint_names[j], problem.robot.unit(ORDERS[order + 1], j)
    return Check(name, "exact", passed, worst, limit, unit, time, joint, detail), worst / limit


def continuity(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Position, velocity and acceleration hardly jump: the steps at all breakpoints together stay within tolerance.

    Together, because many steps, each within a tolerance, would make a staircase that passes any limit unseen. The
    acceleration of a joint without a jerk limit may jump.
    """
    n = trajectory.n
    if len(trajectory.breakpoints) == 2:
        return Check("continuity", "exact", True, detail="one piece")
    jumps = np.abs(np.stack([trajectory.jumps(order) for order in range(3)]))  # (order, m - 1, n)
    speed = policy.rest_tolerance * problem.limits.velocity
    steps = [np.full(n, policy.jump_tolerance), speed, _acceleration_step(problem, policy)]
    total, allowed = jumps.sum(axis=1), np.stack(steps)
    order, j = _worst(total, allowed)
    i = int(np.argmax(jumps[order, :, j]))
    time, name = float(trajectory.breakpoints[i + 1]), problem.robot.joint_names[j]
    worst, limit = float(total[order, j]), float(allowed[order, j])
    passed, detail = bool((total <= allowed).all()), f"sum of all steps of {ORDERS[order]}"
    detail += "" if passed or order < 2 else _LIFTED
    unit = problem.robot.unit(ORDERS[order], j)
    return Check("continuity", "exact", passed, worst, limit, unit, time, name, detail)


def _acceleration_step(problem: Problem, policy: VerifyPolicy) -> Array:
    """Return the allowed jump of acceleration, (n,): a tolerance where jerk is limited, infinite elsewhere."""
    limits = problem.limits
    return np.where(np.isinf(limits.jerk), np.inf, policy.rest_tolerance * limits.acceleration)


def position(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Lower - tolerance <= q <= upper + tolerance at all times, by `prove_bounds`; reported are the extrema.

    With a tracking error e: lower + e - tolerance <= q <= upper - e + tolerance.
    """
    e, error = trajectory.extrema_at(0), problem.tracking_error
    lower, upper = problem.limits.lower + error, problem.limits.upper - error
    beyond = np.stack([lower - e.low, e.high - upper])  # negative inside
    side, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    worst, limit, time = [(e.low, lower, e.t_low), (e.high, upper, e.t_high)][side]
    detail, name = f"nearest to its {('lower', 'upper')[side]} limit", problem.robot.joint_names[j]
    detail += f", less the tracking error of {error[j]:.4g}" if error[j] else ""
    unit = problem.robot.unit("position", int(j))
    check = Check("position", "exact", True, float(worst[j]), float(limit[j]), unit, float(time[j]), name, detail)
    tolerance = policy.position_tolerance
    between = _Between(0, lower - tolerance, upper + tolerance, np.full(trajectory.n, POSITION_ROUNDING))
    return _proved(check, problem, trajectory, between)


def rate(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, order: int) -> Check:
    """|d^order q / dt^order| <= limit (1 + tolerance) at all times, by `prove_bounds`; order 1, 2 or 3.

    Reported is the extremum that comes nearest to its limit.
    """
    limits = problem.limits.rates[order - 1]
    e = trajectory.extrema_at(order)
    magnitude = np.maximum(np.abs(e.low), np.abs(e.high))
    time = np.where(np.abs(e.low) > np.abs(e.high), e.t_low, e.t_high)
    allowed = limits * (1.0 + policy.limit_tolerance)
    check = _largest(problem, Check(ORDERS[order], "exact", False), ORDERS[order], magnitude, allowed, time)
    between = _Between(order, -allowed, allowed, policy.limit_tolerance * limits)
    found = _proved(replace(check, passed=True), problem, trajectory, between)
    return found if found.passed or found.detail or order < 3 else replace(found, detail=_LIFTED.removeprefix("; "))


class _Between(NamedTuple):
    """Bounds of the derivative of this order, and the largest rounding of a sum of its terms that is accepted: (n,)."""

    order: int
    low: Array
    high: Array
    rounding: Array


def _proved(check: Check, problem: Problem, trajectory: Trajectory, asked: _Between) -> Check:
    """Return the check, refused where a derivative is not proved to stay between its bounds.

    Where no extremum shows it, because the terms of a polynomial cancel beyond the digits of their sum, its piece is
    named.
    """
    c = trajectory.unit_pieces(asked.order)
    m, n, size = c.shape
    found = prove_bounds(c.reshape(-1, size), np.tile(asked.low, m), np.tile(asked.high, m))
    rounding, within = found.rounding.reshape(m, n), found.within.reshape(m, n)
    sound = within & (rounding <= asked.rounding)
    if sound.all():
        return check
    extrema = trajectory.extrema_at(asked.order)
    if (extrema.low < asked.low).any() or (extrema.high > asked.high).any():
        return replace(check, passed=False)
    piece, j = divmod(int(np.argmax(np.where(sound, -1.0, rounding))), n)
    degree, time, width = trajectory.coefficients.shape[1] - 1, trajectory.breakpoints[piece], trajectory.widths[piece]
    detail = (
        f"not proved: in piece {piece + 1}, of degree {degree} and {width:.3g} s, large terms cancel: "
        f"their sum is known to {rounding[piece, j]:.2g} {problem.robot.unit(ORDERS[asked.order], j)} only"
    )
    return replace(check, passed=False, time=float(time), place=problem.robot.joint_names[j], detail=detail)


def _largest(problem: Problem, blank: Check, quantity: str, value: Array, allowed: Array, time: Array) -> Check:
    """Fill in value (n,) <= allowed (n,), at time (n,), with the joint nearest to or farthest beyond its limit."""
    (j,) = _worst(value, allowed)
    passed, joint = bool((value <= allowed).all()), problem.robot.joint_names[j]
    found = replace(blank, passed=passed, worst=float(value[j]), limit=float(allowed[j]), time=float(time[j]))
    return replace(found, unit=problem.robot.unit(quantity, j), place=joint)


def _worst(value: Array, allowed: Array) -> tuple[int, ...]:
    """Index of the largest value relative to what is allowed; a limit of 0 passed by anything counts most."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = value / allowed
    ratio[np.isnan(ratio)] = 0.0
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(ratio)), value.shape))


def loaded_torque(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Check torques, of the masses too that the robot of the problem carries."""
    return covering(torque(problem, trajectory, policy), "limits.torque", *masses(problem.scene, problem.robot))
