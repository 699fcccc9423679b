"""What the controller asks of the native core, beside the reference in Python."""

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.control.braking_path import BrakingPath, NativeBrakingPath
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.stop_limits import StopLimit
from optiplan.control.qp.active_set import ActiveSet, active_at, solve_from, solve_in_python
from optiplan.control.qp.program import Program
from optiplan.control.qp.solvers import QpSolvers

pytestmark = pytest.mark.skipif(core is None, reason="the native core was not built")
DT = 0.002


@pytest.fixture(scope="module")
def box(panda):
    limits = [op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit()]
    for limit in limits:
        limit.bind(panda)
    found = JointBox(limits, ["position", "velocity", "jerk", "acceleration"], panda.n, False, 0.1)
    found.prepare(DT)
    return found


def test_stops_agree(panda, box):
    rng = np.random.default_rng(0)
    python, native = BrakingPath(panda), NativeBrakingPath(panda)
    for _ in range(200):
        q, v = rng.uniform(panda.limits.lower, panda.limits.upper), rng.normal(size=7)
        a = rng.uniform(-1.0, 1.0, 7) * panda.limits.acceleration
        for path in (python, native):
            path.start(q, v, a, box, DT)
        assert native.steps == python.steps
        np.testing.assert_allclose(native.end, python.end, atol=1e-13)
        np.testing.assert_allclose(native.way, python.way, atol=1e-13)
        for step in (0, 1, python.steps // 3, python.steps):
            np.testing.assert_allclose(native.at(step), python.at(step), atol=1e-13)
        np.testing.assert_allclose(native.strongest(1, 5), python.strongest(1, 5), atol=1e-12)
        steps = np.arange(0, python.steps, 7)
        for found, expected in zip(native.motion(steps), python.motion(steps), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("by_acceleration", [False, True])
def test_bounds_of_joints_agree(panda, by_acceleration):
    rng, limits = np.random.default_rng(4), panda.limits
    found = [op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit()]
    for limit in found:
        limit.bind(panda)
    native, python = (
        JointBox(found, ["position", "velocity", "jerk", "acceleration"], panda.n, by_acceleration, 0.1)
        for _ in range(2)
    )
    python._table = None
    for _ in range(200):
        q = rng.uniform(limits.lower - 0.05, limits.upper + 0.05)
        v = 1.1 * rng.uniform(-1.0, 1.0, 7) * limits.velocity
        state = op.State(q, v, rng.uniform(-1.0, 1.0, 7) * limits.acceleration)
        for box in (native, python):
            box.update(state, DT)
        np.testing.assert_allclose(native.low, python.low, atol=1e-9)
        np.testing.assert_allclose(native.high, python.high, atol=1e-9)
        np.testing.assert_allclose(native.slowing, python.slowing, atol=1e-12)
        for name in "qva":
            brakes = [getattr(box.brake(state, DT), name) for box in (native, python)]
            np.testing.assert_allclose(*brakes, atol=1e-12)
        assert native.violations(q, v).keys() == python.violations(q, v).keys()
        assert [name for name, *_ in native.at(native.low)] == [name for name, *_ in python.at(python.low)]


def test_singular_values_are_those_of_lapack():
    rng = np.random.default_rng(5)
    for k in range(100):
        J = rng.normal(size=(int(rng.integers(1, 7)), 7))
        if k % 4 == 0:
            J[0] = J[-1] * (1.0 + 1e-6)
        np.testing.assert_allclose(core.singular_values(J), np.linalg.svd(J, compute_uv=False), atol=3e-7)


def test_views_rows_and_stops_agree(panda, box):
    scene = op.Scene([op.Box("post", size=(0.1, 0.1, 0.8), position=(0.45, 0.3, 0.4))])
    limit, c = op.ClearanceLimit(scene), op.Controller(panda, [])
    limit.bind(panda)
    rng, q = np.random.default_rng(2), panda.configurations["ready"].copy()
    native, python, verdicts = None, None, []
    path = NativeBrakingPath(panda)
    for _ in range(60):
        q = np.clip(q + rng.normal(0.0, 0.06, 7), panda.limits.lower, panda.limits.upper)
        here = c.configuration(op.State(q))
        native, python = limit.view(here, native, 0.0), StopLimit.view(limit, here, python, 0.0)
        np.testing.assert_array_equal(native.near, python.near)
        np.testing.assert_allclose(native.distance, python.distance, atol=1e-8)
        seen = np.isfinite(python.bound)
        np.testing.assert_allclose(native.bound[seen], python.bound[seen], atol=1e-8)
        apart = python.distance > 1e-3
        np.testing.assert_allclose(native.gradient[apart], python.gradient[apart], atol=1e-5)
        path.start(q, 2.0 * rng.normal(size=7), np.zeros(7), box, DT)
        least = np.minimum(native.bound - 1e-6, rng.uniform(0.0, 0.1))
        verdicts.append(limit.stop_is_clear(path, native, least, 0.0))
        assert StopLimit.stop_is_clear(limit, path, python, least, 0.0) == verdicts[-1]
    assert 5 < sum(verdicts) < 55, "both answers are worth comparing"


def test_programs_are_solved_as_piqp_solves_them():
    """From a guess as the reference does, and where that gives up by the dual method."""
    rng, solved, given_up = np.random.default_rng(3), 0, 0
    for k in range(300):
        n, m, p = int(rng.integers(2, 10)), int(rng.integers(0, 30)), k % 2
        A = rng.normal(size=(n, n))
        C, inside = rng.normal(size=(m, n)), rng.uniform(-0.5, 0.5, n)
        low = np.where(rng.random(m) < 0.5, -np.inf, C @ inside - 0.1)
        N = rng.normal(size=(p, n))
        ends = np.full(n, -1.0), np.full(n, 1.0)
        H, g = A @ A.T + 0.1 * np.eye(n), 3.0 * rng.normal(size=n)
        program = Program(H, g, C, low, C @ inside + 0.1, ends, N, N @ inside)
        guess = active_at(program, inside, 0.12) if k % 3 else ActiveSet()
        python, native = solve_in_python(program, guess), solve_from(program, guess)
        given_up += python is None
        solved += native is not None
        if native is not None:
            assert program.infeasibility(native[0]) < 1e-7
            np.testing.assert_allclose(native[0], QpSolvers("piqp").solve(program), atol=2e-5)
        if python is not None:
            assert native is not None
            np.testing.assert_allclose(native[0], python[0], atol=1e-8)
    assert solved >= 298
    assert given_up > 30, "the dual method was tried"
