"""`JointBox`: what the limits of single joints leave of the velocity at the end of a step, never nothing."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.braking import braking_accelerations, farthest, velocity_to_zero
from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.joint_limits import JointLimit, PositionLimit
from optiplan.trajectory.state import State

ROUNDING = 1e-10
"""rad or m, of positions at their limits: what rounding may cost."""
_CODES = ("acceleration", "jerk", "velocity", "position")
"""Names of the limits by their numbers in the native core."""
AT_BOUND = 1e-9
"""rad/s or m/s: velocities nearer than this to a bound are held back by it."""


@dataclass(frozen=True, slots=True, eq=False)
class JointBrakes:
    """How joints brake: accelerations (k,) at most, and their changes (k,) from step to step."""

    acceleration: Array
    change: Array

    @property
    def acceleration_list(self) -> list[float]:
        """The same as floats."""
        return [float(value) for value in self.acceleration]

    @property
    def change_list(self) -> list[float]:
        """The same as floats."""
        return [float(value) for value in self.change]


class JointBox:
    """Bounds low <= x <= high of the velocities x (n,) at the end of a step.

    Each limit is an interval a joint. They are intersected in the order of their importance; where nothing is left, the
    end nearest to the less important limit is taken, so that the fastest admissible way back within it is what remains.

    Args:
        limits: those of single joints among them count.
        order: names of limits, the least important first.
        n: number of joints.

    Attributes:
        delay: (n,), s, that the acceleration of a joint takes from its limit to zero.
    """

    def __init__(self, limits: Iterable[ControlLimit], order: Sequence[str], n: int) -> None:
        found = {limit.name: limit for limit in limits if isinstance(limit, JointLimit | PositionLimit)}
        self._names = [name for name in reversed(order) if name in found]
        rates = {name: limit.values for name, limit in found.items() if isinstance(limit, JointLimit)}
        without = np.full(n, np.inf)
        self.velocity = rates.get("velocity", without)
        self.acceleration = rates.get("acceleration", without)
        self.jerk = rates.get("jerk", without)
        position = found.get("position")
        self.lower = position.lower if isinstance(position, PositionLimit) else -without
        self.upper = position.upper if isinstance(position, PositionLimit) else without
        bounded = np.isfinite(self.jerk) & np.isfinite(self.acceleration)
        self.delay = np.divide(self.acceleration, self.jerk, out=np.zeros(n), where=bounded)
        self._dt = 0.0
        self.low, self.high = -without, without.copy()
        self._intervals: list[tuple[str, Array, Array]] = []
        rated = np.isfinite([self.velocity, self.acceleration, self.jerk]).all()
        self._table: Array | None = np.zeros((8, n)) if core is not None and rated else None
        self._codes = [_CODES.index(name) for name in self._names]
        self._braked: State | None = None

    def prepare(self, dt: float) -> None:
        """Everything that depends on dt alone."""
        self._dt = dt
        self.change = dt * self.jerk
        self.acceleration_list, self.change_list = self.acceleration.tolist(), self.change.tolist()
        reach = [
            farthest(v, a, a, change, dt) + 2.0 * dt * v if math.isfinite(v) and math.isfinite(a) else math.inf
            for v, a, change in zip(self.velocity.tolist(), self.acceleration_list, self.change_list, strict=True)
        ]
        self._safe = self.lower + reach, self.upper - reach  # joints between these need no look at their ends
        self._give = self.acceleration * dt
        limits = zip(self.acceleration_list, self.change_list, strict=True)
        gains = [velocity_to_zero(a, c, dt) if math.isfinite(a) else math.inf for a, c in limits]
        self._slow = self.velocity - gains  # below these no acceleration within limits is too much
        self._sudden = np.isinf(self.acceleration)
        if self._table is not None:
            ends = self.lower, self.upper, *self._safe
            self._table = np.array([self.velocity, self.acceleration, self.change, *ends, self._slow])

    def brakes_of(self, joints: list[int]) -> JointBrakes:
        """How some joints brake, in steps of the last update."""
        return JointBrakes(self.acceleration[joints], self.change[joints])

    def update(self, state: State, dt: float, shift: float) -> None:
        """Bounds for a step from a state; `shift` · v is what q moves on before the new velocity counts, s."""
        if dt != self._dt:
            self.prepare(dt)
        v = state.v
        self._braked = None
        if self._table is not None:
            found = core.joint_box(state.q, v, state.a, self._table, self._codes, dt, shift)
            self.low, self.high, own, made, self._brake = found
            self._intervals = [(_CODES[code], *own[k]) for k, code in enumerate(made)]
            self._braked = state
            return
        low, high = np.full(len(v), -np.inf), np.full(len(v), np.inf)
        self._intervals = []
        for name in self._names:
            interval = getattr(self, f"_{name}")(state, dt, shift, low, high)
            if interval is None:
                continue
            self._intervals.append((name, *interval))
            low, high = (np.minimum(np.maximum(end, low), high) for end in interval)
        self.low, self.high = low, high

    def _acceleration(self, state: State, dt: float, *_: object) -> tuple[Array, Array]:
        return state.v - self._give, state.v + self._give

    def _jerk(self, state: State, dt: float, *_: object) -> tuple[Array, Array]:
        centre, give = state.v + dt * state.a, dt * self.change
        return centre - give, centre + give

    def _velocity(self, state: State, dt: float, *_: object) -> tuple[Array, Array] | None:
        """The acceleration that runs out to zero as the limit is reached; from beyond, the way back."""
        if (np.abs(state.v) <= self._slow).all():
            return None
        if self._sudden.all():
            return -self.velocity, self.velocity
        up, down = self.velocity - state.v, self.velocity + state.v
        gain = dt * braking_accelerations(np.abs(up), self.change, dt)
        loss = dt * braking_accelerations(np.abs(down), self.change, dt)
        return state.v - np.copysign(loss, down), state.v + np.copysign(gain, up)

    def _position(self, state: State, dt: float, shift: float, low: Array, high: Array) -> tuple[Array, Array] | None:
        if self._sudden.all():
            return (self.lower - state.q) / dt, (self.upper - state.q) / dt
        near_lower, near_upper = state.q < self._safe[0], state.q > self._safe[1]
        if not (near_lower.any() or near_upper.any()):
            return None
        result = np.full(len(low), -np.inf), np.full(len(low), np.inf)
        for j in np.flatnonzero(near_upper).tolist():
            room = float(self.upper[j] - state.q[j]) - shift * float(state.v[j])
            result[1][j] = self._end(j, room, float(state.v[j]), float(low[j]), float(high[j]))
        for j in np.flatnonzero(near_lower).tolist():
            room = float(state.q[j] - self.lower[j]) + shift * float(state.v[j])
            result[0][j] = -self._end(j, room, -float(state.v[j]), -float(high[j]), -float(low[j]))
        return result

    def _end(self, j: int, room: float, v: float, low: float, high: float) -> float:
        """Largest velocity in [low, high] from which joint j halts within `room`, rad or m, ahead.

        Where there is none: `low`, or from beyond the end the velocity back that comes to rest on it.
        """
        limit, change = self.acceleration_list[j], self.change_list[j]
        if room < -ROUNDING:
            return -fastest(-room, -v, limit, change, self._dt, -high, -low)
        return fastest(room, v, limit, change, self._dt, low, high)

    def at(self, x: Array) -> list[tuple[str, int, str]]:
        """Limits that hold velocities x (n,) back: name, joint, and which end, `upper` or `lower`."""
        found = []
        for end, bound, side in (("upper", self.high, 2), ("lower", self.low, 1)):
            for j in np.flatnonzero(np.abs(x - bound) <= AT_BOUND).tolist():
                # The last interval whose own end is this bound made it.
                owners = [i[0] for i in self._intervals if abs(float(i[side][j]) - float(bound[j])) <= AT_BOUND]
                if owners:
                    found.append((owners[-1], j, end))
        return found

    def violations(self, q: Array, x: Array) -> dict[str, float]:
        """By how much limits were given up, by name: of positions q (n,) those themselves, rad or m, else of x (n,)."""
        found = {}
        for name, low, high in self._intervals:
            excess = float(np.maximum(low - x, x - high).max())
            if name == "position":
                excess = float(np.maximum(self.lower - q, q - self.upper).max())
            if excess > AT_BOUND:
                found[name] = excess
        return found

    def brake(self, state: State, dt: float) -> Array:
        """Velocities (n,) at the end of a step of the quickest stop within limits of acceleration and jerk."""
        if dt != self._dt:
            self.prepare(dt)
        elif state is self._braked:
            return self._brake
        wanted = -np.copysign(braking_accelerations(np.abs(state.v), self.change, dt), state.v)
        low = np.maximum(state.a - self.change, -self.acceleration)
        high = np.minimum(state.a + self.change, self.acceleration)
        # An acceleration beyond its limits comes back to them at once: jerk is given up first.
        low, high = np.minimum(low, self.acceleration), np.maximum(high, -self.acceleration)
        return np.asarray(state.v + dt * np.minimum(np.maximum(wanted, low), high))

    def still(self, state: State) -> bool:
        """Whether the robot stands, and stays where it is."""
        return not state.v.any() and bool((np.abs(state.a) <= self.change + 1e-12).all())


def fastest_velocity(room: float, v: float, limit: float, change: float, dt: float, low: float, high: float) -> float:
    """Largest x in [low, high] with dt x + (how far a joint gets that brakes from x) <= room; `low` without one.

    By false position (Illinois), whose lower end always has the property.
    """
    if limit == math.inf:
        return min(max(room / dt, low), high)

    def left(x: float) -> float:
        return room + ROUNDING - dt * x - farthest(x, (x - v) / dt, limit, change, dt)

    over = left(high)
    if over >= 0.0:
        return high
    under = left(low)
    if under < 0.0:
        return low
    side = 0
    for _ in range(60):
        if under <= ROUNDING or high - low <= 1e-12:
            break
        x = (low * over - high * under) / (over - under)
        found = left(x)
        if found >= 0.0:
            low, under = x, found
            over, side = (over * 0.5, 1) if side == 1 else (over, 1)
        else:
            high, over = x, found
            under, side = (under * 0.5, -1) if side == -1 else (under, -1)
    return low


fastest = fastest_velocity if core is None else core.fastest
"""`fastest_velocity`, in the native core where that is there: the same bits."""
