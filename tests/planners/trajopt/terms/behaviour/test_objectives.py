"""Parts of the objective: exact gradients, motions that cost less by them, and their values in the record of a run."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.terms.integrals import JerkCost, integral_costs
from optiplan.planners.trajopt.terms.term import Curve, Instants
from optiplan.problem.objectives.objective import UNITS
from optiplan.problem.problem import derived
from optiplan.trajectory.trajectory import Trajectory
from tests.planned import planned_until

WEIGHTS = {
    "jerk": 1e-6,
    "energy": 1e-3,
    "joint_path": 0.5,
    "tool_path": 1.0,
    "tool_smoothness": 1e-2,
    "clearance": 20.0,
    "manipulability": 0.05,
    "centring": 0.2,
}
BASIS = SplineBasis(bunched_breakpoints(10, 0.6))
GOAL = np.array([1.2, -0.3, 0.2, -2.0, 0.1, 1.8, 0.9])


@pytest.fixture(scope="module")
def problem():
    wall = op.Box("wall", size=(0.05, 0.3, 0.42), position=(0.4, 0.25, 0.21))
    return op.Problem("panda", start="ready", goal=op.Pose((0.3, 0.5, 0.5), rpy=(np.pi, 0.0, 0.0)), scene=[wall])


@pytest.fixture(scope="module")
def fastest(problem):
    return op.plan(problem, budget=3.0)


def test_every_part_is_here():
    assert {"time", *WEIGHTS} == set(UNITS)


@pytest.mark.parametrize("name", WEIGHTS)
def test_derivatives_equal_differences(problem, name):
    weighted = problem.with_objective({"time": 1.0, name: WEIGHTS[name]})
    if name == "jerk":
        cost = JerkCost(WEIGHTS[name], BASIS)
    else:
        (cost,) = integral_costs(weighted, planning_model(problem.robot, problem.scene))
    rng = np.random.default_rng(0)
    control = along_path(BASIS, np.array([problem.start, GOAL]), problem.limits.velocity)
    instants, T, h = Instants.of(BASIS, np.linspace(0.02, 0.98, 40)), 1.3, 1e-5
    here = cost.model(Curve(control, T, instants))
    change = rng.normal(size=BASIS.moving(control).shape)
    after, before = (cost.value(Curve(BASIS.moved(control, s * h * change), T, instants)) for s in (1, -1))
    tolerance = 1e-2 if name == "clearance" else 1e-5  # the nearest pair may change
    assert here.gradient @ change.ravel() == pytest.approx((after - before) / (2 * h), rel=tolerance, abs=1e-8)
    later, earlier = (cost.value(Curve(control, T + s * h, instants)) for s in (1, -1))
    assert here.by_duration == pytest.approx((later - earlier) / (2 * h), rel=1e-5, abs=1e-8)
    assert here.value == pytest.approx(cost.value(Curve(control, T, instants)))


@pytest.mark.parametrize("name", [name for name in WEIGHTS if name != "jerk"])
def test_the_sum_over_samples_is_nearly_the_integral(problem, name):
    weighted = problem.with_objective({name: WEIGHTS[name], "time": 0.0})
    (cost,) = integral_costs(weighted, planning_model(problem.robot, problem.scene))
    control = along_path(BASIS, np.array([problem.start, GOAL]), problem.limits.velocity)
    motion = Trajectory.from_bspline(problem.robot.joint_names, BASIS.knots * 1.3, control, DEGREE)
    instants = Instants.of(BASIS, np.linspace(0.0, 1.0, 202)[1:-1])
    assert cost.value(Curve(control, 1.3, instants)) == pytest.approx(weighted.cost(motion), rel=0.02)


@pytest.mark.parametrize("name", WEIGHTS)
def test_a_weight_makes_motions_that_cost_less_by_it(problem, fastest, name):
    weighted = problem.with_objective({"time": 1.0, name: WEIGHTS[name]})
    parts, cost = weighted.objective_parts(), weighted.cost(fastest.trajectory)
    less = parts.values(fastest.trajectory)[name] * (1.0 - 1e-3)
    run = planned_until(
        weighted, seconds=4.0, wanted=lambda motion: parts.values(motion)[name] < less and weighted.cost(motion) < cost
    )
    assert run.verified
    part = run.metrics.objective[name]
    assert part["value"] < less
    assert weighted.cost(run.trajectory) < cost
    assert part["cost"] == pytest.approx(WEIGHTS[name] * part["value"])
    assert part["unit"] == UNITS[name]


def test_a_heavy_weight_is_worth_time(problem, fastest):
    heavy = problem.with_objective({"time": 1.0, "tool_smoothness": 0.3})
    cost, long = heavy.cost(fastest.trajectory), 1.1 * fastest.duration
    run = planned_until(heavy, seconds=4.0, wanted=lambda motion: motion.duration > long and heavy.cost(motion) < cost)
    assert run.verified
    assert run.duration > long
    assert heavy.cost(run.trajectory) < cost


def test_weights_that_are_not_given_leave_the_hash(problem):
    assert problem.with_objective(op.Objective(1.0)).hash == problem.hash
    assert problem.with_objective(op.Objective(energy=0.1)).hash != problem.hash
    with pytest.raises(op.InputError, match="beauty"):
        problem.with_objective({"beauty": 1.0})


def test_a_joint_that_its_limits_hold_has_no_middle_to_be_off(problem):
    robot, held = problem.robot, np.arange(7) == 2
    lower, upper = (np.where(held, 0.0, limit) for limit in (robot.limits.lower, robot.limits.upper))
    fixed = replace(robot.limits, lower=lower, upper=upper)
    free = op.Problem("panda", start="ready", goal=np.where(held, 0.0, GOAL)).with_objective({"time": 1, "centring": 1})
    stated = derived(free, robot=replace(robot, limits=fixed), limits=fixed)
    motion = op.plan(free, "quintic").trajectory
    assert stated.cost(motion) == pytest.approx(free.cost(motion))
    (cost,) = integral_costs(stated, planning_model(stated.robot, stated.scene))
    control = along_path(BASIS, motion(np.array([0.0, motion.duration])), stated.limits.velocity)
    here = cost.model(Curve(control, 1.0, Instants.of(BASIS, np.linspace(0.02, 0.98, 40))))
    assert np.isfinite(here.gradient).all()
