"""Planner `casadi`: what it holds and pays for besides what every planner owes (`tests/planners/behaviour`)."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.planners.registry import make_planner
from optiplan.planners.trajopt.nonlinear.options import CasadiOptions
from optiplan.planners.trajopt.nonlinear.solvers import SOLVERS, installed
from optiplan.planners.trajopt.options import AUTO, TrajOptOptions
from tests.planners import cases

pytestmark = pytest.mark.usefixtures("processor_clock")


def test_it_finds_the_motion_of_trajopt():
    problem = op.load_problem("01_reach")
    ours, own = op.plan(problem), op.plan(problem, "casadi", options={"solver": "sqpmethod+piqp"})
    assert own.verified
    assert own.duration == pytest.approx(ours.duration, rel=1e-3)


def test_a_moving_start_is_kept():
    options = {"solver": "sqpmethod+piqp", "seeds": 1, "iterations": 6}
    run = op.plan(op.load_problem("37_on_the_move"), "casadi", options=options, budget=5.0)
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
