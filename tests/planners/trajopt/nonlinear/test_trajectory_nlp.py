"""`op.casadi_problem`: names and bounds of the program, its rows are those of the planner, and what solvers find."""

import casadi
import numpy as np
import pytest

import optiplan as op
from optiplan.planners.trajopt.nonlinear.solvers import installed
from optiplan.planners.trajopt.program.sqp import penalties


@pytest.fixture(scope="module")
def run():
    return op.plan(op.load_problem("01_reach"))


@pytest.fixture(scope="module")
def shelf():
    problem = op.load_problem("12_planar")
    return op.casadi_problem(problem, op.plan(problem))


def test_each_variable_and_row_has_a_name_and_bounds(shelf):
    arguments = shelf.arguments()
    assert len(shelf.x_names) == shelf.x.numel() == len(arguments["x0"]) == len(arguments["ubx"])
    assert len(shelf.g_names) == shelf.g.numel() == len(arguments["lbg"]) == len(arguments["ubg"])
    assert sum(shelf.blocks.values()) == shelf.p.numel() == len(arguments["p"])
    assert shelf.x_names[shelf.control.numel()] == "duration"
    assert len(set(shelf.g_names)) == len(shelf.g_names)
    assert len(set(shelf.x_names)) == len(shelf.x_names)
    assert "TrajectoryNlp: " in repr(shelf)
    assert "  clearance: " in repr(shelf)


def test_the_planners_motion_holds_its_rows(run):
    nlp = op.casadi_problem(run.problem, run)
    x = nlp.arguments()["x0"]
    assert nlp.violations(x, 1e-3) == {}
    slow = x.copy()
    slow[nlp.control.numel()] *= 0.5
    assert next(iter(nlp.violations(slow))).startswith("jerk of ")


def test_rows_and_cost_are_those_of_the_planners_terms(shelf):
    """Of a curve beside the first one: slacks are the violations, and f is the merit."""
    rng = np.random.default_rng(0)
    x = shelf.arguments()["x0"]
    x[: shelf.control.numel()] += 0.05 * rng.standard_normal(shelf.control.numel())
    arguments = shelf.arguments(x)
    f, g = casadi.Function("fg", [shelf.x, shelf.p], [shelf.f, shelf.g])(arguments["x0"], arguments["p"])
    soft = [k for k, name in enumerate(shelf.g_names) if not name.startswith(("velocity", "acceleration", "jerk"))]
    assert np.array(g).ravel()[soft].min() == pytest.approx(0.0, abs=1e-6)
    curve = shelf._curve(x)
    rows = [term.rows(curve) for term in shelf._transcription.terms]
    merit = curve.duration + sum(
        one.cost() for one in penalties(shelf._transcription.terms, rows, shelf.first.duration)
    )
    assert merit > 1.01 * curve.duration, "nothing is violated"
    assert float(f) == pytest.approx(merit, rel=1e-6)


@pytest.mark.parametrize("name", [name for name in ("ipopt", "sqpmethod+piqp", "blocksqp") if name in installed()])
def test_solvers_find_what_the_planner_finds(run, name):
    nlp = op.casadi_problem(run.problem, run)
    solver, x = nlp.solver(name), None
    for _ in range(2):
        x = np.array(solver(**nlp.arguments(x))["x"]).ravel()
    assert nlp.violations(x, 5e-3) == {}
    motion = nlp.trajectory(x)
    assert motion.duration == pytest.approx(run.duration, rel=0.02)
    slower = motion.scaled(1.01 * motion.duration)
    assert op.verify(run.problem, slower).verified


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"problem": 3}, r"^op\.casadi_problem: problem: found the int 3"),
        ({"guess": 3}, r"^op\.casadi_problem: guess: found the int 3"),
    ],
)
def test_errors_name_the_call(arguments, words):
    with pytest.raises(op.InputError, match=words):
        op.casadi_problem(**({"problem": op.load_problem("12_planar")} | arguments))


def test_a_problem_with_more_is_refused():
    task = op.load_problem("40_panda_sorts_cubes")
    with pytest.raises(
        op.InputError, match=r"^op\.casadi_problem: problem: found a problem with a task; expected one "
    ):
        op.casadi_problem(task)
