"""`Trajectory`: piecewise polynomials in time, the one representation that every planner returns."""

import html
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Index, ReadOnlyArrays, is_finite, read_only
from optiplan.errors import InputError, Issue, counted, described
from optiplan.records import dataclass
from optiplan.trajectory import bspline, polynomial
from optiplan.trajectory.pieces import defect, lasting, read_pieces
from optiplan.trajectory.segments import Segment, read_segments, segment_data
from optiplan.trajectory.state import State

_MOST_NATIVE = 16  # coefficients of a polynomial that the core takes
_OUTSIDE = 1e-9  # s; how far outside [0, duration] rounding may put a time

_MOST_SAMPLES = 60_000  # in a dictionary
_CURVE = 160  # samples of a drawing


class States(NamedTuple):
    """Positions, velocities and accelerations at many times, (…, n) each, rad or m and s."""

    q: Array
    v: Array
    a: Array


@dataclass(frozen=True)
class Extrema(ReadOnlyArrays):
    """Minimum and maximum of one derivative of each joint over all time and when they are reached.

    Attributes:
        low: (n,) minima, rad/s^order or m/s^order.
        high: (n,) maxima, same unit.
        t_low: (n,) times of the minima, s.
        t_high: (n,) times of the maxima, s.
    """

    low: Array
    high: Array
    t_low: Array
    t_high: Array


class _Refused(InputError, ValueError):
    """An invalid argument of a trajectory's method."""

    @classmethod
    def of(cls, argument: str, found: str, expected: str) -> "_Refused":
        """About one argument."""
        return cls([Issue("Trajectory", None, argument, f"found {found}", expected)])


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(ReadOnlyArrays):
    """Motion q(t) of n joints for t in [0, duration].

    On piece i, for t in [t_i, t_{i+1}]:  q_j(t) = sum_k coefficients[i, k, j] (t - t_i)^k.
    The arrays are copied and made read-only.

    Attributes:
        joint_names: names of the n joints, in the order of the columns.
        breakpoints: (m + 1,) increasing, in s; the first is 0.
        coefficients: (m, degree + 1, n), ascending powers, rad/s^k or m/s^k.
        segments: steps of a task in time; none of a motion to one goal.

    Raises:
        ValueError: if shapes do not fit each other, a number is not finite, or the breakpoints do not increase from 0.
    """

    joint_names: tuple[str, ...]
    breakpoints: Array
    coefficients: Array
    segments: tuple[Segment, ...] = ()

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "joint_names", tuple(self.joint_names))
        except TypeError:
            found = described(self.joint_names)
            raise ValueError(f"joint_names: found {found}; expected one or more different names") from None
        for name in ("breakpoints", "coefficients"):
            try:
                array = np.array(getattr(self, name), dtype=float)
            except (TypeError, ValueError, OverflowError):
                found = described(getattr(self, name))
                raise ValueError(f"{name}: found {found}; expected an array of numbers") from None
            object.__setattr__(self, name, read_only(array))
        problem = defect(self.joint_names, self.breakpoints, self.coefficients)
        if problem is not None:
            raise ValueError(f"{problem.field}: found {problem.found}; expected {problem.expected}")

    def __repr__(self) -> str:
        """Duration, pieces and names of the joints in one line."""
        pieces = counted(len(self.coefficients), "piece")
        return f"Trajectory: {self.duration:.3f} s, {pieces}, {self.n} joints: {', '.join(self.joint_names)}"

    def _repr_html_(self) -> str:
        """The curves of the joints, for notebooks."""
        from optiplan.figure_style import element_of, line_style, sheet, styled

        t = np.linspace(0.0, self.duration, _CURVE)
        with styled():
            figure = sheet(2.6)
            ax = figure.add_subplot(xlabel="time, s", ylabel="position, rad (m)", title="joint positions over time")
            for j, (name, values) in enumerate(zip(self.joint_names, self(t).T, strict=True)):
                ax.plot(t, values, label=name, **line_style(j))
            figure.legend(loc="outside right upper")
            return f"<p>{html.escape(repr(self))}</p>{element_of(figure)}"

    @classmethod
    def from_bspline(cls, joint_names: Sequence[str], knots: Array, control_points: Array, degree: int) -> "Trajectory":
        """The B-spline with these knots (N + degree + 1,) in s and control points (N, n), exactly; time starts at 0.

        Raises:
            ValueError: if sizes do not fit, the degree is not 1 to 7, or the spline's domain is empty.
        """
        breakpoints, coefficients = bspline.pieces(knots, control_points, degree)
        return cls(tuple(joint_names or ()), breakpoints - breakpoints[0], coefficients)

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.breakpoints[-1])

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.coefficients.shape[2])

    @cached_property
    def widths(self) -> Array:
        """Lengths of the pieces, (m,), s."""
        return read_only(np.diff(self.breakpoints))

    @cached_property
    def start(self) -> Array:
        """Configuration q(0), shape (n,), rad or m."""
        return read_only(self(0.0))

    @cached_property
    def end(self) -> Array:
        """Configuration q(duration), shape (n,), rad or m."""
        return read_only(self(self.duration))

    def derivatives(self, order: int) -> Array:
        """Local coefficients of a derivative: (m, max(degree - order, 0) + 1, n), ascending powers.

        Raises:
            ValueError: if the order is negative.
        """
        if order < 0:
            raise ValueError(f"order: found {order}; expected 0 or more")
        if order < len(self._derivatives):
            return self._derivatives[order]
        c = np.swapaxes(self._derivatives[-1], 1, 2)
        for _ in range(min(order - len(self._derivatives) + 1, c.shape[-1])):
            c = polynomial.derivative(c)
        return np.swapaxes(c, 1, 2)

    def __call__(self, t: float | Sequence[float] | Array, order: int = 0, *, clamp: bool = False) -> Array:
        """Derivative of an order, 0 or more, at times t (k,), s: array (k, n), rad/s^order or m/s^order.

        At one time t, a number, it is an array (n,).

        With `clamp` the motion is q(min(max(t, 0), duration)): before and after, the robot stands at the nearer end,
        with derivatives of 0.

        Raises:
            InputError: a time is outside [0, duration] by more than 1e-9 s without `clamp`, or not a number; or there
                is no such order. It is a ValueError too.
        """
        if isinstance(order, bool) or not isinstance(order, int | np.integer) or order < 0:
            raise _Refused.of("order", described(order), "a whole number, 0 or more")
        try:
            times = np.asarray(t, dtype=float)
        except (TypeError, ValueError, OverflowError):
            times = np.empty((0, 0))
        if times.ndim > 1:
            raise _Refused.of("t", described(t), "a time, or times (k,), s")
        if times.ndim == 0:
            return np.asarray(self(times[None], order, clamp=clamp)[0])
        t = times
        inside = (t >= -_OUTSIDE) & (t <= self.duration + _OUTSIDE)
        everywhere = bool(inside.all())
        if not (everywhere or (clamp and not np.isnan(t).any())):
            raise _Refused.of("t", f"[{t.min()}, {t.max()}]", f"times in [0, {self.duration}], or clamp=True")
        piece = np.searchsorted(self.breakpoints[1:-1], t, side="right")
        local = np.minimum(np.maximum(t, 0.0), self.duration) - self.breakpoints[piece]
        value = self.derivative_in(piece, local, int(order))
        return value if order == 0 or everywhere else np.asarray(np.where(inside[:, None], value, 0.0))

    def derivative_in(self, piece: Index, local: Array, order: int) -> Array:
        """Return a derivative (k, n) at times `local` (k,), s, since the beginning of pieces (k,)."""
        c = self.derivatives(order)
        value: Array = c[piece, -1]
        for power in range(c.shape[1] - 2, -1, -1):
            value *= local[:, None]
            value += c[piece, power]
        return value

    def states(self, t: Array) -> States:
        """States at times t (k,) in [0, duration], s: (k, n) each."""
        piece = np.searchsorted(self.breakpoints[1:-1], t, side="right")
        return self.states_in(piece, t - self.breakpoints[piece])

    def states_in(self, piece: Index, local: Array) -> States:
        """Return the same at times `local` (k,) since the beginning of pieces (k,)."""
        q, v, a = self.states_along(piece, local[:, None])
        return States(q[:, 0], v[:, 0], a[:, 0])

    def states_along(self, piece: Index, local: Array) -> States:
        """Return the same at s times `local` (k, s) since the beginning of each of the pieces (k,): (k, s, n) each."""
        c = self._side_by_side
        powers = np.ones((*local.shape, c.shape[1]))
        for k in range(1, c.shape[1]):
            np.multiply(powers[..., k - 1], local, out=powers[..., k])
        value = powers @ c[piece]
        q, v, a = (np.ascontiguousarray(value[..., order * self.n : (order + 1) * self.n]) for order in range(3))
        return States(q, v, a)

    def state(self, t: float) -> State:
        """Position, velocity and acceleration at a time t, s: where a new motion may begin.

        Raises:
            InputError: a time outside [0, duration], or not a number.
        """
        try:
            time = float(t)
        except (TypeError, ValueError, OverflowError):
            raise _Refused.of("t", described(t), "a time, s") from None
        return State(*(self(time, order) for order in range(3)))

    def extrema(self, order: int) -> tuple[Array, Array]:
        """Exact minimum and maximum of a derivative over all time: two arrays of shape (n,), rad/s^order."""
        e = self.extrema_at(order)
        return e.low, e.high

    def extrema_at(self, order: int) -> Extrema:
        """Extrema of a derivative over all time, from the roots of the next derivative, and their times.

        Exact but for the rounding of the polynomials' values, which `verify.continuous.polynomial_bounds` counts.
        """
        if order not in self._extrema:
            self._extrema[order] = self._find_extrema(order)
        return self._extrema[order]

    def _find_extrema(self, order: int) -> Extrema:
        unit, h = self.unit_pieces(order), self.widths
        m, n, size = unit.shape
        if core is not None and size <= _MOST_NATIVE:
            values, (i, k) = core.unit_extrema(np.ascontiguousarray(unit))
            return Extrema(*values[:2], *(self.breakpoints[[i, k]] + h[[i, k]] * values[2:]))
        low, high, x_low, x_high = np.full((m, n), np.inf), np.full((m, n), -np.inf), *np.zeros((2, m, n))
        asked = polynomial.may_hold_extrema(unit)
        low[asked], high[asked], x_low[asked], x_high[asked] = polynomial.unit_extrema(unit[asked])
        i, k, j = low.argmin(axis=0), high.argmax(axis=0), np.arange(n)
        t_low = self.breakpoints[i] + h[i] * x_low[i, j]
        t_high = self.breakpoints[k] + h[k] * x_high[k, j]
        return Extrema(low[i, j], high[k, j], t_low, t_high)

    def jumps(self, order: int) -> Array:
        """Discontinuity of a derivative at the m - 1 inner breakpoints, right minus left: (m - 1, n)."""
        if order not in self._jumps:
            c = self.derivatives(order)
            left = polynomial.evaluate(np.swapaxes(c[:-1], 1, 2), self.widths[:-1, None])
            self._jumps[order] = read_only(np.asarray(c[1:, 0] - left))
        return self._jumps[order]

    def squared_jerk(self) -> float:
        """The integral of sum_j (d³q_j/dt³)² over the motion, exact for its pieces; (rad/s³)² s, prismatic joints m.

        A jump of the acceleration, which has no such integral, counts as nothing.
        """
        jerk = self.derivatives(3)  # (m, k, n)
        order = np.arange(jerk.shape[1])
        power = order[:, None] + order + 1.0
        widths = self.widths[:, None, None] ** power / power  # (m, k, k)
        return float(np.einsum("mkj,mkl,mlj->", jerk, widths, jerk))

    def scaled(self, duration: float) -> "Trajectory":
        """Return the same path in another duration, s: q'(t) = q(t T / duration), derivative k times (T / duration)^k.

        Raises:
            InputError: the duration is not positive and finite. It is a ValueError too.
        """
        if not is_finite(duration) or duration <= 0.0:
            raise _Refused.of("duration", described(duration), "a positive number of seconds")
        rate = self.duration / duration
        powers = rate ** np.arange(self.coefficients.shape[1])
        segments = tuple(segment.scaled(rate) for segment in self.segments)
        pieces = lasting(self.breakpoints / rate, self.coefficients * powers[:, None])
        return Trajectory(self.joint_names, *pieces, segments)

    def sample_times(self, rate: float) -> Array:
        """Return equally spaced times (k,), s, from the start to the end, at least `rate` a second, Hz.

        Raises:
            InputError: the rate is no positive number. It is a ValueError too.
        """
        if not is_finite(rate) or rate <= 0.0:
            raise _Refused.of("rate", described(rate), "samples a second, above 0")
        return np.linspace(0.0, self.duration, int(np.ceil(min(self.duration * rate, _MOST_SAMPLES - 1))) + 1)

    def to_dict(self, rate: float | None = None) -> dict[str, Any]:
        """JSON-ready form that `from_dict` reproduces without loss.

        Args:
            rate: if given, samples `t`, `q`, `v`, `a` at least this often, Hz, are added for other programs. There are
                60 000 at most, so fewer for a motion of hours.
        """
        pieces = {"breakpoints": self.breakpoints.tolist(), "coefficients": self.coefficients.tolist()}
        data: dict[str, Any] = {"joint_names": list(self.joint_names), "pieces": pieces}
        if self.segments:
            data |= segment_data(self.segments)
        if rate is not None:
            data |= self.sampled(self.sample_times(rate))
        return data

    def sampled(self, t: Array) -> dict[str, Any]:
        """Return samples at times t (k,), s, JSON-ready: `t`, and `q`, `v`, `a` (k, n)."""
        return {"t": t.tolist()} | {key: self(t, k).tolist() for k, key in enumerate("qva")}

    @classmethod
    def from_dict(cls, data: Any, file: str = "trajectory") -> "Trajectory":
        """Read what `to_dict` wrote; samples are ignored, the pieces are the motion.

        Args:
            data: parsed JSON.
            file: name of the file for the message.

        Raises:
            InputError: naming the field that is missing, misshapen, not finite or out of order.
        """
        return cls(*read_pieces(data, file), read_segments(data, file))

    def unit_pieces(self, order: int) -> Array:
        """Coefficients of a derivative on pieces stretched to [0, 1]: (m, n, max(degree - order, 0) + 1)."""
        if order not in self._units:
            c = np.swapaxes(self.derivatives(order), 1, 2)
            self._units[order] = read_only(c * self.widths[:, None, None] ** np.arange(c.shape[2]))
        return self._units[order]

    @cached_property
    def _side_by_side(self) -> Array:
        """Coefficients of positions, velocities and accelerations of all pieces, (m, degree + 1, 3 n)."""
        m, size, n = self.coefficients.shape
        found = np.zeros((m, size, 3 * n))
        for order in range(3):
            c = self.derivatives(order)
            found[:, : c.shape[1], order * n : (order + 1) * n] = c
        return found

    @cached_property
    def _jumps(self) -> dict[int, Array]:
        return {}

    @cached_property
    def _units(self) -> dict[int, Array]:
        return {}

    @cached_property
    def _extrema(self) -> dict[int, Extrema]:
        return {}

    @cached_property
    def _derivatives(self) -> tuple[Array, ...]:
        c = [np.swapaxes(self.coefficients, 1, 2)]
        for _ in range(3):
            c.append(read_only(polynomial.derivative(c[-1])))
        return tuple(np.swapaxes(one, 1, 2) for one in c)
