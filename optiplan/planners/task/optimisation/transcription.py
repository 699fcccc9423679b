"""The program of a stretch: the variables between two stops, and the terms of all parts as functions of them."""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.task.optimisation.line_part import LinePart
from optiplan.planners.task.optimisation.move_part import MovePart
from optiplan.planners.task.optimisation.rate_rows import RateRows
from optiplan.planners.trajopt.terms.term import Cost, SoftRows, Term
from optiplan.records import dataclass

Part = MovePart | LinePart

_NEAR, _RESERVE = 0.1, 1e-5
"""s at full speed: distance from a position limit within which a control point has a row, and its reserve."""


class StretchTranscription:
    """Variables y (Y,) and the duration T of a stretch that begins and ends at rest, as the descent sees them.

    y has the shares tau_k of the duration, of sum 1, and the variables of each part. Where two moves meet, it also has
    dq/dsigma and d²q/dsigma², (n,) each, sigma = t / T. Apart from T all parts are shapes in sigma. A stretch that is
    slowed down as a whole keeps its shape, so that the least T within the limits of all joints is known for every y.
    Where a line and a move meet, the law of the line determines the state of both. Where two moves meet, the
    configuration is given.

    Attributes:
        parts: moves and lines, no two lines in a row.
        columns: of each part, the variables on which it depends; `local`: (Y,) where each of them is among these.
        terms: of all parts.
        costs: none but the duration.
    """

    costs: tuple[Cost, ...] = ()

    def __init__(self, parts: Sequence[Part]) -> None:
        self.parts = tuple(parts)
        self.joints = len(parts[0].limits.velocity)
        begin, self.places = len(parts), list[slice]()
        for part in parts:
            self.places.append(slice(begin, begin + part.count))
            begin += part.count
        self.passing: dict[int, slice] = {}
        for k, (part, after) in enumerate(pairwise(parts)):
            if isinstance(part, MovePart) and isinstance(after, MovePart):
                self.passing[k] = slice(begin, begin + 2 * self.joints)
                begin += 2 * self.joints
        self.size = begin
        self.columns = [self._columns(k) for k in range(len(parts))]
        self.local = [np.searchsorted(columns, np.arange(begin)) for columns in self.columns]
        terms = [_PartTerm(k, term) for k, part in enumerate(parts) for term in part.terms]
        inside = [_InsideTerm(k, part) for k, part in enumerate(parts) if isinstance(part, MovePart)]
        self.terms: tuple[_PartTerm | _InsideTerm, ...] = (*terms, *inside)

    def _columns(self, k: int) -> Index:
        """Return the variables (C_k,) on which a part depends: its own, and of a move those of its ends."""
        around = [k]
        if isinstance(self.parts[k], MovePart):
            around += [j for j in (k - 1, k + 1) if 0 <= j < len(self.parts) and isinstance(self.parts[j], LinePart)]
        places = [self.places[j] for j in around] + [self.passing[j] for j in (k - 1, k) if j in self.passing]
        return np.sort(np.concatenate([around, *(np.arange(place.start, place.stop) for place in places)]))

    def spread(self, k: int, gradient: Array) -> Array:
        """Return derivatives (..., Y) by all variables, from those of part k by its own, (..., C_k)."""
        found = np.zeros((*gradient.shape[:-1], self.size))
        found[..., self.columns[k]] = gradient
        return found

    def shortest_duration(self, y: Array) -> float:
        """Return the least duration of a shape within the limits of the joints, s."""
        return max(rates.shortest / float(y[k]) for k, rates in enumerate(StretchCurve(self, y, 1.0).rates))

    def curve(self, y: Array, duration: float) -> "StretchCurve":
        """Return the stretch of a shape in a duration, s."""
        return StretchCurve(self, y, duration)

    def cost(self, curve: "StretchCurve") -> float:
        """Return the duration, s."""
        return curve.duration


@dataclass(frozen=True, eq=False)
class StretchCurve:
    """A stretch at a duration.

    Attributes:
        made: the transcription.
        y: (Y,) its variables.
        duration: s.
    """

    made: StretchTranscription
    y: Array
    duration: float

    @cached_property
    def rates(self) -> list[RateRows]:
        """Limits of the joints as rows of each part, without gradients of moves."""
        return [part.rates(control) for part, control in zip(self.made.parts, self.controls, strict=True)]

    @cached_property
    def controls(self) -> list[Array]:
        """Control points of each part, (K, n), of laws (K, 1)."""
        return [
            part.control(self._own(k))
            if isinstance(part, LinePart)
            else part.control(self._own(k), *self.end_states(k))
            for k, part in enumerate(self.made.parts)
        ]

    @cached_property
    def gradients(self) -> list[Array]:
        """Derivatives by `columns` of the control points of moves, (K, n, C_k); of a line's variables, (count, C_k)."""
        found = []
        for k, part in enumerate(self.made.parts):
            own = self.made.local[k][self.made.places[k]]
            if isinstance(part, LinePart):
                found.append(np.eye(len(self.made.columns[k]))[own])
            else:
                found.append(part.control_gradient(own, *self._by_ends(k)))
        return found

    def rate_rows(self, k: int) -> RateRows:
        """Return the limits of the joints as rows of a part, with gradients by its `columns`."""
        part = self.made.parts[k]
        if isinstance(part, MovePart):
            own = self.made.local[k][self.made.places[k]]
            return part.rates(self.controls[k], own, np.concatenate(self._by_ends(k)))
        rates = self.rates[k]
        return rates._replace(gradient=rates.gradient @ self.gradients[k])

    def seconds(self, k: int) -> float:
        """Return the duration of a part, s."""
        return float(self.duration * self.y[k])

    def part(self, k: int) -> Any:
        """Return a part as its terms see it: a `Curve`, or a `LawCurve`, which is one to torques."""
        return self.made.parts[k].curve(self.controls[k], self.seconds(k))

    def end_states(self, k: int) -> tuple[Array, Array]:
        """Return q, dq/dw, d²q/dw² at both ends of a move, (3, n) each."""
        return self._end(k, False)[0], self._end(k, True)[0]

    def _by_ends(self, k: int) -> tuple[Array, Array]:
        """Return derivatives of the states at both ends of a move, (3, n, C_k) each."""
        return self._end(k, False)[1], self._end(k, True)[1]

    def _own(self, k: int) -> Array:
        return np.asarray(self.y[self.made.places[k]])

    def _end(self, k: int, last: bool) -> tuple[Array, Array]:
        """Return q, dq/dw, d²q/dw² (3, n) at an end of a move, w its share of time, and derivatives (3, n, C_k)."""
        x, dx = self._meeting(k if last else k - 1, k)
        share = self.y[k]
        powers = share ** np.arange(3)
        state, gradient = x * powers[:, None], dx * powers[:, None, None]
        own = self.made.local[k][k]
        gradient[1, :, own] += x[1]
        gradient[2, :, own] += 2.0 * share * x[2]
        return state, gradient

    def _meeting(self, junction: int, k: int) -> tuple[Array, Array]:
        """Return the state (3, n) of part k, a move, at a junction by sigma, and its derivatives, (3, n, C_k)."""
        made, last, local = self.made, junction == k, self.made.local[k]
        other = k + 1 if last else k - 1
        part = made.parts[k]
        assert isinstance(part, MovePart)
        x, dx = np.zeros((3, made.joints)), np.zeros((3, made.joints, len(made.columns[k])))
        x[0] = part.ends[int(last)]
        if not 0 <= other < len(made.parts):
            return x, dx
        line = made.parts[other]
        if isinstance(line, MovePart):
            place = made.passing[junction]
            x[1:] = self.y[place].reshape(2, -1)
            dx[1:].reshape(2 * made.joints, -1)[:, local[place]] = np.eye(2 * made.joints)
            return x, dx
        state, by_law = line.end_state(line.control(self._own(other)), last=not last)
        share = self.y[other]
        for order in (1, 2):
            x[order] = state[order] / share**order
            dx[order][:, local[made.places[other]]] = by_law[order] / share**order
            dx[order][:, local[other]] = -order * x[order] / share
        return x, dx


class _PartTerm:
    """A term of one part as a term of the stretch."""

    def __init__(self, k: int, term: Term) -> None:
        self.k, self.term = k, term
        self.name, self.unit, self.negligible, self.decides = term.name, term.unit, term.negligible, term.decides

    @property
    def price(self) -> float:
        """See `Term`; it may be raised."""
        return self.term.price

    def rows(self, curve: StretchCurve) -> SoftRows:
        """Return the rows with derivatives by y and the duration of the stretch."""
        rows = self.term.rows(curve.part(self.k))
        gradient = curve.gradients[self.k]
        by_own = rows.by_control @ gradient.reshape(-1, gradient.shape[-1])
        by_own[:, curve.made.local[self.k][self.k]] += rows.by_duration * curve.duration
        by_y = curve.made.spread(self.k, by_own)
        return SoftRows(rows.sample, rows.value, by_y, rows.by_duration * curve.y[self.k], rows.exceeded)

    def watch(self, rows: SoftRows) -> bool:
        """See `Term`."""
        return self.term.watch(rows)


class _InsideTerm:
    """Rows limit -+ control point >= 0 of a move near its position limits, over the speed limits, s.

    Soft, because the states at the ends, on which all control points depend, may lead them beyond.
    """

    name = "position"
    price, unit, negligible, decides = 2.0, 0.01, 1e-6, False

    def __init__(self, k: int, part: MovePart) -> None:
        self.k, self.limits = k, part.limits

    def rows(self, curve: StretchCurve) -> SoftRows:
        """Return the rows of control points that are near, with derivatives by y."""
        points, speed = curve.controls[self.k], self.limits.velocity
        rooms = np.stack([self.limits.upper - points, points - self.limits.lower], axis=1) / speed - _RESERVE
        sample, side, joint = np.nonzero(rooms < _NEAR)
        if not len(sample):
            return SoftRows.none(curve.made.size)
        sign = np.where(side == 0, -1.0, 1.0) / speed[joint]
        by_y = curve.made.spread(self.k, curve.gradients[self.k][sample, joint] * sign[:, None])
        return SoftRows(sample, rooms[sample, side, joint], by_y, np.zeros(len(sample)))

    def watch(self, rows: SoftRows) -> bool:
        """Return False: what a step can reach has a row."""
        return False
