"""Path constraints as expressions of the robot's state: one function for each kind of statement."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.mecanum import Mecanum
from optiplan.kinematics.symbolic.state import SymbolicState
from optiplan.planners.trajopt.terms.expression import Room
from optiplan.problem.constraints.base import circle_of
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.statements import (
    FixedOrientation,
    JointCoupling,
    LookAt,
    ManipulabilityAbove,
    OnArc,
    OnCircle,
    OnLine,
    OnPlane,
    OnScrew,
    OrientationCone,
    PathConstraint,
    PositionBox,
    RelativePose,
    ToolAcceleration,
    ToolSpeed,
    WheelSpeed,
)
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.regions.region import RegionGoal

LENGTH, ANGLE = 0.01, 0.05
"""m and rad: violations that cost as much as a missing centimetre of clearance, where tolerances are wide."""

_FINE = 5.0
"""Times its tolerance that the unit of a constraint is at most, if that is less."""

_RESERVE = 0.1
"""Share of a tolerance kept for what happens between samples …"""

_MOST_RESERVE = 0.1
"""… but no more than this share of `LENGTH` and `ANGLE`."""

_NARROW = 0.02
"""rad or m: within less than this, every coordinate gets rows of its own, so that a step cannot leave sideways."""

_ACROSS, _BEYOND = 0.8, 0.6
"""Shares of a tolerance that a point may be off a segment to the side, and beyond its ends: 0.8² + 0.6² = 1."""

_OWN_UNIT, _OWN_RESERVE = 0.05, 1e-3
"""Unit and reserve of a user's own expression, as shares of a change of it that matters."""

_OF_GOAL = 0.9
"""Share of a goal's tolerance that a free end may use."""

_TINY = 1e-14
"""Added to squares, so that lengths have derivatives at zero."""

_SPEED_RESERVE = 0.003
"""Share of a speed or acceleration kept likewise."""


def rooms(one: PathConstraint) -> list[Room]:
    """Return the expressions of a path constraint; none for clearance, which is no expression."""
    make = _KINDS.get(type(one))
    return [] if make is None else [replace(room, during=one.during) for room in make(one)]


def end_rooms(goal: PoseGoal | RegionGoal) -> list[Room]:
    """Return the expressions that hold a goal at the end of a motion: position, and orientation where that counts."""
    found = _region(goal.inner(_OF_GOAL)) if isinstance(goal, RegionGoal) else _pose(goal)
    return [replace(room, during=(1.0, 1.0), reserve=0.0) for room in found]


def _region(goal: RegionGoal) -> list[Room]:
    """Each coordinate of the region above its lower and below its upper bound."""
    to_region, back = goal.X_WR.inverse(), goal.X_RF.inverse()

    def along(k: SymbolicState) -> Any:
        X = k.pose(goal.frame)
        p = X.p + X.R @ k.constant(back.translation)
        return _between(
            k, k.constant(to_region.rotation) @ p + k.constant(to_region.translation), goal.low[:3], goal.high[:3]
        )

    def about(k: SymbolicState) -> Any:
        R = k.constant(to_region.rotation) @ k.pose(goal.frame).R @ k.constant(back.rotation)
        return _between(k, _vector(R) if not goal.free else _tilt(R, goal.free[0]), goal.low[3:], goal.high[3:])

    parts = ((along, slice(0, 3), LENGTH), (about, slice(3, 6), ANGLE))
    widths = goal.high - goal.low
    narrow = [float(np.min(widths[part])) for _, part, _ in parts]
    return [
        _room("goal", build, 0.5 * width, unit)
        for (build, _, unit), width in zip(parts, narrow, strict=True)
        if np.isfinite(width)
    ]


def _between(k: SymbolicState, c: Any, low: Array, high: Array) -> Any:
    rows = [c[j] - k.constant(low[j]) for j in range(3) if np.isfinite(low[j])]
    rows += [k.constant(high[j]) - c[j] for j in range(3) if np.isfinite(high[j])]
    return _stacked(*rows)


def _vector(R: Any) -> Any:
    """Return log(R), rad, of a rotation by less than a half turn, by its quaternion."""
    import casadi

    w = 0.5 * casadi.sqrt(casadi.fmax(1.0 + R[0, 0] + R[1, 1] + R[2, 2], _TINY))
    v = _stacked(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / (4.0 * w)
    sine = casadi.sqrt(v.T @ v + _TINY)
    return 2.0 * casadi.atan2(sine, w) / sine * v


def _tilt(R: Any, axis: int) -> Any:
    """Return the vector, rad, of the shortest rotation that takes an axis where R takes it."""
    import casadi

    a, e = R[:, axis], np.eye(3)[axis]
    across = casadi.cross(casadi.DM(e), a)
    sine = casadi.sqrt(across.T @ across + _TINY)
    return casadi.atan2(sine, a[axis]) / sine * across


def _pose(goal: PoseGoal) -> list[Room]:
    X = goal.X_WG
    position, orientation = _OF_GOAL * goal.position, _OF_GOAL * goal.orientation

    def off(k: SymbolicState) -> Any:
        return _ball(k, k.pose(goal.frame).p - k.constant(X.translation), position)

    def turned(k: SymbolicState) -> Any:
        return _turned(k, k.constant(X.rotation.T) @ k.pose(goal.frame).R, orientation)

    found = [_room("goal", off, position, LENGTH)]
    return found + ([_room("goal", turned, orientation, ANGLE)] if goal.orientation < np.pi else [])


def _room(name: str, build: Callable[[SymbolicState], Any], tolerance: float, unit: float) -> Room:
    fine = min(unit, max(_FINE * tolerance, 0.1 * unit))
    return Room(name, build, fine, min(_RESERVE * tolerance, _MOST_RESERVE * unit))


def _cone(one: OrientationCone) -> list[Room]:
    """Axis a within an angle w of d: (a · d - cos w) / sin w, or each coordinate of a - d where w is small."""
    within = min(one.within, np.pi)

    def wide(k: SymbolicState) -> Any:
        axis = k.pose(one.frame).R @ k.constant(one.axis)
        return (axis.T @ k.constant(one.toward) - k.constant(np.cos(within))) / k.constant(max(np.sin(within), 0.1))

    def narrow(k: SymbolicState) -> Any:
        return _box(k, k.pose(one.frame).R @ k.constant(one.axis) - k.constant(one.toward), within)

    return [_room("orientation", narrow if within < _NARROW else wide, within, ANGLE)]


def _position(one: PositionBox) -> list[Room]:
    X, half = one.X_WC, 0.5 * np.asarray(one.size)

    def build(k: SymbolicState) -> Any:
        local = k.constant(X.rotation.T) @ (k.pose(one.frame).p - k.constant(X.translation))
        return _stacked(k.constant(half) - local, k.constant(half) + local)

    return [_room("position", build, float(half.min()), LENGTH)]


def _plane(one: OnPlane) -> list[Room]:
    def build(k: SymbolicState) -> Any:
        height = k.constant(one.normal).T @ k.pose(one.frame).p - k.constant(one.offset)
        return _stacked(k.constant(one.within) - height, k.constant(one.within) + height)

    return [_room("plane", build, one.within, LENGTH)]


def _line(one: OnLine) -> list[Room]:
    """Across the line within the tolerance in two directions, and along it between its ends."""
    along = one.end - one.start
    length = float(np.linalg.norm(along))
    direction = along / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
    sides = np.linalg.svd(direction[None])[2][1:]

    def build(k: SymbolicState) -> Any:
        p = k.pose(one.frame).p - k.constant(one.start)
        across, s = k.constant(sides) @ p, k.constant(direction).T @ p
        within, beyond = k.constant(_ACROSS * one.within / np.sqrt(2.0)), k.constant(_BEYOND * one.within)
        return _stacked(within - across, within + across, s + beyond, k.constant(length) + beyond - s)

    return [_room("line", build, _BEYOND * one.within, LENGTH)]


def _tool_speed(one: ToolSpeed) -> list[Room]:
    def share(which: str, limit: float) -> Callable[[SymbolicState], Any]:
        def build(k: SymbolicState) -> Any:
            rate = getattr(k.twist(one.frame), which) / k.constant(limit)
            return 0.5 * (1.0 - rate.T @ rate)

        return build

    limits = [("linear", one.linear), ("angular", one.angular)]
    return [
        Room("tool speed", share(which, limit), 0.25, _SPEED_RESERVE, rate=1)
        for which, limit in limits
        if np.isfinite(limit)
    ]


def _relative(one: RelativePose) -> list[Room]:
    p, R = one.X_TF.translation, one.X_TF.rotation

    def off(k: SymbolicState) -> Any:
        return _ball(k, k.relative_pose(one.frame, one.to).p - k.constant(p), one.position)

    def turned(k: SymbolicState) -> Any:
        return _turned(k, k.constant(R.T) @ k.relative_pose(one.frame, one.to).R, one.orientation)

    return [
        _room("relative pose", off, one.position, LENGTH),
        _room("relative pose", turned, min(one.orientation, np.pi), ANGLE),
    ]


def _acceleration(one: ToolAcceleration) -> list[Room]:
    def share(which: str, limit: float) -> Callable[[SymbolicState], Any]:
        def build(k: SymbolicState) -> Any:
            rate = getattr(k.acceleration(one.frame), which) / k.constant(limit)
            return 0.5 * (1.0 - rate.T @ rate)

        return build

    limits = [("linear", one.linear), ("angular", one.angular)]
    return [
        Room("tool acceleration", share(which, limit), 0.25, 2.0 * _SPEED_RESERVE, rate=2)
        for which, limit in limits
        if np.isfinite(limit)
    ]


def _wheels(one: WheelSpeed) -> list[Room]:
    def build(k: SymbolicState) -> Any:
        spec = k.robot.mecanum
        if spec is None:
            raise TypeError(f"{k.robot.name} has no wheels")
        x, y, turn = (list(k.robot.joint_names).index(name) for name in spec.joints)
        matrix = k.constant(Mecanum(spec.radius, spec.half_wheelbase, spec.half_track).matrix)
        cosine, sine = k.cos(k.q[turn]), k.sin(k.q[turn])
        ahead, aside = cosine * k.v[x] + sine * k.v[y], cosine * k.v[y] - sine * k.v[x]
        share = matrix @ _stacked(ahead, aside, k.v[turn]) / k.constant(one.at_most)
        return 0.5 * (1.0 - share * share)

    return [Room("wheel speed", build, 0.25, _SPEED_RESERVE, rate=1)]


def _manipulability(one: ManipulabilityAbove) -> list[Room]:
    least = one.at_least

    def build(k: SymbolicState) -> Any:
        return k.manipulability(one.frame) - k.constant(least)

    return [Room("manipulability", build, 0.2 * least, 0.01 * least)]


def _coupling(one: JointCoupling) -> list[Room]:
    def build(k: SymbolicState) -> Any:
        off = sum(k.constant(weight) * k.joint(name) for name, weight in one.joints.items()) - k.constant(one.equals)
        return _stacked(k.constant(one.within) - off, k.constant(one.within) + off)

    return [_room("coupling", build, one.within, ANGLE)]


def _fixed(one: FixedOrientation) -> list[Room]:
    def build(k: SymbolicState) -> Any:
        return _turned(k, k.constant(np.asarray(one.R_WF).T) @ k.pose(one.frame).R, one.within)

    return [_room("fixed orientation", build, min(one.within, np.pi), ANGLE)]


def _look(one: LookAt) -> list[Room]:
    """Axis a and ray r to the target: (a · r / |r| - cos w) / sin w."""

    def build(k: SymbolicState) -> Any:
        X = k.pose(one.frame)
        ray, axis = k.constant(one.target) - X.p, X.R @ k.constant(one.axis)
        if one.within < _NARROW:
            return _box(k, ray / k.norm(ray) - axis, one.within)
        return (axis.T @ ray / k.norm(ray) - k.constant(np.cos(one.within))) / k.constant(np.sin(one.within))

    return [_room("look at", build, one.within, ANGLE)]


def _circle(one: OnCircle) -> list[Room]:
    def build(k: SymbolicState) -> Any:
        return _box(k, _off_circle(k, k.pose(one.frame).p, one.centre, one.normal, one.radius), one.within)

    return [_room("circle", build, one.within / np.sqrt(2.0), LENGTH)]


def _arc(one: OnArc) -> list[Room]:
    """Near the circle, and on the arc's side of it: the angle from its middle is no more than half of it."""
    centre, normal, radius, angle = circle_of(one.start, one.through, one.end)
    x = (one.start - centre) / radius
    middle = np.cos(0.5 * angle) * x + np.sin(0.5 * angle) * np.cross(normal, x)
    across = np.cross(normal, middle)

    def build(k: SymbolicState) -> Any:
        p = k.pose(one.frame).p
        near = _box(k, _off_circle(k, p, centre, normal, radius), _ACROSS * one.within)
        local = p - k.constant(centre)
        turned = k.atan2(k.constant(across).T @ local, k.constant(middle).T @ local)
        allowed = k.constant(0.5 * angle * radius + _BEYOND * one.within)
        return _stacked(near, allowed - k.constant(radius) * turned, allowed + k.constant(radius) * turned)

    return [_room("arc", build, _BEYOND * one.within, LENGTH)]


def _off_circle(k: SymbolicState, p: Any, centre: Array, normal: Array, radius: float) -> Any:
    """How far a point is from a circle: (radially, along its axis)."""
    local, axis = p - k.constant(centre), k.constant(normal)
    height = axis.T @ local
    return _stacked(k.norm(local - height * axis) - k.constant(radius), height)


def _screw(one: OnScrew) -> list[Room]:
    """The frame turns about the axis alone, is where that puts it, and slides as far, of several turns the nearest."""
    R, p = np.asarray(one.X_WF.rotation), np.asarray(one.X_WF.translation) - one.point
    sides = np.linalg.svd(one.axis[None])[2][1:]

    def parts(k: SymbolicState) -> tuple[Any, Any, Any]:
        X, axis = k.pose(one.frame), k.constant(one.axis)
        D = X.R @ k.constant(R.T)
        skew = _stacked(D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1])
        turn = _stacked(D[0, 0] + D[1, 1] + D[2, 2] - axis.T @ D @ axis, axis.T @ skew)
        cosine, sine = (turn[i] / k.norm(turn) for i in range(2))
        along, across = k.constant(one.axis * (one.axis @ p)), k.constant(np.cross(one.axis, p))
        off = X.p - k.constant(one.point) - along - cosine * (k.constant(p) - along) - sine * across
        return D, off, turn

    def turned(k: SymbolicState) -> Any:
        D, _, _ = parts(k)
        return _box(k, k.constant(sides) @ (D @ k.constant(one.axis)), one.orientation)

    def slid(k: SymbolicState) -> Any:
        _, off, turn = parts(k)
        along = k.constant(one.axis).T @ off
        if one.pitch != 0.0:
            left = along / k.constant(one.pitch) - k.atan2(turn[1], turn[0])
            along = k.constant(one.pitch) * k.atan2(k.sin(left), k.cos(left))
        return _box(k, _stacked(k.constant(sides) @ off, along), one.position)

    return [
        _room("screw", slid, one.position / np.sqrt(3.0), LENGTH),
        _room("screw", turned, one.orientation / np.sqrt(2.0), ANGLE),
    ]


def _expression(one: Expression) -> list[Room]:
    """A user's own: f - lower and upper - f, of the bounds that there are."""

    def build(k: SymbolicState) -> Any:
        value = _stacked(one.build(k))
        sides = [value - k.constant(one.lower)] if np.isfinite(one.lower) else []
        sides += [k.constant(one.upper) - value] if np.isfinite(one.upper) else []
        return _stacked(*sides)

    reserve = min(_OWN_RESERVE * one.size, _RESERVE * (one.upper - one.lower))
    return [Room(one.name, build, _OWN_UNIT * one.size, reserve, finite=one.finite)]


def _turned(k: SymbolicState, R: Any, within: float) -> Any:
    """Rotation R by less than an angle: (cos - cos w) / sin w, with the coordinates of sin times axis if w is small."""
    within = min(within, np.pi)
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if within >= _NARROW:
        return (cosine - k.constant(np.cos(within))) / k.constant(max(np.sin(within), 0.1))
    axis = 0.5 * _stacked(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return _stacked(_box(k, axis, within), cosine)


def _ball(k: SymbolicState, e: Any, radius: float) -> Any:
    """|e| <= radius, in each coordinate if that is small."""
    if radius < _NARROW:
        return _box(k, e, radius)
    return (k.constant(radius**2) - e.T @ e) / k.constant(2.0 * radius)


def _box(k: SymbolicState, e: Any, radius: float) -> Any:
    """|e_i| <= radius / sqrt(number of coordinates)."""
    within = k.constant(radius / np.sqrt(e.shape[0]))
    return _stacked(within - e, within + e)


def _stacked(*parts: Any) -> Any:
    import casadi

    return casadi.vertcat(*parts)


_KINDS: dict[type[Any], Callable[[Any], list[Room]]] = {
    OrientationCone: _cone,
    PositionBox: _position,
    OnPlane: _plane,
    OnLine: _line,
    ToolSpeed: _tool_speed,
    RelativePose: _relative,
    ToolAcceleration: _acceleration,
    WheelSpeed: _wheels,
    ManipulabilityAbove: _manipulability,
    JointCoupling: _coupling,
    FixedOrientation: _fixed,
    LookAt: _look,
    OnCircle: _circle,
    OnArc: _arc,
    OnScrew: _screw,
    Expression: _expression,
}
