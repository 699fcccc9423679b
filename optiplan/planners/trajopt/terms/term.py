"""The interface of the optimiser to soft constraints (`Term`) and costs (`Cost`) of a curve."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from operator import add
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array, Index, distinct
from optiplan.libraries import loading
from optiplan.planners.trajopt.bspline_basis import REACH, SplineBasis
from optiplan.records import dataclass

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

    from optiplan.kinematics.symbolic.state import SymbolicState

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Instants:
    """Instants at which terms are evaluated.

    Attributes:
        basis: of the curve.
        u: (N,) fractions of the duration, rising.
        at: (N, K) matrices that take control points to position, and to the first and second derivative by u.
        moving: (N, M) the same of the variables: the control points that are not held.
    """

    basis: SplineBasis
    u: Array
    at: tuple[Array, Array, Array]
    moving: tuple[Array, Array, Array]

    @classmethod
    def of(cls, basis: SplineBasis, u: Array) -> "Instants":
        """Return the samples at fractions u, sorted, each once."""
        u = distinct(u)
        at = basis.at(u, 0), basis.at(u, 1), basis.at(u, 2)
        return cls(basis, u, at, tuple(basis.by_variables(matrix) for matrix in at))  # type: ignore[arg-type]

    def spread(self, gradient: Array, sample: Index, order: int = 0) -> Array:
        """Apply the chain rule q = B C: from d/dq (K, n) of rows at samples (K,) to d/dC (K, M n) of the variables.

        With `order` 1 or 2 from the derivative by that derivative of q with respect to u.
        """
        product = self.moving[order][sample, :, None] * gradient[:, None, :]
        return np.asarray(product.reshape(len(gradient), product.shape[1] * product.shape[2]))


_SLACK = 1e-9
"""Tolerance of fractions of the duration: a sample at the end of an interval is in it."""


def within(u: Array, during: tuple[float, float]) -> Mask:
    """Return which fractions u (N,) of the duration are in a part of the motion."""
    return np.asarray((u >= during[0] - _SLACK) & (u <= during[1] + _SLACK))


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve at a duration, seen at samples.

    Attributes:
        control: (K, n) control points, rad or m.
        duration: s.
        samples: instants of evaluation.
    """

    control: Array
    duration: float
    samples: Instants

    @cached_property
    def motion(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration at the samples, (N, n) each, rad or m, and s."""
        q, v, a = (matrix @ self.control / self.duration**order for order, matrix in enumerate(self.samples.at))
        return q, v, a

    @property
    def variables(self) -> int:
        """Number of variables, M n."""
        return int(self.samples.moving[0].shape[1] * self.control.shape[1])

    def rows(self, sample: Index, value: Array, by_state: tuple[Array, Array, Array]) -> "SoftRows":
        """Return rows (R,) from their derivatives by q, v and a, (R, n) each.

        v = q' / T and a = q'' / T², so that d/dT = -(v d/dv + 2 a d/da) / T.
        """
        by_control, by_duration = np.zeros((len(sample), self.variables)), np.zeros(len(sample))
        for order, gradient in enumerate(by_state):
            if not gradient.any():
                continue
            by_control += self.samples.spread(gradient / self.duration**order, sample, order)
            by_duration -= order * np.einsum("rj,rj->r", gradient, self.motion[order][sample]) / self.duration
        return SoftRows(sample, value, by_control, by_duration)


@dataclass(frozen=True, eq=False)
class SoftRows:
    """Linearised inequalities g_k + dg_k >= 0 at samples of the curve, one slack a sample.

    Attributes:
        sample: (K,) sample of each row, rising.
        value: (K,) g_k, in the unit of its term.
        by_control: (K, M n) derivative with respect to the variables, one control point after another.
        by_duration: (K,) derivative with respect to T.
        exceeded: (N, …) where a term that leaves out rows is violated; see `Term.watch`.
    """

    sample: Index
    value: Array
    by_control: Array
    by_duration: Array
    exceeded: Mask | None = None

    @classmethod
    def none(cls, free: int) -> "SoftRows":
        """Return no rows, for `free` = M n variables."""
        return cls(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, free)), np.zeros(0))

    def beside(self, other: "SoftRows") -> "SoftRows":
        """Return these rows and other ones, sample by sample; `exceeded` is that of these."""
        order = np.argsort(np.concatenate([self.sample, other.sample]), kind="stable")

        def both(name: str) -> Array:
            return np.asarray(np.concatenate([getattr(self, name), getattr(other, name)])[order])

        sample = both("sample").astype(np.intp, copy=False)
        return SoftRows(sample, both("value"), both("by_control"), both("by_duration"), self.exceeded)

    def only(self, kept: Mask) -> "SoftRows":
        """Return the rows selected by `kept` (K,)."""
        if kept.all():
            return self
        return replace(
            self,
            sample=self.sample[kept],
            value=self.value[kept],
            by_control=self.by_control[kept],
            by_duration=self.by_duration[kept],
        )

    def violation(self) -> float:
        """Return the sum over the samples of the worst violation of each."""
        if not len(self.value):
            return 0.0
        worst = np.zeros(int(self.sample.max()) + 1)
        np.maximum.at(worst, self.sample, -self.value)
        return float(worst.sum())


class Expressed(NamedTuple):
    """Rows of a term as expressions of the state at samples.

    Attributes:
        build: makes the expression (m,), from the robot's state.
        samples: (S,) at which it holds.
        least: lower bounds (S, m) of the rows on a curve.
        labels: (m,) names of the rows; none: the term's.
    """

    build: Callable[["SymbolicState"], Any]
    samples: Index
    least: Callable[[Curve], Array]
    labels: tuple[str, ...] = ()


class Term(Protocol):
    """A soft constraint: rows g >= 0 at samples, and the price of violating them.

    Attributes:
        name: for reports.
        price: cost of a violation by one `unit` at one sample, as a share of the duration that the curve begins with.
        unit: of g, in which the program works.
        negligible: violation summed over the samples below which the constraint counts as held.
        decides: whether a curve whose violation no longer decreases is given up.
    """

    name: str
    price: float
    unit: float
    negligible: float
    decides: bool

    def begin(self, samples: Instants) -> None:
        """Prepare for new samples."""

    def rows(self, curve: Curve) -> SoftRows:
        """Return the rows that a step may violate, with exact derivatives."""

    def watch(self, rows: SoftRows) -> bool:
        """Add the violations of a rejected step, in `rows`, to all further rows; return whether one is new.

        A term without omitted rows has none.
        """
        return False

    def expressed(self) -> Expressed | None:
        """Return its rows, in the term's own unit, as expressions; None where they are only known linearised."""
        return None


class CostModel(NamedTuple):
    """A cost and its derivatives by the variables and the duration.

    Attributes:
        value: s, weighted.
        gradient: (M n,).
        by_duration: derivative with respect to T.
        band: (M, REACH, n) second derivatives; (i, d, j) couples joint j of control points i and i + d.
        twice_by_duration: second derivative with respect to T.
    """

    value: float
    gradient: Array
    by_duration: float
    band: Array
    twice_by_duration: float = 0.0

    @classmethod
    def none(cls, points: int, joints: int) -> "CostModel":
        """Return no cost of M `points` of n `joints`."""
        return cls(0.0, np.zeros(points * joints), 0.0, np.zeros((points, REACH, joints)))

    def plus(self, other: "CostModel") -> "CostModel":
        """Return the sum."""
        return CostModel(*map(add, self, other))

    def hessian(self) -> "csc_matrix":
        """Return the second derivatives, (M n, M n), symmetric."""
        with loading():
            from scipy.sparse import csc_matrix, diags

        points, reach, joints = self.band.shape
        upper = [self.band[: points - d, d].ravel() for d in range(min(reach, points))]
        places = [joints * d for d in range(len(upper))]
        size = points * joints
        half = diags(upper, places, shape=(size, size))
        return csc_matrix(half + half.T - diags(upper[0], shape=(size, size)))


class Cost(Protocol):
    """A part of the objective that is not the duration.

    Attributes:
        name: for reports.
        timed: whether a longer duration may be cheaper.
    """

    name: str
    timed: bool

    def value(self, curve: Curve) -> float:
        """Return the weighted cost, s."""

    def model(self, curve: Curve) -> CostModel:
        """Return the cost with its derivatives."""
