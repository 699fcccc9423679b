"""Clearance of all pairs of bodies."""

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.collision.contacts import Contacts
from optiplan.collision.model import CollisionModel
from optiplan.planners.path_constraints.inequality import KEPT, PairsApart
from optiplan.planners.trajopt.terms.term import Curve, Instants, SoftRows, Term, within
from optiplan.records import dataclass

CUTOFF = 0.04
"""Pairs nearer than this, m, get a row in the quadratic program."""

CONTACT_PENALTY = 0.5
"""Price of a missing centimetre of clearance at one sample."""

CENTIMETRE = 0.01


@dataclass(frozen=True, eq=False)
class Margins:
    """Desired clearance along the curve (soft), for each pair at most what its ends allow.

    For a pair nearer than the margin at one end, the margin rises linearly to the clearance at the other end. For a
    pair near at both ends it stays small.

    Attributes:
        middle: m, of pairs that are far apart at both ends.
        start: (P,) clearance of each pair at the start, m, at most `CUTOFF`.
        end: (P,) the same at the end.
    """

    middle: float
    start: Array
    end: Array

    @classmethod
    def between(cls, model: CollisionModel, ends: Array, middle: float, duration: float = 0.0) -> "Margins":
        """Return the margins of a curve between two configurations, `ends` (2, n).

        Dynamic obstacles are where they are at the start and, at the other end, after that duration, s.
        """
        clearance = np.full((2, len(model.pairs)), CUTOFF)
        found = model.near(model.at_times(ends, np.array([0.0, duration])) if model.motions else ends, CUTOFF)
        clearance[found.rows, found.pairs] = np.maximum(found.distance, 0.0)
        return cls(middle, clearance[0], clearance[1])

    def at(self, u: Array, pairs: Index) -> Array:
        """Return margins (K,), m, of pairs (K,) at fractions u (K,) of the duration."""
        ends = (1.0 - u) * self.start[pairs] + u * self.end[pairs]
        return np.minimum(self.middle, KEPT * ends)


class ContactTerm(Term):
    """Rows d + grad d . (B dC) - margin, from coal's witness points, exact shapes.

    Holds at: samples; contacts between them are found by continuous collision checking, which adds samples.
    """

    name = "clearance"
    price, unit, negligible, decides = CONTACT_PENALTY, CENTIMETRE, 1e-4, True

    def __init__(self, model: CollisionModel, margins: Margins) -> None:
        self.model, self.margins = model, margins
        self._u = np.zeros(0)

    def begin(self, samples: Instants) -> None:
        """Take the instants of the samples, on which margins depend."""
        self._u = samples.u

    def rows(self, curve: Curve) -> SoftRows:
        """Return the rows of all pairs nearer than the cutoff."""
        sample, value, gradient = self.near(curve.samples.at[0] @ curve.control)
        return SoftRows(sample, value, curve.samples.spread(gradient, sample), np.zeros(len(value)))

    def near(self, Q: Array) -> tuple[Index, Array, Array]:
        """Sample (K,), clearance beyond the margin (K,), m, its gradient (K, n), of pairs near at Q (N, n)."""
        found = _pushed_one_way(self.model.near(Q, CUTOFF))
        value = found.distance - self.margins.at(self._u[found.rows], found.pairs)
        return found.rows, value, self.model.gradients(Q, found)


class TimedContactTerm(ContactTerm):
    """The same rows among dynamic obstacles: at sample u they are at their places at the time u T.

    With w the velocity of the obstacles' joints, d(distance)/dT = grad d . w u at fixed control points.
    """

    def rows(self, curve: Curve) -> SoftRows:
        """Return the rows of all pairs nearer than the cutoff."""
        n, t = curve.control.shape[1], self._u * curve.duration
        sample, value, gradient = self.near(self.model.at_times(curve.samples.at[0] @ curve.control, t))
        rates = self.model.obstacle_rates(t[sample]) * self._u[sample, None]
        by_duration = np.einsum("kj,kj->k", gradient[:, n:], rates)
        return SoftRows(sample, value, curve.samples.spread(gradient[:, :n], sample), by_duration)


CLEARANCE_RESERVE = 1e-3
"""Reserve of a required clearance for the motion between samples, m."""


class NamedClearanceTerm(Term):
    """Rows d - at_least of a few pairs with a required clearance. Holds at: samples."""

    name = "clearance"
    price, unit, negligible, decides = CONTACT_PENALTY, CENTIMETRE, CLEARANCE_RESERVE, False

    def __init__(self, apart: PairsApart) -> None:
        self.model, self.wanted = apart.model, apart.wanted
        self._inside: Index = np.zeros(0, dtype=np.intp)

    def begin(self, samples: Instants) -> None:
        """Take the samples in the constraint's part of the motion."""
        self._inside = np.flatnonzero(within(samples.u, self.wanted.during))

    def rows(self, curve: Curve) -> SoftRows:
        """Return the rows of the pairs nearer than the cutoff beyond the required clearance."""
        least = self.wanted.at_least
        Q = curve.samples.at[0][self._inside] @ curve.control
        found = _pushed_one_way(self.model.near(Q, least + CUTOFF))
        sample = self._inside[found.rows]
        order = np.argsort(sample, kind="stable")
        value, gradient = found.distance - least - CLEARANCE_RESERVE, self.model.gradients(Q, found)
        by_control = curve.samples.spread(gradient, sample)
        return SoftRows(sample[order], value[order], by_control[order], np.zeros(len(order)))


def _pushed_one_way(contacts: Contacts) -> Contacts:
    """Give a pair that penetrates at consecutive samples the mean of its normals at all of them.

    In deep penetration the nearest way out changes sides from sample to sample, and a curve pushed both ways stays in
    place. Where bodies are apart, the normals are unchanged.
    """
    inside = np.flatnonzero(contacts.distance < 0.0)
    inside = inside[np.lexsort((contacts.rows[inside], contacts.pairs[inside]))]
    pairs, rows = contacts.pairs[inside], contacts.rows[inside]
    breaks = np.flatnonzero((np.diff(pairs) != 0) | (np.diff(rows) > 1)) + 1
    normals = contacts.normals.copy()
    for run in np.split(inside, breaks):
        mean = normals[run].sum(axis=0)
        length = float(np.linalg.norm(mean))
        if length > 0.0:
            normals[run] = mean / length
    return contacts._replace(normals=normals)
