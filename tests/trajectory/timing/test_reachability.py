"""`fastest_law`: TOPP-RA beside linear programs for each of its steps, and beside the library of its authors."""

import logging

import numpy as np
import pytest
from scipy.optimize import linprog

from optiplan.trajectory.timing.path_constraints import Rows, ToolLimits, rows_at
from optiplan.trajectory.timing.reachability import fastest_law
from optiplan.trajectory.trajectory import Trajectory
from tests.planners import cases

KINDS = ("any", "joints", "joints and gravity", "without sdd in places")


def random_rows(seed, kind):
    """Return up to eight limits on a coarse grid of up to 40 points."""
    rng = np.random.default_rng(seed)
    k, m = rng.integers(2, 40), rng.integers(1, 8)
    s = np.cumsum(np.concatenate([[0.0], rng.uniform(0.001, 0.1, k - 1)]))
    A, B, G = rng.normal(size=(3, k, m)) * np.array([1.0, 1.0, 0.3])[:, None, None]
    if kind != "any":
        w, phase = rng.uniform(0.3, 4.0, m), rng.uniform(0.0, 6.0, m)
        angle = w * s[:, None] + phase
        A, B = np.cos(angle) * w, -np.sin(angle) * w**2
        G = 0.2 * np.cos(3.0 * s[:, None] + phase) * (kind != "joints")
    if kind == "without sdd in places":
        A[rng.uniform(size=A.shape) < 0.2] = 0.0
        A[rng.uniform(size=A.shape) < 0.1] *= 1e-14
    speed = np.where(rng.uniform(size=k) < 0.3, np.inf, rng.uniform(0.3, 5.0, k))
    return Rows(s, speed, A, B, G, rng.uniform(0.5, 2.0, m))


def squares_by_programs(rows):
    """Return sd² at the points by a linear program in (x, u) for each step of both passes; None without a law."""
    k, step = len(rows.s), 2.0 * np.diff(rows.s)
    low, high, x = np.zeros(k), np.zeros(k), np.zeros(k)

    def solve(i, cost, x_bounds):
        rest = [(rows.A[i], rows.B[i], rows.G[i])]
        rest.append((rows.A[i + 1] + step[i] * rows.B[i + 1], rows.B[i + 1], rows.G[i + 1]))
        a, b, g = (np.concatenate(parts) for parts in zip(*rest, strict=True))
        bound = np.tile(rows.bound, 2)
        left = np.vstack([np.column_stack([sign * b, sign * a]) for sign in (1.0, -1.0)])
        left = np.vstack([left, [1.0, step[i]], [-1.0, -step[i]]])
        right = np.concatenate([bound - g, bound + g, [high[i + 1], -low[i + 1]]])
        exact = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
        return linprog(cost, left, right, bounds=[x_bounds, (None, None)], method="highs-ds", options=exact)

    for i in reversed(range(k - 1)):
        range_of_x = (0.0, min(rows.speed[i], 1e6) ** 2)
        most, least = solve(i, [-1.0, 0.0], range_of_x), solve(i, [1.0, 0.0], range_of_x)
        if most.status or least.status:
            return None
        low[i], high[i] = least.x[0], most.x[0]
    if low[0] > 1e-9:
        return None
    for i in range(k - 1):
        best = solve(i, [0.0, -1.0], (x[i], x[i]))
        if best.status:  # x is at the end of its set, by the solver's tolerance beyond it
            best = solve(i, [0.0, -1.0], (x[i] * (1.0 - 1e-8), x[i]))
        x[i + 1] = x[i] + step[i] * best.x[1]
    return x


def excess(rows, sd):
    """Return by how much the largest share of a limit exceeds 1, at both ends of every interval."""
    x = sd**2
    u = (np.diff(x) / (2.0 * np.diff(rows.s)))[:, None]
    ends = (slice(None, -1), slice(1, None))
    shares = [np.abs(rows.A[e] * u + rows.B[e] * x[e, None] + rows.G[e]) / rows.bound for e in ends]
    return max(np.max(shares), (sd / rows.speed).max()) - 1.0


def speeds_of(law):
    """Return sd at the points of the grid."""
    return law(law.breakpoints, 1)[:, 0]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_each_step_is_that_of_a_linear_program(kind, seed):
    rows = random_rows(seed, kind)
    expected, law = squares_by_programs(rows), fastest_law(rows)
    assert (law is None) == (expected is None)
    if law is not None:
        assert speeds_of(law) ** 2 == pytest.approx(expected, abs=1e-6 * expected.max())


@pytest.mark.parametrize("kind", KINDS)
def test_the_limits_hold_at_the_points_from_both_sides(kind):
    laws = [(rows, law) for rows in (random_rows(seed, kind) for seed in range(60)) if (law := fastest_law(rows))]
    assert len(laws) > 40
    for rows, law in laws:
        assert excess(rows, speeds_of(law)) < 1e-11
        assert law(law.breakpoints)[:, 0] == pytest.approx(rows.s - rows.s[0], abs=1e-12)


def test_one_joint_is_bang_bang():
    """|u| <= 2 over a length of 1: sd = 2 sqrt(s) up to the middle, then back."""
    s = np.linspace(0.0, 1.0, 101)
    rows = Rows(s, np.full(101, np.inf), np.ones((101, 1)), np.zeros((101, 1)), np.zeros((101, 1)), np.array([2.0]))
    law = fastest_law(rows)
    assert speeds_of(law) == pytest.approx(2.0 * np.sqrt(np.minimum(s, 1.0 - s)), abs=1e-12)
    assert law.duration == pytest.approx(np.sqrt(2.0), abs=1e-12)


@pytest.mark.parametrize("holds", [True, False])
def test_a_place_that_cannot_be_stood_at_is_passed_with_momentum_or_not_at_all(holds):
    """Gravity exceeds the limit in the middle by 0.05; sd² of 0.1 helps there, and 0.04 of it do not."""
    s = np.linspace(0.0, 1.0, 41)
    A, B, G = np.ones((41, 2)), np.zeros((41, 2)), np.zeros((41, 2))
    A[:, 1], G[:, 1] = 0.0, np.where(np.abs(s - 0.5) < 0.1, -1.05, 0.0)
    B[:, 1] = 0.5
    rows = Rows(s, np.full(41, np.inf if holds else 0.2), A, B, G, np.ones(2))
    law = fastest_law(rows)
    assert (law is not None) == holds
    if law is not None:
        assert excess(rows, speeds_of(law)) < 1e-11


def library_speeds(rows):
    """Return sd at the points, by the solver of the library."""
    from toppra.algorithm import TOPPRA  # with pyplot: a second of each worker where it collects tests
    from toppra.constraint import LinearConstraint
    from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate
    from toppra.interpolator import AbstractGeometricPath

    m = rows.A.shape[1]
    F, g = np.vstack([np.eye(m), -np.eye(m)]), np.tile(rows.bound, 2)
    squared = np.column_stack([np.zeros(len(rows.s)), np.minimum(rows.speed, 1e6) ** 2])

    class Given(LinearConstraint):
        dof = 1

        def __init__(self):
            super().__init__()
            self.identical = True

        def compute_constraint_params(self, path, grid):
            both_ends = canlinear_colloc_to_interpolate(rows.A, rows.B, rows.G, F, g, None, None, grid, True)
            return *both_ends[:5], None, squared

    class ScalarPath(AbstractGeometricPath):
        dof, path_interval, waypoints = 1, rows.s[[0, -1]], None

        def __call__(self, s, order=0):
            return np.zeros((*np.shape(s), 1))

    logging.getLogger("toppra").addHandler(logging.NullHandler())
    return TOPPRA([Given()], ScalarPath(), gridpoints=rows.s, solver_wrapper="seidel").compute_parameterization(0, 0)[1]


@pytest.mark.parametrize("limits", [{}, {"linear": 0.3}, {"linear_acceleration": 1.5}])
@pytest.mark.parametrize("points", [160, 801])
def test_the_library_finds_the_same_law(limits, points):
    """To its own tolerance, and to the 1e-8 by which it lowers every sd² against rounding."""
    robot = cases.robot("panda")
    middle, half = 0.5 * (robot.limits.upper + robot.limits.lower), 0.15 * (robot.limits.upper - robot.limits.lower)
    via = middle + half * np.random.default_rng(5).uniform(-1.0, 1.0, (9, robot.n))
    knots = np.concatenate([np.zeros(5), np.linspace(0.0, 4.0, 5), 4.0 * np.ones(5)])
    path = Trajectory.from_bspline(robot.joint_names, knots, via, 5)
    tool = ToolLimits(robot.tool_frame, **limits) if limits else None
    rows = rows_at(path, robot, robot.limits, tool, np.linspace(0.0, path.duration, points))
    ours, theirs = speeds_of(fastest_law(rows)), library_speeds(rows)
    assert ours == pytest.approx(theirs, abs=1e-5 * theirs.max())
    assert excess(rows, ours) < 1e-11
