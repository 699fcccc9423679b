"""Vias through the machinery of tasks: as quick as the same points as moves, and nothing of the task is left to see."""

import numpy as np
import pytest

import optiplan as op
from optiplan.libraries import clock
from optiplan.planners.base import Budget, Failure, Planner, PlanResult
from optiplan.planners.task.planner import plan_task
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.problem import JointGoal, Via, derived
from optiplan.runs.pipeline import run
from optiplan.trajectory.trajectory import Trajectory
from tests.checks import named
from tests.planners import cases

BUDGET = 60.0
"""s, more than ten times what is needed: the search ends by itself."""

MIDDLE = 0.5 * (cases.READY + cases.LEFT) + 0.2


def quiet(stage, fraction):
    pass


def poses(count):
    """Poses around a table, the hand down."""
    angles, radii, heights = np.linspace(-1.0, 1.0, count), (0.5, 0.62, 0.45), (0.2, 0.45, 0.3, 0.5)
    return [
        op.Pose(
            position=(radii[k % 3] * np.cos(angle), radii[k % 3] * np.sin(angle), heights[k % 4]),
            rpy=(np.pi, 0.0, 0.4 * (-1) ** k),
        )
        for k, angle in enumerate(angles)
    ]


SCENE = op.Scene([op.Box("table", size=(0.6, 1.2, 0.04), position=(0.55, 0.0, -0.02))])


@pytest.fixture(scope="module")
def tour():
    problem = op.Problem("panda", "ready", "ready", scene=SCENE, vias=poses(3))
    return problem, run(problem, "trajopt", {}, Budget(BUDGET), quiet)


def test_vias_are_as_quick_as_the_same_points_as_moves(tour):
    _, past = tour
    task = op.Task()
    for pose in poses(3):
        task = task.move(pose)
    steps = run(
        op.Problem("panda", "ready", scene=SCENE, task=task.move("ready")), "trajopt", {}, Budget(BUDGET), quiet
    )
    assert past.verified
    assert steps.verified
    assert past.duration <= 1.02 * steps.duration
    assert past.trajectory.segments == ()
    assert not past.info["stops"]


def test_better_motions_follow_the_first(tour):
    _, past = tour
    durations = [duration for _, duration in past.improvements]
    assert len(durations) > 1
    assert durations == sorted(durations, reverse=True)


def test_a_leg_that_needs_more_than_its_part_of_the_time_gets_it(by_hand):
    """Of ten seconds, each of five legs would have less than two; one needs 1.65 s."""

    class Slow(Planner):
        joins_legs = True
        asked: tuple = ()

        def plan(self, problem, budget, progress):
            self.asked = (*self.asked, budget.seconds)
            hard = np.abs(problem.goal[0].q - MIDDLE).max() < 1e-9
            began = clock()
            while hard and clock() - began < 1.65 and not budget.over:
                by_hand[0] += 0.01
            if hard and budget.over:
                return PlanResult(None, Failure("budget", "out of time"))
            c = np.zeros((1, 6, problem.robot.n))
            c[0, 0], c[0, 3] = problem.start, 10.0 * (problem.goal[0].q - problem.start)
            c[0, 4], c[0, 5] = -15.0 * c[0, 3] / 10.0, 6.0 * c[0, 3] / 10.0
            return PlanResult(Trajectory(problem.robot.joint_names, np.array([0.0, 1.0]), c))

    ends = [cases.READY + 0.1, MIDDLE, cases.READY + 0.05, cases.READY - 0.1]
    problem = derived(cases.free(), vias=tuple(Via(JointGoal(q)) for q in ends))
    planner = Slow()
    found = plan_task(planner, problem, Budget(10.0), quiet)
    assert found.trajectory is not None, found.failure
    assert planner.asked[1] < 1.65 < planner.asked[2], planner.asked


def test_motion_at_the_ends_is_kept():
    v = np.array([0.3, 0.1, 0.0, 0.0, 0.2, 0.0, 0.0])
    problem = derived(cases.free(), goal=(JointGoal(cases.LEFT, velocity=v),), start_velocity=0.5 * v)
    found = run(derived(problem, vias=(Via(JointGoal(MIDDLE)),)), "trajopt", {}, Budget(BUDGET), quiet)
    assert found.verified, found.failure or found.report.failures
    assert found.trajectory(0.0, 1) == pytest.approx(0.5 * v, abs=1e-6)
    assert found.trajectory(found.duration, 1) == pytest.approx(v, abs=1e-6)


def test_a_failure_names_its_leg_and_no_step():
    vias = Via(JointGoal(MIDDLE)), Via(cases.too_far().goal[0])
    failure = run(derived(cases.free(), vias=vias), "trajopt", {}, Budget(BUDGET), quiet).failure
    assert failure.kind == "goal-unreachable"
    assert failure.detail.startswith("leg 2 of 3, from via 1 to via 2: no configuration")
    assert failure.witness["leg"] == 2
    assert "step" not in failure.witness


def test_a_move_of_a_task_does_not_stop_at_its_vias():
    task = op.Task().move(cases.LEFT, vias=[op.ViaPoint(MIDDLE)]).dwell(0.1).move("ready")
    found = run(op.Problem("panda", "ready", task=task), "trajopt", {}, Budget(BUDGET), quiet)
    assert found.verified, found.failure or found.report.failures
    segments = [(one.step, one.kind) for one in found.trajectory.segments]
    assert segments == [(1, "move"), (2, "dwell"), (3, "move")]
    passage = named(found.report, "via")
    (at,) = passage.witness["times"]
    assert np.abs(found.trajectory(at, 1)).max() > 0.1


def test_constraints_on_a_part_of_a_task_of_several_steps_are_unsupported():
    """They are about a part of the whole, which no step knows while it is planned."""
    slow = ToolSpeed("panda_hand_tcp", linear=0.5, during=(0.4, 0.6))
    task = derived(
        op.Problem("panda", "ready", task=op.Task().move(cases.LEFT).move("ready")), path_constraints=(slow,)
    )
    failure = run(task, "trajopt", {}, Budget(BUDGET), quiet).failure
    assert failure.kind == "unsupported"
    assert "part of a task" in failure.detail


@pytest.mark.parametrize("as_task", [False, True])
def test_constraints_on_a_part_of_the_motion_need_another_planner(as_task):
    slow = ToolSpeed("panda_hand_tcp", linear=0.5, during=(0.2, 0.4))
    problem = derived(cases.free(), path_constraints=(slow,))
    if as_task:
        move = op.Task().move(cases.LEFT, vias=[op.ViaPoint(MIDDLE)])
        problem = derived(op.Problem("panda", "ready", task=move), path_constraints=(slow,))
    else:
        problem = derived(problem, vias=(Via(JointGoal(MIDDLE)),))
    failure = run(problem, "trajopt", {}, Budget(BUDGET), quiet).failure
    assert failure.kind == "unsupported"
    assert "where there are no vias" in failure.detail
