"""`op.casadi_problem`: names and bounds of the program, its rows are those of the planner, and what solvers find."""

import json
import subprocess
import sys

import casadi
import numpy as np
import pytest

import optiplan as op
from optiplan.planners.trajopt.nonlinear.solvers import installed
from optiplan.planners.trajopt.program.sqp import penalties


@pytest.fixture(scope="module")
def run():
    return op.plan(op.load_problem("01_reach"), options={"seeds": 1})


@pytest.fixture(scope="module")
def shelf():
    problem = op.load_problem("12_planar")
    return op.casadi_problem(problem, op.plan(problem, options={"seeds": 1}, budget=2.0))


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


BALL = op.Sphere("ball", radius=0.1, position=(0, 3.0, 0))
LIGHT = ("jerk", "energy", "tool_smoothness", "tool_path", "joint_path", "manipulability", "centring")


@pytest.fixture(scope="module")
def with_everything():
    """Path constraints, all objectives, a wall, motors that gravity can overload, and an end free in its goal."""
    wall = op.Box("wall", size=(0.05, 0.3, 0.42), position=(0.4, 0.25, 0.21))
    goal = op.Pose((0.3, 0.5, 0.5), rpy=(np.pi, 0.0, 0.0))
    problem = op.Problem("panda", start="ready", goal=goal, scene=[wall], limits={"torque": 0.6})
    apart = {"clearance": {"pairs": [["panda_hand", "panda_link0"]], "at_least": 0.44}}
    weights = {"time": 1.0, "clearance": 20.0, **dict.fromkeys(LIGHT, 1e-3)}
    stated = problem.with_constraints({"tool_speed": {"linear": 0.5, "angular": 2.0}}, apart).with_objective(weights)
    return op.casadi_problem(stated)


@pytest.mark.parametrize("which", ["shelf", "with_everything"])
def test_rows_and_cost_are_those_of_the_planners_terms(which, request):
    """Of a curve beside the first one: slacks are the violations, and f is the merit."""
    nlp, rng = request.getfixturevalue(which), np.random.default_rng(0)
    x = nlp.arguments()["x0"]
    x[: nlp.control.numel()] += 0.2 * rng.standard_normal(nlp.control.numel())
    arguments = nlp.arguments(x)
    f, g = casadi.Function("fg", [nlp.x, nlp.p], [nlp.f, nlp.g])(arguments["x0"], arguments["p"])
    soft = [k for k, name in enumerate(nlp.g_names) if not name.startswith(("velocity", "acceleration", "jerk"))]
    assert np.array(g).ravel()[soft].min() == pytest.approx(0.0, abs=1e-6)
    curve, made = nlp._curve(x), nlp._transcription
    rows = [term.rows(curve) for term in made.terms]
    missing = [one.cost() for one in penalties(made.terms, rows, nlp.first.duration)]
    assert sum(missing) > 0.01, "nothing is violated"
    assert any("torque at rest" in name for name in nlp.g_names) == (which == "with_everything")
    assert float(f) == pytest.approx(made.cost(curve) + sum(missing), rel=1e-6)


def test_derivatives_are_those_of_differences(with_everything):
    nlp, rng = with_everything, np.random.default_rng(1)
    at, p = nlp.arguments()["x0"], nlp.arguments()["p"]
    d, h = rng.standard_normal(len(at)), 1e-6
    both = casadi.vertcat(nlp.f, nlp.g)
    value = casadi.Function("fg", [nlp.x, nlp.p], [both])
    slope = casadi.Function("slope", [nlp.x, nlp.p], [casadi.jtimes(both, nlp.x, casadi.DM(d))])
    expected = (np.array(value(at + h * d, p)) - np.array(value(at - h * d, p))) / (2.0 * h)
    found = np.array(slope(at, p))
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


def test_the_program_leaves_the_room_that_the_tracking_error_takes():
    """As the planner: limits are narrower, and distances less."""
    problem = op.load_problem("12_planar")
    plain, wide = (op.casadi_problem(problem.with_parts(tracking_error=error)) for error in (0.0, 0.01))
    assert (wide._transcription.limits.upper <= plain._transcription.limits.upper - 0.01).all()
    assert wide._transcription.model.error == pytest.approx(problem.robot.n * [0.01])


def test_moving_ends_depend_on_the_duration():
    problem = op.load_problem("37_on_the_move")
    nlp = op.casadi_problem(problem)
    for share in (1.0, 1.5):
        x = nlp.arguments()["x0"]
        x[nlp.control.numel()] *= share
        start = nlp.trajectory(x).state(0.0)
        np.testing.assert_allclose(start.v, problem.start_state.v, atol=1e-9)
        np.testing.assert_allclose(start.a, problem.start_state.a, atol=1e-6)


def test_a_solver_of_its_own_process_finds_the_same(run, tmp_path):
    """With CasADi alone, from the file."""
    nlp = op.casadi_problem(run.problem, run)
    file = nlp.save(tmp_path / "motion.casadi.json")
    script = """
import json, sys
import casadi
file = json.load(open(sys.argv[1]))
nlp, start, motion = (casadi.Function.deserialize(file[name]) for name in ("nlp", "start", "motion"))
solver = casadi.nlpsol("solver", "ipopt", nlp, {"ipopt": file["ipopt"], "print_time": False})
answer = solver(**start())
assert solver.stats()["success"], solver.stats()["return_status"]
t, q, v, a = motion(answer["x"], start()["p"])
assert "optiplan" not in sys.modules
print(json.dumps([t.full().ravel().tolist(), q.full().T.tolist()]))
"""
    done = subprocess.run([sys.executable, "-c", script, str(file)], capture_output=True, text=True, check=True)
    t, q = map(np.array, json.loads(done.stdout))
    assert t[-1] == pytest.approx(run.duration, rel=5e-3)
    np.testing.assert_allclose(q, run.trajectory(t / t[-1] * run.duration), atol=0.05)


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
        (
            {"problem": op.Problem("planar2r", "ready", "out", scene=[BALL.moving([[0], [0.1], [0]])])},
            "a problem with obstacles that move; expected one move among obstacles that stand",
        ),
    ],
)
def test_errors_name_the_call(arguments, words):
    with pytest.raises(op.InputError, match=words):
        op.casadi_problem(**({"problem": op.load_problem("12_planar")} | arguments))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda nlp: nlp.solver("ipop"), r"TrajectoryNlp\.solver: name: found the str 'ipop'; expected one of .*ipopt"),
        (lambda nlp: nlp.solver(cost=nlp.q), r"TrajectoryNlp\.solver: cost: found .*; expected a CasADi expression"),
        (lambda nlp: nlp.trajectory([1.0]), r"TrajectoryNlp: x: found .*; expected \d+ finite numbers"),
        (lambda nlp: nlp.arguments("one"), r"TrajectoryNlp: x: found .*; expected \d+ finite numbers"),
    ],
)
def test_errors_of_the_program_name_the_call(shelf, call, words):
    with pytest.raises(op.InputError, match=words):
        call(shelf)


def test_a_problem_with_more_is_refused():
    task = op.load_problem("40_panda_sorts_cubes")
    with pytest.raises(
        op.InputError, match=r"^op\.casadi_problem: problem: found a problem with a task; expected one "
    ):
        op.casadi_problem(task)
