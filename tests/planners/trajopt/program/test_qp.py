"""The program of one step: rows that are left out come back where they matter, and no variable has a unit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.program import qp, sqp
from optiplan.planners.trajopt.program.qp import Penalty, Step, Subproblem
from optiplan.planners.trajopt.program.sqp import DescentOptions, PythonProgram, descend
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import Margins
from optiplan.planners.trajopt.terms.term import CostModel, SoftRows
from tests.planners import cases

RADIUS = 0.3


def transcription(unit: float = 1.0) -> SimpleNamespace:
    """What a program needs of a problem without contacts and torques, for joints measured in `unit` of theirs."""
    basis, limits = SplineBasis(bunched_breakpoints(14, 0.6)), cases.robot("panda").limits
    scaled = {name: getattr(limits, name) / unit for name in ("lower", "upper", "velocity", "acceleration", "jerk")}
    limits = replace(limits, **scaled)
    nothing = CostModel.none(basis.variables, len(limits.lower))
    return SimpleNamespace(
        basis=basis,
        limits=limits,
        rates=limits.rates,
        objective=SimpleNamespace(time=1.0, jerk=0.0),
        curve=lambda control, duration: None,
        cost_model=lambda curve: nothing,
    )


def curve(made: SimpleNamespace, unit: float = 1.0) -> tuple[np.ndarray, float]:
    """Control points of a detour, and the duration at which they hold the limits."""
    way = np.array([cases.READY, 0.5 * (cases.READY + cases.LEFT) + 0.3, cases.LEFT]) / unit
    control = along_path(made.basis, way, made.limits.velocity)
    return control, made.basis.shortest_duration(control, made.rates)


def obstacle(made: SimpleNamespace, unit: float = 1.0) -> Penalty:
    """A centimetre is missing at one sample; 1 rad of any joint of three control points makes up for 2 cm."""
    by_control = np.zeros((1, (made.basis.size - 6) * 7))
    by_control[0, 28:49] = 0.02 * unit
    return Penalty(SoftRows(np.zeros(1, dtype=np.intp), np.array([-0.01]), by_control, np.zeros(1)), 0.5, 0.01)


def solved(made: SimpleNamespace, unit: float = 1.0) -> Step:
    control, duration = curve(made, unit)
    step = Subproblem(made, "piqp").solve(control, duration, [obstacle(made, unit)], RADIUS, duration)
    assert step is not None
    return step


def test_rows_left_out_come_back_where_a_solution_exceeds_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many steps as it likes with all rows, and with those alone that are needed: the same step."""
    made = transcription()
    counts = []
    hard = Subproblem._hard
    monkeypatch.setattr(
        Subproblem, "_hard", lambda self, wanted, *rest: counts.append(wanted.sum()) or hard(self, wanted, *rest)
    )
    few = solved(made)
    needed = counts.copy()
    monkeypatch.setattr(qp, "NEAR", -np.inf)
    counts.clear()
    every = solved(made)
    assert len(counts) == 1
    assert needed[-1] < 0.65 * counts[0], "most rows are never needed"
    assert len(needed) > 1, "some row was exceeded, and came back"
    assert few.duration == pytest.approx(every.duration, rel=2e-3)
    reach = RADIUS * made.limits.velocity * curve(made)[1]
    assert np.abs((few.control - every.control) / reach).max() < 0.05
    assert few.promise == pytest.approx(every.promise, rel=2e-2)


def test_a_step_holds_all_rows_to_a_hundredth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also those that the program did not have."""
    made = transcription()
    step = solved(made)
    for order, bound in enumerate(made.rates, start=1):
        share = np.abs(made.basis.bounded[order - 1] @ step.control) / (bound * step.duration**order)
        assert share.max() <= 1.0 + qp.EXCEEDED + 1e-3
    monkeypatch.setattr(qp, "ROUNDS", 1)
    loose = solved(made)
    shares = [
        np.abs(made.basis.bounded[order - 1] @ loose.control) / (bound * loose.duration**order)
        for order, bound in enumerate(made.rates, start=1)
    ]
    assert max(share.max() for share in shares) > 1.0 + 2.0 * qp.EXCEEDED, "without them it would not"


@pytest.mark.parametrize("unit", [100.0, 1e-3])
def test_programs_have_no_units(unit: float) -> None:
    """A robot whose joints are counted in other units makes the same steps."""
    plain, other = transcription(), transcription(unit)
    expected, found = solved(plain), solved(other, unit)
    assert found.duration == pytest.approx(expected.duration, rel=1e-6)
    assert found.promise == pytest.approx(expected.promise, rel=1e-6)
    np.testing.assert_allclose(found.control * unit, expected.control, atol=1e-6)


def test_a_curve_that_stays_deep_inside_is_stalled() -> None:
    after, hopeless = sqp.STALLED, 10.0 * sqp.MAX_VIOLATION
    assert not sqp._stalled([hopeless] * after)
    assert sqp._stalled([hopeless] * (after + 1))
    assert not sqp._stalled([hopeless] * after + [0.9 * sqp.HALVED * hopeless])
    assert sqp._stalled([2.0 * sqp.STUCK] * (after + 1))
    assert not sqp._stalled([sqp.STUCK] * (after + 1)), "what is nearly out goes on"


def test_hopeless_curves_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Straight through a bar that the arm cannot pass: the descent ends with the step that shows it."""
    problem = cases.barred()
    model = CollisionModel(problem.robot, problem.scene)
    basis = SplineBasis(bunched_breakpoints(22, 0.6))
    line = along_path(basis, np.array([problem.start, problem.goal[0].q]), problem.limits.velocity)
    made = Transcription(problem, model, basis, Margins.between(model, line[[0, -1]], 0.005))
    made.set_samples(np.linspace(0.0, 1.0, 66)[1:-1])
    monkeypatch.setattr(sqp, "STALLED", 3)
    found = descend(PythonProgram(Subproblem(made, "piqp")), line, DescentOptions(120, lambda: False))
    assert found.missing > sqp.MAX_VIOLATION
    assert found.log.ended == "penetration"
    monkeypatch.setattr(sqp, "_stalled", lambda missing: False)
    assert (
        found.steps < descend(PythonProgram(Subproblem(made, "piqp")), line, DescentOptions(120, lambda: False)).steps
    )


def test_curves_that_wind_themselves_around_things_are_given_up() -> None:
    """After `slow` steps, and not before, what takes longer than it may ends; without a limit it goes on."""
    problem = cases.wall()
    model = CollisionModel(problem.robot, problem.scene)
    basis = SplineBasis(bunched_breakpoints(22, 0.6))
    line = along_path(basis, np.array([problem.start, problem.goal[0].q]), problem.limits.velocity)
    made = Transcription(problem, model, basis, Margins.between(model, line[[0, -1]], 0.005))
    made.set_samples(np.linspace(0.0, 1.0, 66)[1:-1])
    found = descend(
        PythonProgram(Subproblem(made, "piqp")), line, DescentOptions(8, lambda: False, longest=0.1, slow=2)
    )
    assert found.steps in (2, 3)
    assert found.log.ended == "too slow"
    unlimited = DescentOptions(8, lambda: False, longest=100.0, slow=2)
    assert descend(PythonProgram(Subproblem(made, "piqp")), line, unlimited).steps > 3


@pytest.mark.parametrize("radius", [0.1, 0.003])
def test_rows_out_of_reach_change_nothing(monkeypatch: pytest.MonkeyPatch, radius: float) -> None:
    """Contacts that no step inside the trust region can violate are left out: the same step, with fewer rows."""
    problem = cases.wall()
    model = CollisionModel(problem.robot, problem.scene)
    basis = SplineBasis(bunched_breakpoints(22, 0.6))
    line = along_path(basis, np.array([problem.start, problem.goal[0].q]), problem.limits.velocity)
    made = Transcription(problem, model, basis, Margins.between(model, line[[0, -1]], 0.005))
    made.set_samples(np.linspace(0.0, 1.0, 66)[1:-1])
    point = sqp.evaluate(made, line, 0.0)
    counts = []
    within = qp.within_reach

    def counting(*arguments):  # type: ignore[no-untyped-def]
        rows = within(*arguments)
        counts.append((len(arguments[0].value), len(rows.value)))
        return rows

    monkeypatch.setattr(qp, "within_reach", counting)
    tight = {**qp.TOLERANCES, "piqp": dict.fromkeys(qp.TOLERANCES["piqp"], 1e-9)}
    monkeypatch.setattr(qp, "TOLERANCES", tight)
    culled = Subproblem(made, "piqp").solve(point.control, point.duration, point.soft, radius, point.span)
    monkeypatch.setattr(qp, "within_reach", lambda rows, *arguments: rows)
    whole = Subproblem(made, "piqp").solve(point.control, point.duration, point.soft, radius, point.span)
    assert culled is not None
    assert whole is not None
    assert any(kept < rows for rows, kept in counts)
    assert culled.duration == pytest.approx(whole.duration, rel=1e-5)
    assert culled.promise == pytest.approx(whole.promise, rel=1e-5)
    np.testing.assert_allclose(culled.control, whole.control, atol=1e-3)  # the programs are nearly linear
