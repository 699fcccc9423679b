"""A time law with limited jerk: a clamped cubic spline s(t), refined from the fastest law without such a limit.

Its control points c are refined by sequential linear programming. At samples of t every limit is a function of s and
its derivatives, |f(s, s', s'', s''')| <= bound. Run tau times slower, f shrinks by tau^p: p = 1 for speeds, 2 for
accelerations and torques, 3 for jerks. One step minimises tau over changes of c, with f linear in c and
tau^p >= 1 + p (tau - 1), inside a trust region. The error of the linear f is repaired by slowing down by
tau = max (f / bound)^(1/p). So every iterate holds at the samples, and the duration alone measures a step.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.robot.robot import Limits
from optiplan.trajectory.timing.jerk_limited_constraints import Basis, Block, LawLimits
from optiplan.trajectory.timing.path_constraints import Rows
from optiplan.trajectory.timing.reachability import fastest_law
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_FEWEST, _MOST, _FINEST = 80, 160, 4000  # spans of the spline: in all; the duration over the shortest
_PER_RAMP, _PER_PIECE = 1, 8  # spans while the acceleration rises at the ends; in each piece of a path of few
_GROWTH = 0.3  # of the spans with the distance from the ends
_JERK_SHARE = 0.5  # of the jerk limit that the start may spend on the path's third derivative
_RADIUS, _SMALLEST = 0.03, 1e-4  # of the trust region, first and last, as shares of the path's length
_SHARES = (1.0, 0.5, 0.2, 0.08)  # of a step that are tried
_STEPS = 10
_ENOUGH = 1e-3  # gain of a whole step below which it is the last
_ACTIVE = 0.5  # share of its bound from which on a value is part of the program
_REGULARISATION = 1e-6  # makes the program strictly convex
_LEAST_TAU = 0.8  # of one step: 1 + 3 (tau - 1) must stay positive
_ACCURACY = 1e-6  # of the program's solution


def smooth_law(
    path: Trajectory, limits: Limits, rows: Rows, stop: Callable[[], bool] = lambda: False
) -> Trajectory | None:
    """A law s(t) of continuous acceleration, at rest and without acceleration at both ends, never decreasing.

    It starts from TOPP-RA's law under one more speed limit, sd^3 |q'''| <= half the jerk limit, which accounts for
    corners. Control points are values of that law (Schoenberg's approximation).

    Holds at: three samples of every span of the spline and both sides of the path's breakpoints; joint velocity, tool
    and torque limits are interpolated between the `rows`.

    Args:
        path: q over s.
        limits: of the n joints; their jerk is finite for one at least.
        rows: the other limits, at points of the path with all its breakpoints among them.
        stop: polled at every step of the refinement, which it ends.

    Returns:
        None where TOPP-RA finds no law to start from.
    """
    fast = _start(path, limits, rows)
    if fast is None:
        return None
    basis, limited = Basis(_breakpoints(path, limits, rows, fast)), LawLimits(path, limits, rows)
    control = fast((basis.knots[1:-3] + basis.knots[2:-2] + basis.knots[3:-1]) / 3.0)[:, 0]
    control[:3], control[-3:] = 0.0, path.duration
    basis.slow_down(_slowness(limited(basis(control))))
    radius = _RADIUS * path.duration
    for _ in range(_STEPS):
        if stop():
            break
        step = _step(basis, control, limited(basis(control)), radius)
        if step is None:
            break
        tau, share = _best_share(limited, basis, control, step)
        if tau < 1.0:
            control = control + share * step
            basis.slow_down(tau)
            radius = 2.0 * share * float(np.abs(step).max())
        else:
            radius *= 0.1
        if (share == 1.0 and 1.0 - _ENOUGH < tau < 1.0) or radius < _SMALLEST * path.duration:
            break
    return Trajectory.from_bspline(("s",), basis.knots, control[:, None], 3)


def _start(path: Trajectory, limits: Limits, rows: Rows) -> Trajectory | None:
    before = np.nextafter(rows.s, 0.0)
    third = np.maximum(np.abs(path(rows.s, 3)), np.abs(path(before, 3)))
    with np.errstate(divide="ignore"):
        careful = np.cbrt(_JERK_SHARE / (third / limits.jerk).max(axis=1))
    return fastest_law(replace(rows, speed=np.minimum(rows.speed, careful)))


def _breakpoints(path: Trajectory, limits: Limits, rows: Rows, fast: Trajectory) -> Array:
    """Return the breakpoints of the spline, s: dense where the law changes quickly, at most `_MOST` spans.

    That is at the ends, where the acceleration rises at the jerk limits, and in short pieces of the path.
    """
    T, ends = fast.duration, np.array([0.0, path.duration])
    rise = np.abs(path(ends, 1)) * np.abs(2.0 * fast.coefficients[[0, -1], 2])
    ramp = float((rise / limits.jerk).max())
    x = np.linspace(0.0, T, _FINEST + 1)
    passed = np.interp(path.breakpoints, rows.s, fast.breakpoints)
    piece = np.diff(passed)[np.searchsorted(passed[1:-1], x, side="right")]
    graded = ramp / _PER_RAMP + _GROWTH * np.minimum(x, T - x)
    per_piece = min(_PER_PIECE, _FEWEST / len(path.coefficients))  # many pieces are no corners
    span = np.minimum(np.minimum(graded, piece / per_piece), T / _FEWEST)
    rate = 1.0 / np.maximum(span, T / _FINEST)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * (T / _FINEST)
    spans = int(min(np.ceil(count[-1]), _MOST))
    return np.interp(np.linspace(0.0, count[-1], spans + 1), count, x)


def _slowness(blocks: list[Block]) -> float:
    return max(block.slowness() for block in blocks)


def _best_share(limited: LawLimits, basis: Basis, control: Array, step: Array) -> tuple[float, float]:
    """How slow the law must run after a share of the step, and that share: the first that the next does not beat."""
    best = np.inf, 0.0
    for share in _SHARES:
        tau = _slowness(limited(basis(control + share * step)))
        if tau >= best[0]:
            break
        best = tau, share
    return best


def _step(basis: Basis, control: Array, blocks: list[Block], radius: float) -> Array | None:
    """The change of the control points (N,) that the linear program proposes; None when the solver gives up."""
    count = len(control)
    rows = _program_rows(basis, blocks, count)
    with loading():
        import qpsolvers
        import scipy.sparse as sp

    falling = sp.diags([1.0, -1.0], [0, 1], shape=(count - 1, count))
    matrix = sp.bmat([[rows.by_control, sp.csr_matrix(rows.by_tau[:, None])], [falling, None]], format="csc")
    free = np.append(np.arange(3, count - 3), count)  # the others keep both ends at rest; the last column is tau - 1
    low = np.append(np.full(count - 6, -radius), _LEAST_TAU - 1.0)
    high = np.append(np.full(count - 6, radius), 0.0)
    quadratic, linear = sp.diags(np.full(len(free), _REGULARISATION), format="csc"), np.zeros(len(free))
    linear[-1] = 1.0
    program = qpsolvers.Problem(
        quadratic, linear, matrix[:, free], np.append(rows.right, np.diff(control)), None, None, low, high
    )
    solution = qpsolvers.solve_problem(program, solver="piqp", eps_abs=_ACCURACY, eps_rel=_ACCURACY)
    if not solution.found or solution.x is None:
        return None
    return np.concatenate([np.zeros(3), solution.x[:-1], np.zeros(3)])


class _ProgramRows(NamedTuple):
    """Rows a . dc + b (tau - 1) <= r: a (R, count), b (R,), r (R,)."""

    by_control: "csr_matrix"
    by_tau: Array
    right: Array


def _program_rows(basis: Basis, blocks: list[Block], count: int) -> _ProgramRows:
    """Return the rows of both signs of every limit.

    Values far from their bounds are left out, but at each sample the one that grows most steeply stays. On a straight
    stretch of the path all joints of a block are in proportion, and that one bounds the others.
    """
    from scipy.sparse import csr_matrix

    columns, entries, by_tau, right = [], [], [], []
    for block in blocks:
        parts = zip(block.gradient, basis.values[:, block.sample], strict=True)
        gradient = sum((g[:, :, None] * values[:, None, :] for g, values in parts), np.zeros(()))
        steepest = (np.abs(block.gradient[block.power]) / block.bound).argmax(axis=1)
        for sign in (1.0, -1.0):
            share = sign * (block.value + block.offset) / block.bound
            wanted = share > _ACTIVE
            wanted[np.arange(len(share)), steepest] = True
            k, j = np.nonzero(wanted)
            columns.append(basis.first[block.sample[k], None] + np.arange(4))
            entries.append(sign * gradient[k, j] / block.bound[j, None])
            by_tau.append(-block.power * (1.0 - sign * block.offset[k, j] / block.bound[j]))
            right.append(1.0 - share[k, j])
    column, entry = np.concatenate(columns), np.concatenate(entries)
    starts = 4 * np.arange(len(column) + 1)
    matrix = csr_matrix((entry.ravel(), column.ravel(), starts), shape=(len(column), count))
    return _ProgramRows(matrix, np.concatenate(by_tau), np.concatenate(right))
