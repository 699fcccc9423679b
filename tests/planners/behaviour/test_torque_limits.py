"""Torque limits as the simple planners meet them: slower motion, or a reason."""

import time
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.planners.base import Budget
from optiplan.planners.common.gravity import Gravity, greatest_gravity
from optiplan.planners.registry import make_planner
from optiplan.problem.problem import JointGoal, derived
from optiplan.robot.mounting import Mounting
from tests.planners import cases

SWING = np.linspace(-3.0, 3.0, 61)  # rad, of the shoulder


def plan(name, share):
    problem = cases.free()
    limits = replace(problem.limits, torque=problem.limits.torque * share)
    return make_planner(name).plan(derived(problem, limits=limits), Budget(20.0), lambda stage, fraction: None)


@pytest.mark.parametrize("name", ["quintic", "rrtconnect"])
def test_weaker_motors_are_slower(name):
    strong, weak = (plan(name, share).trajectory for share in (np.inf, 0.45))
    assert weak.duration > 1.03 * strong.duration


@pytest.mark.parametrize("name", ["quintic", "rrtconnect", "trajopt"])
def test_an_arm_too_heavy_for_its_motors_is_told(name):
    """At once, with the place and the joint: no search can help."""
    began = time.process_time()
    failure = plan(name, 0.1).failure
    assert time.process_time() - began < 5.0
    assert failure.kind == "infeasible"
    assert "gravity" in failure.detail
    limit = cases.free().limits.torque[cases.robot("panda").joint_names.index(failure.witness["joint"])]
    robot, q = cases.robot("panda"), np.array(failure.witness["q"])
    torque = np.abs(pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q))
    assert torque.max() == pytest.approx(failure.witness["torque"])
    assert failure.witness["torque"] > 0.1 * limit


TILTED = pin.SE3(pin.rpy.rpyToMatrix(0.6, 0.4, 0.0), np.array([0.0, 0.0, 1.0]))
LOADED = (("panda_hand", pin.Inertia(2.0, np.array([0.1, 0.0, 0.2]), np.zeros((3, 3)))),)


@pytest.mark.parametrize(
    ("name", "mounting"),
    [
        ("panda", Mounting()),
        ("panda", Mounting(TILTED, payload=LOADED)),
        ("delbot", Mounting()),
        ("delbot", Mounting(TILTED)),
        ("baxter", Mounting()),
        ("planar2r", Mounting(TILTED)),
    ],
)
def test_gravity_is_nowhere_more_than_its_bound(name, mounting):
    robot = cases.robot(name).mounted(mounting)
    most = greatest_gravity(robot)
    low, high = (
        np.where(np.isfinite(end), end, side) for end, side in ((robot.limits.lower, -3.2), (robot.limits.upper, 3.2))
    )
    heavy = Gravity(robot, 0.5 * robot.limits.torque)
    found = np.max([heavy.torque(q) for q in np.random.default_rng(0).uniform(low, high, (3000, len(low)))], axis=0)
    assert (found <= most).all()
    assert most.max() < 1.5 * found.max()
    assert Gravity(robot, 1.01 * most / (1.0 - 1e-3) + 1e-3).allowed is None
    assert Gravity(robot, 0.9 * found).allowed is not None


@pytest.mark.parametrize("name", ["rrtconnect", "trajopt"])
def test_a_way_is_found_around_what_is_too_heavy(name):
    """An arm in a vertical plane that can hang and stand, but not be stretched to the side: it must fold first."""
    arm = cases.robot("planar2r")
    data = arm.model.createData()
    weight = lambda q: np.abs(pin.computeGeneralizedGravity(arm.model, data, np.array(q)))  # noqa: E731
    limits = replace(arm.limits, torque=np.array([0.8, 1.1]) * np.max([weight([x, 0.0]) for x in SWING], axis=0))
    problem = derived(cases.problem("planar2r", [-1.55, 0.1], [JointGoal(np.array([1.55, 0.1]))]), limits=limits)
    assert Gravity(arm, limits.torque).too_much(np.array([0.0, 0.1]))
    result = make_planner(name).plan(problem, Budget(10.0), lambda stage, fraction: None)
    assert result.failure is None
    t = np.linspace(0.0, result.trajectory.duration, 2000)
    assert all((weight(q) <= limits.torque).all() for q in result.trajectory(t))
