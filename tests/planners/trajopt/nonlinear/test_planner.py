"""Planner `casadi`: what it holds and pays for besides what every planner owes (`tests/planners/behaviour`)."""

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.errors import InputError
from optiplan.planners.registry import make_planner
from optiplan.planners.trajopt.nonlinear.options import CasadiOptions
from optiplan.planners.trajopt.nonlinear.solvers import SOLVERS, NlpSolver, installed
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.options import AUTO, TrajOptOptions
from optiplan.planners.trajopt.program.sqp import DescentOptions
from tests.planned import Until
from tests.planners import cases

pytestmark = pytest.mark.usefixtures("processor_clock")


def test_it_finds_the_motion_of_trajopt():
    problem = op.load_problem("01_reach")
    ours, own = op.plan(problem), op.plan(problem, "casadi", options={"solver": "sqpmethod+piqp"})
    assert own.verified
    assert own.duration == pytest.approx(ours.duration, rel=1e-3)


def test_a_moving_start_is_kept():
    options, progress = {"solver": "sqpmethod+piqp", "seeds": 1, "iterations": 6}, Until()
    budget = op.Budget(5.0, progress.met)
    run = op.plan(op.load_problem("37_on_the_move"), "casadi", options=options, budget=budget, progress=progress)
    assert run.verified
    assert np.abs(run.trajectory.state(0.0).v).max() > 0.1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"solver": "snopt"}, "planner 'casadi': solver: 'snopt'; expected one of ipopt, "),
        ({"solver": "piqp"}, "planner 'casadi': solver: 'piqp'; expected one of ipopt, "),
        ({"workers": 2}, "planner 'casadi': workers: 2; expected 1: solvers of CasADi run one at a time"),
    ],
)
def test_bad_options_list_the_choices(options, words):
    with pytest.raises(InputError, match=words):
        make_planner("casadi", options)


def test_machine_code_finds_the_same():
    runs = [op.plan(cases.planar(), "casadi", {"compiled": one, "seeds": 1}) for one in (True, False)]
    assert runs[0].duration == pytest.approx(runs[1].duration, rel=1e-6)


def test_solvers_are_those_that_casadi_has():
    assert "ipopt" in installed()
    assert set(installed()) <= set(SOLVERS)


def test_estimates_of_paths_are_those_of_trajopt():
    few = CasadiOptions(margin=0.01).coarse(10, 30)
    assert type(few) is TrajOptOptions
    assert (few.spans, few.samples, few.margin, few.solver) == (10, 30, 0.01, AUTO)


def test_a_budget_ends_a_program():
    run = op.plan(cases.wall(), "casadi", budget=0.3)
    assert run.timings["plan"] < 1.0


@pytest.mark.parametrize(
    ("raised", "expected"), [("no descent direction", None), ("KeyboardInterrupt", KeyboardInterrupt)]
)
def test_what_a_solver_raises_is_a_failed_step_but_ctrl_c_is_not(monkeypatch, raised, expected):
    problem = op.load_problem("12_planar")
    optimiser = Optimiser(problem, planning_model(problem.robot, problem.scene), CasadiOptions())
    control = optimiser.along(np.array([problem.start, problem.start + 0.1]))
    descender = optimiser.descender(control)
    descender.set_samples(optimiser.instants(control))

    def fails(**_):
        raise RuntimeError(raised)

    monkeypatch.setattr(NlpSolver, "make", lambda *_, **__: fails)
    options = DescentOptions(3, lambda: False)
    if expected is None:
        assert descender.optimise(control, options).log.rows[:, -1].tolist() == [0.0, 0.0, 0.0]
    else:
        with pytest.raises(expected):
            descender.optimise(control, options)
