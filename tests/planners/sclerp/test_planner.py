"""`sclerp` as a planner: screws followed and verified, endings named, options. The report's runs: tests/reference."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion
from optiplan.planners.sclerp.schemes import iterate_scheme
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.problem import JointGoal, PoseGoal, derived
from optiplan.robot.robot import load_robot
from optiplan.runs.pipeline import run
from tests.planned import planned_until
from tests.planners import cases
from tests.reference.entries import entry
from tests.unchecked_problem import unchecked_problem


def silent(stage, fraction):
    assert 0.0 <= fraction <= 1.0


def plan(problem, seconds=30.0, **options):
    return make_planner("sclerp", options).plan(problem, Budget(seconds), silent)


@pytest.fixture(scope="module")
def stuck():
    """The report's run that ends at a joint limit: 45° about z, from the stretched arm to (0.5, 0.3, 0.5)."""
    arm = load_robot("baxter_report")
    X_WG = next(np.array(item["goal"]) for item in entry("sclerp.runs").value if item["id"] == "b_z+45_503050")
    goal = PoseGoal(arm.tool_frame, pin.SE3(X_WG), 1e-6, 1e-6)
    return unchecked_problem(
        name="b_z+45", robot=arm, scene=Scene(()), start=np.zeros(7), goal=(goal,), limits=arm.limits
    )


def test_the_screw_that_ends_at_a_limit_says_at_which_joint_where_and_how_far(stuck):
    failure = plan(stuck, redundancy="local").failure
    assert failure.kind == "limits"
    assert failure.witness["joint"] == "W1"
    assert failure.witness["fraction"] == pytest.approx(0.99, abs=0.01)
    assert failure.witness["q"][5] == pytest.approx(failure.witness["limit"], abs=2e-3)
    tool = ScrewTool(stuck.robot, stuck.robot.tool_frame)
    on_screw = ScrewMotion(tool.pose(stuck.start), stuck.goal[0].X_WG).pose(failure.witness["fraction"])
    assert np.allclose(failure.witness["pose"]["position"], on_screw.translation, atol=1e-9)
    for word in ("W1", "%", f"{on_screw.translation[0]:.4f}"):
        assert word in failure.detail


def test_limits_narrower_than_the_robots_end_the_screw_sooner(stuck):
    narrow = replace(stuck.limits, lower=np.where(np.arange(7) == 5, -1.2, stuck.limits.lower))
    failure = plan(derived(stuck, limits=narrow), redundancy="local").failure
    assert (failure.witness["joint"], failure.witness["limit"]) == ("W1", -1.2)


def test_trajopt_solves_it_and_so_does_sclerp_led_to_a_goal(stuck):
    assert planned_until(stuck, seconds=30.0).verified
    for options, tried in (({"redundancy": "goal"}, 1), ({"goals": 2}, 2)):
        led = run(stuck, "sclerp", options, Budget(30.0), silent)
        assert led.verified, options
        assert led.info["tried"] == tried


@pytest.mark.parametrize("make", [cases.pose, cases.free])
def test_the_tool_stays_on_its_screw(make):
    problem = make()
    result = run(problem, "sclerp", {}, Budget(30.0), silent)
    assert result.verified, result.failure
    tool = ScrewTool(problem.robot, problem.robot.tool_frame)
    goal = problem.goal[0]
    X_G = goal.X_WG if isinstance(goal, PoseGoal) else tool.pose(goal.q)
    screw = ScrewMotion(tool.pose(problem.start), X_G)
    if isinstance(goal, JointGoal):
        assert result.trajectory.end == pytest.approx(goal.q, abs=1e-9)
    whole = pin.log6(screw.pose(0.0).actInv(X_G)).vector
    for q in result.trajectory(np.linspace(0.0, result.trajectory.duration, 300)):
        X = tool.pose(q)
        left = pin.log6(screw.pose(0.0).actInv(X)).vector  # the share s of the whole twist, and nothing else
        s = left @ whole / (whole @ whole)
        assert np.abs(pin.log6(screw.pose(s).actInv(X)).vector).max() < 1e-6


def test_a_bound_on_the_speed_of_the_tool_slows_the_motion_only_where_it_binds():
    problem = cases.pose()
    slow = derived(problem, path_constraints=(ToolSpeed(problem.robot.tool_frame, linear=0.2),))
    free, result = (run(one, "sclerp", {"goals": 1}, Budget(30.0), silent) for one in (problem, slow))
    assert result.verified, result.failure
    assert "slowed" not in result.info
    tool = ScrewTool(problem.robot, problem.robot.tool_frame)

    def fastest(motion):
        t = np.linspace(0.0, motion.duration, 600)
        return np.linalg.norm(np.diff([tool.pose(q).translation for q in motion(t)], axis=0), axis=1).max() / t[1]

    assert 0.19 < fastest(result.trajectory) < 0.2 * (1.0 + 1e-6)
    slowed = free.duration * fastest(free.trajectory) / 0.2
    assert free.duration < result.duration < 0.95 * slowed, "where it does not bind, it is as fast as it was"


def test_an_obstacle_on_the_way_is_named_with_the_fraction():
    failure = plan(cases.wall()).failure
    assert failure.kind == "collision"
    assert "plate" in failure.witness["pair"]
    assert 0.0 < failure.witness["fraction"] < 1.0
    assert "%" in failure.detail


def test_goals_out_of_reach_are_followed_as_far_as_it_goes():
    failure = plan(cases.too_far()).failure
    assert failure.kind == "goal-unreachable"
    assert 0.0 < failure.witness["fraction"] < 1.0


def test_a_goal_without_orientation_is_reached_with_some():
    problem = cases.pose()
    goal = problem.goal[0]
    X_WG = pin.SE3(np.eye(3), goal.X_WG.translation)  # an orientation that the hand cannot have there
    free = derived(problem, goal=(PoseGoal(goal.frame, X_WG, 1e-4, 4.0),))
    assert run(free, "sclerp", {"goals": 1}, Budget(30.0), silent).verified


def test_too_few_joints_for_the_screw_is_told():
    assert plan(cases.planar()).failure.kind == "unsupported"


@pytest.mark.parametrize("scheme", ["corrected", "damped"])
def test_the_other_schemes_end_where_their_tolerance_says(scheme):
    problem = cases.pose()
    options = {"scheme": scheme, "limits": "qp", "beta": 1.0, "tolerance": 1e-5, "iterations": 300}
    result = run(problem, "sclerp", options, Budget(30.0), silent)
    assert result.verified, result.failure
    assert result.info["error"] <= 1e-5


@pytest.mark.parametrize("limits", ["reflect", "clip", "qp"])
def test_after_each_step_the_joints_are_within_limits(stuck, limits):
    tool = ScrewTool(stuck.robot, stuck.robot.tool_frame)
    options = SclerpOptions(scheme="damped", limits=limits, beta=0.5, iterations=150)
    found = iterate_scheme(tool, stuck.start, stuck.goal[0].X_WG, options)
    assert found.hits[:, 5].any()
    low, high = stuck.robot.limits.lower, stuck.robot.limits.upper
    assert (found.Q >= low - 1e-12).all()
    assert (found.Q <= high + 1e-12).all()
    if limits == "qp":
        assert np.abs(np.diff(found.Q, axis=0)).max() <= options.step + 1e-12


def test_damping_bounds_the_joint_rates_at_a_singularity():
    """|Jᵀ (J Jᵀ + λ² I)⁻¹ v| <= |v| / (2 λ); without it there is no bound."""
    robot = cases.robot("ur5")
    tool, q = ScrewTool(robot, robot.tool_frame), np.array([0.3, -1.2, 0.9, -0.4, 1e-7, 0.2])  # wrist in line
    X_WG = tool.pose(q)
    X_WG.translation += np.array([0.02, 0.03, -0.01])
    X_WG.rotation = pin.exp3(np.array([0.2, -0.1, 0.3])) @ X_WG.rotation
    longest = {}
    for scheme in ("corrected", "damped"):
        options = SclerpOptions(scheme=scheme, beta=1.0, iterations=1, limits="clip", damping=0.05)
        steps = np.diff(iterate_scheme(tool, q, X_WG, options).Q, axis=0)
        longest[scheme] = np.abs(steps).max()
    assert longest["damped"] < 0.1 * 0.5 / (2.0 * 0.05)
    assert longest["corrected"] > 3.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("tau", 0.0),
        ("beta", 1.5),
        ("step", -0.1),
        ("tolerance", 0.0),
        ("iterations", 0),
        ("scheme", "best"),
        ("damping", 0.0),
        ("goals", 0),
        ("limits", "clip"),
    ],
)
def test_options_out_of_range_are_input_errors(name, value):
    with pytest.raises(InputError, match=name):
        make_planner("sclerp", {name: value})


def test_a_scheme_that_is_gone_is_told_with_the_choices():
    with pytest.raises(InputError, match="scheme: 'literal'; expected one of: corrected, damped, qp"):
        make_planner("sclerp", {"scheme": "literal"})
