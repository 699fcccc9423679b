"""A failure holds the motion that was refused, of every planner that has one, so that it can be looked at."""

from itertools import pairwise

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.refused_path import refused_path
from optiplan.planners.registry import make_planner
from optiplan.problem.problem import PoseGoal, derived
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from tests.planners import cases


def failure_of(name, problem, **options):
    return make_planner(name, options).plan(problem, Budget(20.0), lambda stage, fraction: None).failure


def posed():
    """The wall, with the goal as a pose."""
    tool = cases.tool_pose("panda", cases.LEFT)
    return derived(cases.wall(), goal=(PoseGoal(cases.robot("panda").tool_frame, tool, 1e-4, 1e-3),))


@pytest.mark.parametrize("name", ["quintic", "scurve", "spline", "rounded", "line", "screw", "sclerp"])
def test_a_collision_comes_with_the_motion_up_to_it_and_on(name):
    problem = posed() if name in ("line", "screw", "sclerp") else cases.wall()
    failure = failure_of(name, problem, **({"change_branch": False} if name in ("line", "screw") else {}))
    assert failure.kind == "collision"
    motion, t = Trajectory.from_dict(failure.witness["motion"]), failure.witness["t"]
    assert motion.joint_names == problem.robot.joint_names
    assert motion.start == pytest.approx(problem.start, abs=1e-9)
    assert 0.0 < t < motion.duration
    q = motion(np.array([t]))[0]
    assert q == pytest.approx(failure.witness["q"], abs=1e-6)
    model = CollisionModel(problem.robot, problem.scene)
    assert model.collides(q)
    assert not model.collides(motion.start)
    speeds = np.abs(motion.extrema(1)).max(axis=0) / problem.limits.velocity
    assert speeds.max() < 1.0 + 1e-6


@pytest.mark.parametrize("name", ["line", "rounded", "sclerp"])
def test_the_page_plays_it_through_the_contact(name):
    problem = posed() if name in ("line", "sclerp") else cases.wall()
    failure = failure_of(name, problem)
    shown = {"kind": failure.kind, "detail": failure.detail, "witness": failure.witness}
    (run,) = build_scene(problem, [ViewedRun(name, None, None, shown)]).runs
    assert run["offending"]
    assert run["untimed"]
    (begin, end), *_ = run["clearance"]["contacts"]
    assert begin - 1e-3 <= failure.witness["t"] <= end
    assert run["witnesses"][0]["distance"] < 0.0


def test_a_motion_too_fast_for_its_limits_is_shown():
    failure = failure_of("quintic", cases.free(), duration=0.2)
    assert failure.kind == "limits"
    motion = Trajectory.from_dict(failure.witness["motion"])
    assert motion.duration == pytest.approx(0.2)
    order = ("position", "velocity", "acceleration", "jerk").index(failure.witness["quantity"])
    at = motion(np.array([failure.witness["t"]]), order)[0]
    assert np.abs(at).max() >= abs(failure.witness["value"]) - 1e-9


def test_sections_run_at_the_rate_of_their_tightest_limit():
    limits, names = cases.robot("panda").limits, cases.robot("panda").joint_names
    ends = cases.READY, cases.LEFT, cases.READY
    sections = [Trajectory(names, np.array([0.0, 2.0]), np.array([[a, 0.5 * (b - a)]])) for a, b in pairwise(ends)]
    shown = refused_path(sections, 1, 0.5, limits)
    motion = Trajectory.from_dict(shown["motion"])
    slowest = (np.abs(cases.LEFT - cases.READY) / limits.velocity).max()
    assert motion.duration == pytest.approx(2.0 * slowest)
    assert shown["t"] == pytest.approx(1.25 * slowest)
    assert motion(np.array([shown["t"]]))[0] == pytest.approx(0.75 * cases.LEFT + 0.25 * cases.READY)


def test_a_path_whose_rates_grow_without_bound_is_not_shown():
    names, limits = cases.robot("panda").joint_names, cases.robot("panda").limits
    still = Trajectory(names, np.array([0.0, 1.0]), cases.READY[None, None])
    assert refused_path([still], 0, 0.5, limits) == {}
    steep = np.zeros((1, 2, 7))
    steep[0, 0], steep[0, 1] = cases.READY, 1e4
    assert refused_path([Trajectory(names, np.array([0.0, 1.0]), steep)], 0, 0.5, limits) == {}
