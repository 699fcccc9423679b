"""Planners from and to states of motion: what they find is verified, or they say what they cannot hold."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget
from optiplan.planners.registry import PLANNERS, make_planner, planner_entry
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.nonzero_end_optimiser import EndStates, NonzeroEndOptimiser
from optiplan.planners.trajopt.nonzero_ends import _NonzeroEndRun, plan_nonzero_ends
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.problem.goals_and_vias import ExactGoal, JointGoal
from optiplan.problem.problem import derived
from optiplan.runs.pipeline import run
from optiplan.trajectory.paths.hermite import hermite
from optiplan.trajectory.profiles.state_to_state import BetweenStates
from tests.planners import cases
from tests.planners.test_point_to_point import one_joint


def plan(problem, name, budget=3.0):
    return run(problem, name, cases.OPTIONS.get(name, {}), Budget(budget), lambda stage, fraction: None)


def moving(problem, share=0.3, seed=0, acceleration=True):
    """The problem with a motion at both ends that is a share of the limits at most."""
    rng, limits = np.random.default_rng(seed), problem.limits
    v, a, w, b = (share * rng.uniform(-1.0, 1.0, problem.robot.n) for _ in range(4))
    a, b = (a, b) if acceleration else (0.0 * a, 0.0 * b)
    goal = replace(problem.goal[0], velocity=w * limits.velocity, acceleration=b * limits.acceleration)
    start = {"start_velocity": v * limits.velocity, "start_acceleration": a * limits.acceleration}
    return derived(problem, goal=(goal,), **start)


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_verified_or_unsupported(name):
    order = planner_entry(name).load().end_derivatives
    for accelerated in (True, False):
        problem = moving(cases.free(), acceleration=accelerated)
        problem = derived(problem, limits=replace(problem.limits, jerk=np.full(7, np.inf))) if order == 1 else problem
        found = plan(problem, name)
        if order == 0 or (order == 1 and accelerated):
            assert found.failure.kind == "unsupported"
            assert ("acceleration" if order else "velocity") in found.failure.detail
            assert found.failure.witness["end"] == "start"
        else:
            assert found.verified, (found.failure, found.report and found.report.failures)
            assert found.ratio > 1.0 - 1e-6


@pytest.mark.parametrize("case", ["free", "wall", "duct", "planar"])
@pytest.mark.parametrize("at", [0.05, 0.35, 0.8])
def test_on_from_a_running_motion(case, at):
    """Continuous to the acceleration, and in hardly more than the time that was left."""
    problem = getattr(cases, case)()
    first = plan(problem, "trajopt")
    t = at * first.duration
    state = first.trajectory.state(t)
    again = plan(problem.with_start(state), "trajopt")
    assert again.verified, again.failure
    for order, value in enumerate((state.q, state.v, state.a)):
        assert again.trajectory(0.0, order) == pytest.approx(value, abs=1e-6)
    assert again.duration <= 1.05 * (first.duration - t) + 0.01


def test_a_stop_a_way_and_a_run_up():
    """Straight on, the arm runs into the plate: the curve goes round, or it stops first."""
    wall = cases.wall()
    over = plan(wall, "trajopt").trajectory
    back = derived(wall, start_velocity=-0.5 * over(0.3 * over.duration, 1))
    found = plan(back, "trajopt", 4.0)
    assert found.verified, found.failure


def test_it_fails_with_the_reason_where_it_can_only_crash():
    plate = cases.box("plate", (0.5, 0.02, 1.2), (0.5, 0.25, 0.6))
    wall = cases.problem("panda", cases.READY, [op.JointGoal(cases.READY)], plate)
    model = planning_model(wall.robot, wall.scene)
    way = np.linspace(wall.start, wall.start + np.eye(7)[0] * 1.2, 400)
    touching = int(np.argmax([model.collides(q) for q in way]))
    near, speed = way[touching - 4], 2.1 * np.eye(7)[0]  # a centimetre before the plate
    found = plan(derived(wall, start=near, start_velocity=speed), "trajopt", 2.0)
    assert found.trajectory is None
    assert found.failure.kind in ("collision", "start-in-collision")
    assert "plate" in found.failure.detail


@pytest.mark.parametrize("share", [0.3, 0.9])
@pytest.mark.parametrize("guess", [1.0, 1.5])
def test_the_curve_is_near_the_fastest_whatever_the_guess(share, guess):
    problem = moving(cases.free(), share, acceleration=False)
    start, end = problem.start_state, problem.goal[0].state
    least = BetweenStates(start, end, problem.limits, problem.robot.joint_names).trajectory()
    optimiser = Optimiser(problem, planning_model(problem.robot, problem.scene), TrajOptOptions())
    curves = NonzeroEndOptimiser(problem, optimiser, EndStates(start, end))
    found = curves.run(curves.along(least), guess * least.duration, Budget(10.0)).trajectory
    assert 1.0 - 1e-6 <= found.duration / least.duration < 1.015
    for order, rate in enumerate((start.q, start.v, start.a)):
        assert found(0.0, order) == pytest.approx(rate, abs=1e-8)
    for order, rate in enumerate((end.q, end.v, end.a)):
        assert found(found.duration, order) == pytest.approx(rate, abs=1e-8)


def test_curves_are_bent_smoothly_to_new_ends():
    basis = SplineBasis(bunched_breakpoints(22, 0.6))
    rng = np.random.default_rng(0)
    control = rng.normal(size=(basis.size, 2))
    now = [basis.at(np.array([0.0, 1.0]), order) @ control for order in range(3)]
    by = rng.normal(size=(2, 3, 2))
    start, end = (np.array([value[side] for value in now]) + by[side] for side in (0, 1))
    moved = basis.moved_ends(control, start, end)
    for order in range(3):
        at_ends = basis.at(np.array([0.0, 1.0]), order) @ moved
        assert at_ends == pytest.approx(np.array([start[order], end[order]]), abs=1e-9 * 400**order)
    u = np.linspace(0.0, 1.0, 200)
    quintic = hermite(by[0], by[1], np.ones(1))[0]
    assert basis.at(u) @ (moved - control) == pytest.approx(u[:, None] ** np.arange(6) @ quintic, abs=2e-3)
    same = basis.moved_ends(moved, start, end)
    assert same == pytest.approx(moved, abs=1e-9)


def test_vias_with_nonzero_ends():
    problem = moving(cases.free(), acceleration=False)
    middle = 0.5 * (problem.start + problem.goal[0].q)
    through = derived(problem, vias=(cases.Via(op.JointGoal(middle, 1e-3)),))
    found = plan(through, "trajopt", 4.0)
    assert found.verified, found.failure


def test_objects_that_stand_for_planners_say_what_they_hold():
    class Own:
        end_derivatives = 2

        def plan(self, problem, budget, progress):
            return make_planner("quintic").plan(problem, budget, progress)

    assert op.plan(moving(cases.free()), Own()).verified


@pytest.mark.parametrize(("speed", "blocked"), [(1e-25, True), (1e-25, False), (1e-12, False)])
def test_a_goal_that_moves_by_a_rounding_needs_no_run_up(speed, blocked):
    """A wall in the way: curves lead to nothing, and the way by rest is tried; with a gap that leads there."""
    length, x = (1.6, 1.1) if blocked else (0.4, 0.9)
    scene = op.Scene([op.Box("wall", size=(length, 0.4, 0.1), position=(x, 0.0, 0.0))])
    problem = op.Problem("planar2r", [1.2, 0.3], goal=op.State([-1.2, -0.3], [speed, 0.0]), scene=scene)
    run = op.plan(problem, budget=2.0)
    assert run.failure is None or run.failure.kind in ("no-path", "timeout", "collision")
    assert run.verified == (not blocked)


@pytest.mark.parametrize(("kind", "end"), [(JointGoal, 2.0 * np.pi - 3.0), (ExactGoal, -3.0)])
def test_a_run_up_begins_where_an_endless_joint_arrives(tmp_path, kind, end):
    """The goal is at -3 rad; from 3 rad the way there goes on to 3.28 rad, unless it is to be exactly that."""
    at_rest = one_joint(tmp_path, "{name: turn, joint: revolute, a: 0.3}", -3.0)
    goal = kind(at_rest.goal[0].q, velocity=np.array([0.5]))
    problem = derived(at_rest, start=np.array([3.0]), goal=(goal,))
    found = make_planner("trajopt", {"straight_goals": 0}).plan(problem, Budget(2.0), lambda stage, fraction: None)
    for one in (*found.earlier, found):
        last = one.trajectory.state(one.trajectory.duration)
        assert last.q == pytest.approx([end], abs=1e-6)
        assert last.v == pytest.approx([0.5], abs=1e-6)


def test_a_detour_that_breaks_a_constraint_is_a_failure_that_names_it(monkeypatch):
    monkeypatch.setattr(_NonzeroEndRun, "_optimised", lambda *given: None)

    class Careless(TrajOpt):
        def plan(self, problem, budget, progress):
            return super().plan(derived(problem, path_constraints=()), budget, progress)

    upright = {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.01}
    goal = op.Pose((0.4, 0.4, 0.5), rpy=(np.pi, 0.0, 0.0))
    problem = op.Problem("panda", start="ready", goal=goal).with_constraints({"orientation": upright})
    problem = derived(problem, start_velocity=0.1 * np.eye(7)[0])
    planner = Careless(TrajOptOptions(straight_goals=0))
    failure = plan_nonzero_ends(planner, problem, Budget(5.0), lambda stage, fraction: None).failure
    assert failure.kind == "constraint"
    assert failure.witness["constraint"] == "orientation"
    monkeypatch.setattr(_NonzeroEndRun, "_bumps", lambda run: setattr(run, "budget", Budget(0.0)))
    failure = plan_nonzero_ends(planner, problem, Budget(5.0), lambda stage, fraction: None).failure
    assert failure.kind == "budget"


def test_a_stop_that_leaves_a_path_constraint_is_named_with_its_own_time():
    """The robot cannot brake in time; the message said `at t = 0.000 s`, where the constraint still held."""
    start = op.State([0.3, 0.4], [0.8, 0.0])
    stated = op.Problem("planar2r", start, [-0.5, 0.4])
    below = op.JointCoupling({stated.robot.joint_names[0]: 1.0}, equals=-0.2, within=0.505)
    found = op.plan(stated.with_constraints(below), budget=3.0)
    assert found.failure.kind == "constraint"
    assert "stopping at once is no way out: at rest after" in found.failure.detail
    assert found.failure.witness["constraint"] == "coupling"
    assert found.failure.witness["q"][0] > 0.305 > start.q[0]
    assert found.failure.witness["t"] > 0.01
