"""`JointBox`: what the limits of single joints leave of the velocity at the end of a step, never nothing."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.braking import after, braking_accelerations, farthest, stop_phases, velocity_to_zero
from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.joint_limits import JointLimit, PositionLimit
from optiplan.errors import wrong_argument
from optiplan.records import dataclass
from optiplan.trajectory.state import State

ROUNDING = 1e-10
"""rad or m, of positions at their limits: what rounding may cost."""
_CODES = ("acceleration", "jerk", "velocity", "position")
"""Names of the limits by their numbers in the native core."""
AT_BOUND = 1e-9
"""rad/s or m/s: velocities nearer than this to a bound are held back by it."""


@dataclass(frozen=True, slots=True, eq=False)
class JointBrakes:
    """How joints brake: accelerations (k,) and jerks (k,) at most."""

    acceleration: Array
    jerk: Array


class JointBox:
    """Bounds low <= x <= high of the velocities x (n,) at the end of a step.

    Each limit is an interval a joint. They are intersected in the order of their importance; where nothing is left, the
    end nearest to the less important limit is taken, so that the fastest admissible way back within it is what remains.

    Args:
        limits: those of single joints among them count.
        order: names of limits, the least important first.
        n: number of joints.
        by_acceleration: whether positions follow the mean of the velocities of both ends of a step, or the new one.
        longest: s, of a step; see `fastest_velocity`.

    Raises:
        InputError: two limits of one name.

    Attributes:
        delay: (n,), s, that the acceleration of a joint takes from its limit to zero; where it has none, from the
            largest that a stop takes.
        slowing: (n,), velocities of a step that brakes with constant accelerations, of the last update.
    """

    def __init__(
        self, limits: Iterable[ControlLimit], order: Sequence[str], n: int, by_acceleration: bool, longest: float
    ) -> None:
        found: dict[str, JointLimit | PositionLimit] = {}
        for k, limit in enumerate(limits):
            if isinstance(limit, JointLimit | PositionLimit):
                if limit.name in found:
                    raise wrong_argument("Controller", f"limits[{k}]", f"a second limit of {limit.name}", "one of each")
                found[limit.name] = limit
        self._names = [name for name in reversed(order) if name in found]
        rates = {name: limit.values for name, limit in found.items() if isinstance(limit, JointLimit)}
        without = np.full(n, np.inf)
        self.velocity = rates.get("velocity", without)
        self.acceleration = rates.get("acceleration", without)
        self.jerk = rates.get("jerk", without)
        position = found.get("position")
        self.lower = position.lower if isinstance(position, PositionLimit) else -without
        self.upper = position.upper if isinstance(position, PositionLimit) else without
        strongest = np.where(np.isfinite(self.acceleration), self.acceleration, np.sqrt(self.velocity * self.jerk))
        bounded = np.isfinite(self.jerk) & np.isfinite(strongest)
        self.delay = np.divide(strongest, self.jerk, out=np.zeros(n), where=bounded)
        self._share = 0.5 if by_acceleration else 1.0
        self._lag = 0.5 * longest if by_acceleration else 0.0
        brakes = zip(self.acceleration.tolist(), self.jerk.tolist(), strict=True)
        self._joints = [JointEnd(limit, jerk, self._lag) for limit, jerk in brakes]
        # What joints at their limits take to stop, and what full accelerations add until they are turned back.
        self._halting, self._turning = np.array(
            [
                (
                    farthest(v, end.limit, end.limit, end.jerk) if max(v, end.limit) < math.inf else math.inf,
                    velocity_to_zero(end.limit, end.jerk, 0.0) if end.limit < math.inf else math.inf,
                )
                for v, end in zip(self.velocity.tolist(), self._joints, strict=True)
            ]
        ).T
        self._dt = 0.0
        self.low, self.high = -without, without.copy()
        self._intervals: list[tuple[str, Array, Array]] = []
        rows = self.velocity, self.acceleration, self.jerk, self.lower, self.upper, without, without, without
        self._table: Array | None = None if core is None else np.array(rows)  # the last three: in `prepare`
        self._codes = [_CODES.index(name) for name in self._names]
        self._out = np.zeros((6 + 2 * len(_CODES), n))
        self._own = [(name, *self._out[6 + 2 * code : 8 + 2 * code]) for code, name in enumerate(_CODES)]
        self._braked: State | None = None
        self.slowing = np.zeros(n)

    def prepare(self, dt: float) -> None:
        """Everything that depends on dt alone."""
        self._dt, self._braked = dt, None
        self._rules = np.array([dt, self._share, self._lag])
        self._change = dt * self.jerk
        reach = self._halting + (2.0 * dt + self._lag) * self.velocity
        with np.errstate(invalid="ignore"):  # joints between these need no look at their ends, nor those without ends
            self._safe = self.lower + reach, self.upper - reach
            self._give = self.acceleration * dt
            # Below these no acceleration within limits is too much.
            self._slow = self.velocity - (self._give + self._turning)
        if self._table is not None:
            self._table[5:] = *self._safe, self._slow

    def brakes_of(self, joints: list[int]) -> JointBrakes:
        """How some joints brake."""
        return JointBrakes(self.acceleration[joints], self.jerk[joints])

    def update(self, state: State, dt: float) -> None:
        """Bounds for a step from a state."""
        if dt != self._dt:
            self.prepare(dt)
        v = state.v
        self._braked = None
        if self._table is not None:
            out = self._out
            made = core.joint_box(state.q, v, state.a, self._table, self._codes, self._rules, out)
            self.low, self.high, self.slowing = out[0], out[1], out[5]
            self._intervals = [self._own[code] for code in made]
            self._braked = state
            return
        self.slowing = self._slowing(state, dt)
        low, high = np.full(len(v), -np.inf), np.full(len(v), np.inf)
        self._intervals = []
        for name in self._names:
            interval = getattr(self, f"_{name}_interval")(state, dt, low, high)
            if interval is None:
                continue
            self._intervals.append((name, *interval))
            low, high = (np.minimum(np.maximum(end, low), high) for end in interval)
        self.low, self.high = low, high

    def _slowing(self, state: State, dt: float) -> Array:
        wanted = -np.copysign(braking_accelerations(np.abs(state.v), self.jerk, dt), state.v)
        low = np.maximum(state.a - self._change, -self.acceleration)
        high = np.minimum(state.a + self._change, self.acceleration)
        # An acceleration beyond its limits comes back to them at once: jerk is given up first.
        low, high = np.minimum(low, self.acceleration), np.maximum(high, -self.acceleration)
        return np.asarray(state.v + dt * np.minimum(np.maximum(wanted, low), high))

    def _acceleration_interval(self, state: State, dt: float, *_: object) -> tuple[Array, Array]:
        return state.v - self._give, state.v + self._give

    def _jerk_interval(self, state: State, dt: float, *_: object) -> tuple[Array, Array]:
        centre, give = state.v + dt * state.a, dt * self._change
        return centre - give, centre + give

    def _velocity_interval(self, state: State, dt: float, *_: object) -> tuple[Array, Array] | None:
        """The acceleration that runs out to zero as the limit is reached; from beyond, the way back."""
        if (np.abs(state.v) <= self._slow).all():
            return None
        up, down = self.velocity - state.v, self.velocity + state.v
        ends = np.isfinite(up)
        gain = dt * braking_accelerations(np.where(ends, np.abs(up), 0.0), self.jerk, dt)
        loss = dt * braking_accelerations(np.where(ends, np.abs(down), 0.0), self.jerk, dt)
        low, high = state.v - np.copysign(loss, down), state.v + np.copysign(gain, up)
        return np.where(ends, low, -np.inf), np.where(ends, high, np.inf)

    def _position_interval(self, state: State, dt: float, low: Array, high: Array) -> tuple[Array, Array] | None:
        near_lower, near_upper = state.q < self._safe[0], state.q > self._safe[1]
        if not (near_lower.any() or near_upper.any()):
            return None
        result = np.full(len(low), -np.inf), np.full(len(low), np.inf)
        shift = (1.0 - self._share) * dt
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
        end, step = self._joints[j], (self._dt, self._share * self._dt)
        if room < -ROUNDING:
            return -fastest_velocity(end, -room, -v, step, (-high, -low))
        return fastest_velocity(end, room, v, step, (low, high))

    def at(self, x: Array) -> list[tuple[str, int, str]]:
        """Limits that hold velocities x (n,) back: name, joint, and which end, `upper` or `lower`."""
        found = []
        for end, bound, side in (("upper", self.high, 2), ("lower", self.low, 1)):
            for j, (speed, most) in enumerate(zip(x.tolist(), bound.tolist(), strict=True)):
                owner = self._owner(j, side, most) if abs(speed - most) <= AT_BOUND else ""
                if owner:
                    found.append((owner, j, end))
        return found

    def owners(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the names of the limits that set the lower bounds (n,), and those of the upper ones; "" for none."""
        lower, upper = (
            tuple(self._owner(j, side, float(bound[j])) for j in range(len(bound)))
            for side, bound in ((1, self.low), (2, self.high))
        )
        return lower, upper

    def _owner(self, j: int, side: int, bound: float) -> str:
        """Return the limit whose interval has this end, `side` 1 or 2, at joint j; the last one counts."""
        owners = [i[0] for i in self._intervals if abs(float(i[side][j]) - bound) <= AT_BOUND]
        return owners[-1] if owners else ""

    def violations(self, q: Array, x: Array) -> dict[str, float]:
        """By how much limits were given up, by name: of positions q (n,) those themselves, rad or m, else of x (n,)."""
        found = {}
        for name, low, high in self._intervals:
            excess = _beyond(q, self.lower, self.upper) if name == "position" else _beyond(x, low, high)
            if excess > AT_BOUND:
                found[name] = excess
        return found

    def brake(self, state: State, dt: float) -> State:
        """Where the quickest stop within limits of acceleration and jerk has come to after dt seconds."""
        if dt != self._dt:
            self.prepare(dt)
        elif state is self._braked:
            return State.of(*self._out[2:5].copy())
        joints = zip(state.q.tolist(), state.v.tolist(), state.a.tolist(), self._joints, strict=True)
        found = [after(stop_phases(v, a, end.limit, end.jerk), q, v, dt) for q, v, a, end in joints]
        return State.of(*np.array(found).T)


def _beyond(x: Array, low: Array, high: Array) -> float:
    """The largest of low - x and x - high; of few numbers Python finds it in a third of numpy's time."""
    ends = zip(x.tolist(), low.tolist(), high.tolist(), strict=True)
    found: float = max(max(least - value, value - most) for value, least, most in ends)
    return found


@dataclass(frozen=True, slots=True)
class JointEnd:
    """What a joint may do on its way to an end: acceleration, jerk; and `lag`, s, see `fastest_velocity`."""

    limit: float
    jerk: float
    lag: float

    @property
    def slow(self) -> float:
        """Velocity above which what a stop takes pays for the lag."""
        return self.limit * (0.5 * self.limit / self.jerk + 2.0 * self.lag) if self.limit < math.inf else math.inf


def fastest_velocity(
    end: JointEnd, room: float, v: float, step: tuple[float, float], within: tuple[float, float]
) -> float:
    """Largest x in [low, high] with s x + lag · min(u, slow) + (how far a joint gets that brakes from x) <= room.

    u is the largest velocity of that stop. Without such an x it is `low`. By false position (Illinois), whose lower end
    always has the property.

    A step that ends so leaves a next one that does, of any length where positions follow the new velocities (lag 0). If
    they follow the mean of both ends (s = dt / 2), a step that comes to rest at once within its length T still travels
    T v / 2, more than the v² / 2A of a stop: with lag = T / 2 of the longest step, and slow = A² / 2 jerk + T A, there
    is a next step again.

    Args:
        end: limits of the joint.
        room: rad or m.
        v: velocity at the beginning of the step.
        step: its length dt, s, and what x moves the joint in it, s = dt or dt / 2.
        within: low and high.
    """
    (dt, moves), (low, high) = step, within
    limit, jerk, lag, slow = end.limit, end.jerk, end.lag, end.slow
    if limit == math.inf and jerk == math.inf:
        return min(max(room / (moves + lag), low), high)
    if high == math.inf:
        high = max(room, 0.0) / moves  # a step alone takes all of the room
    if low == -math.inf:
        low = min(v, 0.0, high)  # none of it

    def left(x: float) -> float:
        a = (x - v) / dt
        top = min(max(x + (0.5 * a * a / jerk if a > 0.0 else 0.0), 0.0), slow)
        return room + ROUNDING - moves * x - (lag * top if lag else 0.0) - farthest(x, a, limit, jerk)

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
