"""The main planner as a whole: near the bound in the open, around obstacles, back to the sampled path, reasons."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.native_model import planning_model
from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.planners.base import Budget, PlanResult, silent
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.trajopt import planner, warm
from optiplan.planners.trajopt.bspline_basis import SplineBasis
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.optimizer import Attempt, Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.robot.robot import Robot, load_robot
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.verify.verify import verify
from tests.checks import named
from tests.planners import cases
from tests.unchecked_problem import unchecked_problem

pytestmark = pytest.mark.usefixtures("processor_clock")

GOAL = np.array([1.2, 0.3, 0.4, -1.6, 0.3, 1.9, 0.4])


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("panda")


def box(name: str, size: tuple[float, float, float], *position: float) -> Obstacle:
    return Obstacle(name, Box(size), pin.SE3(np.eye(3), np.array(position)))


def make(robot: Robot, *obstacles: Obstacle, goal: np.ndarray = GOAL) -> Problem:
    start = robot.configurations["ready"]
    return unchecked_problem(
        name="t", robot=robot, scene=Scene(obstacles), start=start, goal=(JointGoal(goal),), limits=robot.limits
    )


def plan(problem: Problem, budget: float = 20.0, **options: float) -> PlanResult:
    planner = TrajOpt(TrajOptOptions(**options))  # type: ignore[arg-type]
    return planner.plan(problem, Budget(budget), lambda stage, fraction: None)


def test_free_space_is_within_two_percent_of_the_physical_limit(robot: Robot) -> None:
    problem = make(robot)
    problem = derived(problem, limits=replace(problem.limits, torque=np.full(7, np.inf)))
    result = plan(problem)
    assert result.trajectory is not None
    assert verify(problem, result.trajectory).verified
    assert 1.0 <= result.trajectory.duration / lower_bound(problem.start, GOAL, problem.limits) < 1.02


def test_torque_limits_bind_and_hold(robot: Robot) -> None:
    problem = make(robot)
    free = plan(problem).trajectory
    assert free is not None
    peak = named(verify(problem, free), "torque").worst
    assert peak is not None
    limits = replace(problem.limits, torque=np.where(problem.limits.torque > 20, 0.8 * peak, problem.limits.torque))
    weak = derived(problem, limits=limits)
    bound = plan(weak).trajectory
    assert bound is not None
    assert verify(weak, bound).verified
    assert not verify(weak, free).verified


def test_the_drives_can_hold_every_configuration_of_a_motion() -> None:
    """Baxter's shoulder is overloaded by a tenth on the straight line: curves learn of it, not only the search."""
    robot = load_robot("baxter")
    start, goal = robot.configurations["ready"].copy(), robot.configurations["ready"].copy()
    start[:7], goal[:7] = [-0.69, 0.49, 0.49, 0.83, 0.22, 0.12, 0.27], [1.06, -1.0, -0.26, 0.38, -0.62, 0.09, 0.63]
    load, limit = Gravity(robot, robot.limits.torque), robot.limits.torque
    assert max((load.torque(start + s * (goal - start)) / limit).max() for s in np.linspace(0.0, 1.0, 41)) > 1.1
    problem = unchecked_problem(
        name="t", robot=robot, scene=Scene(), start=start, goal=(JointGoal(goal),), limits=robot.limits
    )
    motion = plan(problem, 1.0).trajectory
    assert motion is not None
    assert motion.duration < 1.5, "24 s along the path of the search"
    assert max((load.torque(q) / limit).max() for q in motion(np.linspace(0.0, motion.duration, 500))) <= 1.0
    assert verify(problem, motion).verified


def test_goes_around_a_wall(robot: Robot) -> None:
    problem = make(
        robot, box("wall", (0.5, 0.04, 0.7), 0.55, 0.3, 0.35), goal=np.array([1.4, 0.3, 0, -1.9, 0, 2.1, 0.8])
    )
    result = plan(problem)
    assert result.trajectory is not None
    report = verify(problem, result.trajectory)
    assert report.verified
    assert set(result.timings) >= {"set-up", "goals", "optimisation"}


def test_jerk_weight_makes_the_motion_gentler(robot: Robot) -> None:
    problem = make(robot)
    gentle = derived(problem, objective=replace(problem.objective, jerk=1e-6))
    fast, smooth = plan(problem).trajectory, plan(gentle).trajectory
    assert fast is not None
    assert smooth is not None
    assert verify(gentle, smooth).verified
    t = np.linspace(0.0, 1.0, 2001)
    cost = [
        trajectory.duration * float(np.mean(trajectory(t * trajectory.duration, 3) ** 2))
        for trajectory in (fast, smooth)
    ]
    assert cost[1] < 0.5 * cost[0]
    assert smooth.duration > fast.duration


def test_the_sampled_path_is_the_answer_when_no_optimised_curve_is_free(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Optimiser, "run", lambda self, *arguments, **options: None)
    goal = np.array([1.4, 0.3, 0, -1.9, 0, 2.1, 0.8])
    problem = make(robot, box("wall", (0.5, 0.04, 0.7), 0.55, 0.3, 0.35), goal=goal)
    result = plan(problem, seeds=1)
    assert result.trajectory is not None
    assert "fallback" in result.info
    assert verify(problem, result.trajectory).verified


def test_start_equal_to_goal_rests(robot: Robot) -> None:
    problem = make(robot, goal=robot.configurations["ready"])
    result = plan(problem)
    assert result.trajectory is not None
    assert verify(problem, result.trajectory).verified


def test_no_way_through_fails_within_the_budget_and_says_where() -> None:
    planar = load_robot("planar2r")
    posts = (box("over", (0.05, 1.0, 0.05), 0.0, 0.0, 0.3), box("under", (0.05, 1.0, 0.05), 0.0, 0.0, -0.3))
    goal = JointGoal(np.array([2.9, 0.0]))  # the first link points the other way, and cannot pass either post
    allowed = frozenset(frozenset((post.name, "base")) for post in posts)  # they stand in the base
    problem = unchecked_problem(
        name="t",
        robot=planar,
        scene=Scene(posts, allowed=allowed),
        start=np.zeros(2),
        goal=(goal,),
        limits=planar.limits,
    )
    result = plan(problem, budget=1.5)
    assert result.trajectory is None
    assert result.failure is not None
    assert result.failure.kind == "no-path"
    assert {"over", "under"} & set(result.failure.witness["pair"])
    assert sum(result.timings.values()) < 2.5  # of this process, whatever others do


def test_the_best_curve_is_optimised_once_more_with_twice_the_spans(robot: Robot) -> None:
    result = plan(make(robot), good_enough=1.0)
    attempts = result.info["attempts"]
    assert [attempt["seed"] for attempt in attempts][-1] == "finer"
    assert result.trajectory is not None
    assert result.trajectory.duration == attempts[-1]["duration"]
    assert attempts[-1]["duration"] < 0.999 * min(attempt["duration"] for attempt in attempts[:-1] if attempt["free"])


def test_a_curve_fitted_along_a_position_limit_does_not_exceed_it(robot: Robot) -> None:
    """The path runs along a limit between two corners; least squares overshoot there."""
    problem = make(robot)
    optimiser = Optimiser(problem, planning_model(robot, problem.scene), TrajOptOptions())
    path = np.array([problem.start, problem.start, GOAL, GOAL])
    path[1:3, 6] = problem.limits.upper[6]
    control = along_path(optimiser.basis, path, problem.limits.velocity)
    assert (control.max(axis=0) > problem.limits.upper + 1e-3).any()
    attempt = optimiser.run(control, Budget(1e-9))  # over before the first step
    assert attempt is not None
    held = verify(problem, attempt.trajectory).checks
    assert next(check for check in held if check.name == "position").passed


def test_the_most_spans_are_doubled_too(monkeypatch: pytest.MonkeyPatch) -> None:
    options, problem, bases = TrajOptOptions(spans=501), cases.planar(), list[SplineBasis]()
    run = planner._Run(problem, Budget(1.0), silent, options)
    rest = run.optimiser.basis.trajectory(problem.robot.joint_names, np.zeros((run.optimiser.basis.size, 2)), 1.0)
    monkeypatch.setattr(run.attempts, "optimised", lambda *given, optimiser, margin: bases.append(optimiser.basis))
    run.attempts._refined("close", Attempt(np.zeros((2, 2)), rest, (), ()), 0.4)
    monkeypatch.setattr(warm, "WarmStart", lambda *given: SimpleNamespace(best=bases.append(given[-1])))
    TrajOpt(options).near(problem, rest, Budget(1.0))
    assert [len(basis.breakpoints) - 1 for basis in bases] == [1002, 1002]


@pytest.mark.parametrize("solver", ["auto", "piqp"])
def test_jerk_is_weighed_against_time(robot: Robot, solver: str) -> None:
    """No slower motion along the curve is cheaper, and it costs what the sum of both has to."""
    problem = derived(make(robot), objective=Objective(1.0, 1e-2))
    motion = plan(problem, seeds=1, solver=solver).trajectory
    assert motion is not None
    cost = problem.cost(motion)
    slower = [problem.cost(motion.scaled(factor * motion.duration)) for factor in (1.02, 1.1, 1.5, 2.0)]
    assert cost <= 1.001 * min(slower)
    assert cost == pytest.approx(1.2 * motion.duration, rel=1e-3)
