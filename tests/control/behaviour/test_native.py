"""What the controller asks of the native core, beside the reference in Python."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.control import arguments, row_stack, stopping_guard
from optiplan.control.braking_path import BrakingPath, NativeBrakingPath
from optiplan.control.limits import stop_limits, tool_speed
from optiplan.control.limits import torque as torque_module
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.stop_limits import Abilities, DistanceView, StopLimit
from optiplan.control.objective import program_in_python
from optiplan.control.qp.active_set import ActiveSet, active_at, solve_from, solve_in_python
from optiplan.control.qp.program import Program
from optiplan.control.qp.solvers import QpSolvers
from optiplan.control.row_stack import RowStack
from optiplan.control.tasks import base, frame_tasks, joint_tasks

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


def beside_python(monkeypatch, module, call):
    """What a call gives with the native core, and what it gives without it in a module."""
    native = call()
    with monkeypatch.context() as without:
        without.setattr(module, "core", None)
        return native, call()


def agree(rows, others):
    for name in ("G", "low", "high", "unit"):
        np.testing.assert_allclose(getattr(rows, name), getattr(others, name), rtol=1e-10, atol=1e-12)
    assert rows.labels == others.labels


@pytest.mark.parametrize("n", [2, 7])
def test_programs_of_tasks_agree(n):
    """Of tasks with and without feed-forward, drift and rates of their own; near singularities and far from them."""
    rng = np.random.default_rng(5)
    for k in range(200):
        sizes, parts = (3, int(rng.integers(1, 7))), []
        for size in sizes:
            J = np.asfortranarray(rng.normal(size=(size, n)))
            if k % 4 == 0:
                J[0] = J[-1] * (1.0 + 1e-3 * rng.random())
            error, wanted, cost, *others = rng.normal(size=(6, size))
            given = [other if rng.random() < 0.5 else None for other in others]
            parts.append((J, error, wanted, np.abs(cost), *given))
        rows = sum(sizes)
        main = np.flatnonzero(rng.random(rows) < 0.6)
        measured = (0, 0) if k % 3 == 0 else (3, rows)
        v, a = rng.normal(size=(2, n))
        rules = np.array([DT, 0.9 * (k % 2), 0.02, 0.9 * DT, 0.5, 0.05])
        results = []
        for program in (core.task_program, program_in_python):
            arrays = np.zeros((rows, n)), np.zeros((3, rows)), np.zeros((n, n)), np.zeros(n)
            results.append((*arrays, *program(parts, main, measured, (v, a), 1e-6, rules, arrays)))
        for native, python in zip(*(result[:-1] for result in results), strict=True):
            np.testing.assert_allclose(native, python, rtol=1e-7, atol=1e-6)
        assert not measured[1] or results[0][-1] == pytest.approx(results[1][-1], rel=1e-7, abs=1e-5)
        A, x = results[0][0], rng.normal(size=n)
        undone, wanted = core.undone(A, results[0][1][2], main, x)
        assert undone == pytest.approx(np.linalg.norm((A @ x - results[0][1][2])[main]))
        assert wanted == pytest.approx(np.linalg.norm(results[0][1][2][main]))


def test_rows_of_a_pose_agree(monkeypatch, panda):
    """Errors up to half a turn, rows of the Jacobian, and rates that slow down where the target is far."""
    rng, tool = np.random.default_rng(6), op.PoseTask(panda.tool_frame)
    controller = op.Controller(panda, [tool])
    for k in range(100):
        c = controller.configuration(op.State(rng.uniform(panda.limits.lower, panda.limits.upper)))
        turn = rng.normal(size=3)
        turn *= rng.choice([0.0, 1e-9, 1e-5, 1e-3, 0.3, 3.0, np.pi - 1e-5]) / np.linalg.norm(turn)
        X = c.pose(panda.frame_id(panda.tool_frame))
        tool.set_target(pin.SE3(X.rotation @ pin.exp3(turn), X.translation + rng.normal(0.0, 0.1 * (k % 3), 3)))
        native, python = beside_python(monkeypatch, frame_tasks, lambda c=c: (*tool.evaluate(c), tool._turn))
        for one, other in zip(native, python, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
        rates = beside_python(monkeypatch, base, lambda e=native[0]: tool.wanted_rate(e))
        np.testing.assert_allclose(*rates, rtol=1e-12, atol=1e-15)


def test_rates_of_a_posture_agree(monkeypatch, panda):
    rng, posture = np.random.default_rng(7), op.PostureTask("ready", gain=3.0)
    posture.bind(panda)
    for size in (0.0, 0.1, 1.0, 10.0):
        for _ in range(20):
            e = size * rng.normal(size=7)
            rates = beside_python(monkeypatch, joint_tasks, lambda e=e: posture.wanted_rate(e))
            np.testing.assert_allclose(*rates, rtol=1e-12, atol=1e-15)


def test_rows_of_limits_agree(monkeypatch, panda):
    """Of torques and of speeds; and whether velocities keep them."""
    rng, torque, limits = np.random.default_rng(8), op.TorqueLimit(), panda.limits
    speeds = [op.ToolSpeedLimit(linear=1.0), op.ToolSpeedLimit(angular=2.0), op.ToolSpeedLimit(linear=1.0, angular=2.0)]
    everything = [torque, *speeds, op.AccelerationLimit(), op.JerkLimit()]
    controller = op.Controller(panda, [], limits=everything)
    stack = RowStack([torque, *speeds], [], panda.n)
    for k in range(40):
        v = np.zeros(7) if k == 0 else rng.uniform(-1.0, 1.0, 7) * limits.velocity
        state = op.State(rng.uniform(limits.lower, limits.upper), v, rng.normal(size=7))
        c = controller.configuration(state)
        for limit, module in [(torque, torque_module), *[(speed, tool_speed) for speed in speeds]]:
            rows = beside_python(monkeypatch, module, lambda limit=limit, c=c, state=state: limit.rows(c, state, DT))
            agree(*rows)
            for parts in (list(rows), list(rows[::-1])):  # the core's own rows beside others
                for native, python in zip(core.stack_rows(parts, 7), row_stack.stack_in_python(parts, 7), strict=True):
                    np.testing.assert_array_equal(native, python)
        stack.collect(c, state, DT, [])
        x = v + 0.05 * rng.normal(size=7)
        holds = beside_python(monkeypatch, row_stack, lambda x=x: stack.holds(x))
        assert holds[0] == holds[1]


def test_what_is_not_finite_is_found(monkeypatch):
    rng = np.random.default_rng(9)
    for bad in (0.0, np.nan, np.inf, -np.inf, 1e200):
        arrays = rng.normal(size=7), np.asfortranarray(rng.normal(size=(4, 4)))
        arrays[1][2, 1] = bad
        found = beside_python(monkeypatch, arguments, lambda arrays=arrays: arguments.squares_are_finite(*arrays))
        assert found == (bad == 0.0, bad == 0.0)


def test_views_rows_and_stops_agree(monkeypatch, panda, box):
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
        v, abilities = rng.normal(size=7), Abilities(box.delay + DT, 1.0 / box.acceleration)
        if len(native):
            near = DistanceView(native.q, native.bound, native.near, native.distance, native.gradient)
            assert (len(near), near.least) == (len(native), native.least)
        given = native, v, abilities, DT, 0.0
        agree(*beside_python(monkeypatch, stop_limits, lambda given=given: limit.rows(*given)))
        before = rng.uniform(0.0, 0.01, len(limit.labels))
        raised = before, before.copy()
        stopping_guard._raise(raised[0], limit, native)
        with monkeypatch.context() as without:
            without.setattr(stopping_guard, "core", None)
            stopping_guard._raise(raised[1], limit, native)
        np.testing.assert_array_equal(*raised)
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
