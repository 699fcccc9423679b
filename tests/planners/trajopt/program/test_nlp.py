"""`op.casadi_problem`: names and bounds of the program, exact derivatives, and what IPOPT finds."""

import casadi
import numpy as np
import pytest

import optiplan as op

SETTINGS = {
    "ipopt.hessian_approximation": "limited-memory",
    "ipopt.max_iter": 200,
    "ipopt.tol": 1e-5,
    "ipopt.print_level": 0,
    "print_time": False,
}


@pytest.fixture(scope="module")
def run():
    return op.plan(op.load_problem("01_reach"))


@pytest.fixture(scope="module")
def shelf():
    problem = op.load_problem("12_planar")
    return op.casadi_problem(problem, op.plan(problem))


def test_each_variable_and_row_has_a_name_and_bounds(shelf):
    assert shelf.x.shape == (len(shelf.x_names), 1) == (len(shelf.x0), 1)
    assert shelf.g.shape == (len(shelf.g_names), 1) == (len(shelf.lbg), 1) == (len(shelf.ubg), 1)
    assert shelf.x_names[-1] == "duration"
    assert len(set(shelf.g_names)) == len(shelf.g_names)
    assert any(name.startswith("clearance of ") for name in shelf.g_names)
    assert "TrajectoryNlp: " in repr(shelf)
    assert "  clearance: " in repr(shelf)


def test_the_planners_motion_holds_its_rows(run):
    nlp = op.casadi_problem(run.problem, run)
    assert nlp.violations(nlp.x0, 1e-3) == {}
    slow = nlp.x0.copy()
    slow[-1] *= 0.5
    assert next(iter(nlp.violations(slow))).startswith("jerk of ")


def test_derivatives_are_those_of_differences(shelf):
    rng = np.random.default_rng(0)
    x = shelf.x0 + 1e-3 * rng.standard_normal(len(shelf.x0))
    d = rng.standard_normal(len(x))
    J = np.array(casadi.Function("J", [shelf.x], [casadi.jacobian(shelf.g, shelf.x)])(x))
    g = casadi.Function("g", [shelf.x], [shelf.g])
    h = 1e-6
    slope = (np.array(g(x + h * d)) - np.array(g(x - h * d))).ravel() / (2.0 * h)
    np.testing.assert_allclose(J @ d, slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max())


def test_ipopt_finds_what_the_planner_finds(run):
    nlp = op.casadi_problem(run.problem, run)
    solver = casadi.nlpsol("solver", "ipopt", nlp.to_casadi(), SETTINGS)
    x = np.array(solver(**nlp.arguments())["x"]).ravel()
    assert nlp.violations(x, 1e-4) == {}
    assert x[-1] == pytest.approx(run.duration, rel=0.02)
    motion = nlp.trajectory(x)
    assert motion.duration == x[-1]
    slower = motion.scaled(1.001 * motion.duration)
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
