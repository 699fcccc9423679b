"""The native core's program of a step against PIQP's, on programs with contacts, torques, jerk and joint limits."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pinocchio as pin
import pytest

from optiplan._core import core, variants
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Box, Obstacle, Scene, Sphere
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.options import AUTO
from optiplan.planners.trajopt.program import native_step, sqp
from optiplan.planners.trajopt.program.native_step import NativeSubproblem, step_solver
from optiplan.planners.trajopt.program.qp import Penalty, Step, Subproblem
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import Margins
from optiplan.planners.trajopt.terms.term import SoftRows
from optiplan.problem.problem import JointGoal, Objective
from optiplan.robot.robot import load_robot
from tests.unchecked_problem import unchecked_problem

pytestmark = pytest.mark.skipif(core is None, reason="the native core is not built")

GOAL = np.array([1.2, 0.3, 0.4, -1.6, 0.3, 1.9, -0.4])


def transcription(jerk: float, spans: int) -> tuple[Transcription, np.ndarray]:
    """A motion past a ball with weak motors, and control points of a first curve."""
    robot = load_robot("panda")
    start = robot.configurations["ready"]
    ball = Obstacle("ball", Sphere(0.08), pin.SE3(np.eye(3), np.array([0.45, 0.25, 0.62])))
    board = Obstacle("board", Box((0.6, 0.6, 0.02)), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.1])))
    limits = replace(robot.limits, torque=0.4 * robot.limits.torque, upper=np.maximum(start, GOAL) + 0.05)
    problem = unchecked_problem(
        name="t",
        robot=robot,
        scene=Scene((ball, board)),
        start=start,
        goal=(JointGoal(GOAL),),
        limits=limits,
        objective=Objective(1.0, jerk),
    )
    model, basis = CollisionModel(robot, problem.scene), SplineBasis(bunched_breakpoints(spans, 0.6))
    made = Transcription(problem, model, basis, Margins.between(model, np.array([start, GOAL]), 0.005))
    made.set_samples(np.linspace(0.02, 0.98, 30))
    return made, along_path(basis, np.array([start, 0.5 * (start + GOAL) + 0.1, GOAL]), limits.velocity)


def exceeded(made: Transcription, step: Step) -> float:
    """How far derivative control points are beyond their limits at the step's end, as a share."""
    return made.basis.shortest_duration(step.control, made.rates) / step.duration - 1.0


@pytest.mark.parametrize("jerk", [0.0, 1e-6])
@pytest.mark.parametrize("spans", [4, 14, 22])
def test_the_native_step_is_as_good_as_piqps_and_holds_the_same_rows(jerk: float, spans: int) -> None:
    made, control = transcription(jerk, spans)
    reference, native = Subproblem(made, "piqp"), NativeSubproblem(made, gap=1e-6)
    point = sqp.evaluate(made, control, 0.0)
    promises = []
    for radius in (0.1, 0.3, 0.02):
        program = (point.control, point.duration, point.soft, radius, point.span)
        expected, found = reference.solve(*program), native.solve(*program)
        assert expected is not None
        assert found is not None
        promises.append(found.promise)
        assert found.promise == pytest.approx(expected.promise, abs=1e-4 * point.duration)
        assert exceeded(made, found) < 1e-5
        moved = np.abs(found.control - point.control) / (made.limits.velocity * point.span)
        assert moved.max() <= radius * (1.0 + 1e-6)
        assert not moved[[0, 1, 2, -3, -2, -1]].any(), "the ends stay"
        assert (found.control <= made.limits.upper + 1e-9).all()
        point = sqp.evaluate(made, found.control, found.duration, point.span)
    assert len(point.rows[0].value) > 0
    assert len(point.rows[1].value) > 0
    assert max(promises) > 0.01, "steps worth comparing"


def test_what_is_promised_is_what_the_linear_model_gives() -> None:
    """The decrease, computed again from the step: time, and the worst violation of each sample at its price."""
    made, control = transcription(0.0, 14)
    point = sqp.evaluate(made, control, 0.0)
    step = NativeSubproblem(made).solve(point.control, point.duration, point.soft, 0.1, point.span)
    assert step is not None
    change = (step.control - point.control)[made.basis.free].ravel()
    gain = point.duration - step.duration
    for part in point.soft:
        rows = part.rows
        after = rows.value + rows.by_control @ change + rows.by_duration * (step.duration - point.duration)
        gain += part.cost() - Penalty(replace(rows, value=after), part.price, part.unit).cost()
    assert step.promise == pytest.approx(gain, abs=1e-5 * point.duration)


def test_all_builds_give_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    made, control = transcription(1e-6, 14)
    point = sqp.evaluate(made, control, 0.0)
    found = []
    for name in variants()[:-1]:
        monkeypatch.setattr(native_step, "core", import_module(f"optiplan._core._core_{name}"))
        solver = NativeSubproblem(made)
        for _ in range(2):
            step = solver.solve(point.control, point.duration, point.soft, 0.1, point.span)
            assert step is not None
            found.append((step.control.tobytes(), step.duration, step.promise))
    assert len(set(found)) == 1


def test_rows_that_are_not_near_the_diagonal_are_refused() -> None:
    made, control = transcription(0.0, 14)
    free = made.basis.size - 6
    far = np.zeros((1, free * 7))
    far[0, [0, -1]] = 1.0
    rows = SoftRows(np.zeros(1, dtype=np.intp), np.array([-0.01]), far, np.zeros(1))
    with pytest.raises(ValueError, match="neighbouring control points"):
        NativeSubproblem(made).solve(control, 5.0, [Penalty(rows, 1.0, 0.01)], 0.1, 5.0)


def test_the_reference_path_is_taken_without_the_core(monkeypatch: pytest.MonkeyPatch) -> None:
    made, _ = transcription(0.0, 14)
    assert isinstance(step_solver(made, AUTO), NativeSubproblem)
    assert isinstance(step_solver(made, "piqp"), Subproblem)
    monkeypatch.setattr(native_step, "core", None)
    assert isinstance(step_solver(made, AUTO), Subproblem)
