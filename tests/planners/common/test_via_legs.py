"""Vias with planners that know nothing of them: leg by leg."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import PlannerAnswerError
from optiplan.planners.base import Budget, Failure, Planner, PlanResult
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.registry import make_planner
from optiplan.planners.third_party import planner_object
from optiplan.problem.problem import JointGoal, PoseGoal, Via, derived
from optiplan.runs.pipeline import run
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.trajectory import Trajectory
from tests.checks import named
from tests.planners import cases

MIDDLE = 0.5 * (cases.READY + cases.LEFT) + 0.2
POSE = PoseGoal("panda_hand_tcp", cases.tool_pose("panda", cases.READY + 0.15), 1e-6, 1e-6)
FALLS = op.Sphere("ball", 0.05, position=(3.0, 0.0, 1.0)).moving([[0], [0], [0, -0.1]], until=1.0)


def quiet(stage, fraction):
    assert 0.0 <= fraction <= 1.0


def through(*ends):
    return derived(cases.free(), vias=tuple(Via(end) for end in ends))


@pytest.mark.parametrize("name", ["quintic", "rrtconnect"])
def test_every_planner_passes_vias_at_rest_and_is_verified(name):
    problem = through(POSE, JointGoal(MIDDLE))
    result = run(problem, name, {}, Budget(20.0), quiet)
    assert result.verified, result.failure or result.report.failures
    check = named(result.report, "via")
    times = np.array(check.witness["times"])
    assert result.trajectory(times)[1] == pytest.approx(MIDDLE, abs=1e-6)
    assert np.abs(result.trajectory(times, 1)).max() < 1e-3
    assert len(result.info["legs"]) == 3


def test_trajopt_passes_vias_no_slower_than_the_planner_of_rounded_corners():
    problem = through(POSE, JointGoal(MIDDLE))
    runs = {name: run(problem, name, {}, Budget(20.0), quiet) for name in ("trajopt", "rounded", "rrtconnect")}
    assert all(result.verified for result in runs.values())
    assert runs["trajopt"].duration <= 1.001 * min(result.duration for result in runs.values())
    assert runs["trajopt"].improvements[0][1] > runs["trajopt"].duration, "the motion with stops was there first"


def test_a_failure_names_its_leg():
    problem = through(JointGoal(MIDDLE), PoseGoal("panda_hand_tcp", cases.too_far().goal[0].X_WG))
    result = plan_through(make_planner("quintic"), problem, Budget(5.0), quiet)
    assert result.trajectory is None
    assert result.failure.kind == "goal-unreachable"
    assert result.failure.detail.startswith("leg 2 of 3, from via 1 to via 2: no configuration")
    assert result.failure.witness["leg"] == 2
    assert np.isfinite(result.failure.witness["q"]).all()


class Clock(Planner):
    """Notes what it was given and fails at leg `fails`."""

    def __init__(self, fails=None):
        self.asked, self.fails = [], fails

    def plan(self, problem, budget, progress):
        self.asked.append((problem, budget.seconds))
        progress("stage", 0.5)
        if len(self.asked) == self.fails:
            return PlanResult(None, Failure("budget", "out of time"), {"work": 1.0})
        c = np.stack([problem.start, problem.goal[0].q - problem.start])[None]
        return PlanResult(Trajectory(problem.robot.joint_names, np.array([0.0, 1.0]), c), None, {"work": 1.0})


def test_the_budget_is_shared_between_the_legs():
    planner = Clock()
    result = plan_through(planner, through(JointGoal(MIDDLE), JointGoal(cases.READY)), Budget(9.0), quiet)
    assert [seconds for _, seconds in planner.asked] == pytest.approx([3.0, 4.5, 9.0], rel=0.05)
    assert result.timings == {"work": 3.0}
    assert result.trajectory(np.arange(4.0)) == pytest.approx(np.array([cases.READY, MIDDLE, cases.READY, cases.LEFT]))
    assert all(not problem.vias for problem, _ in planner.asked)


def test_a_planner_that_passes_vias_by_itself_gets_the_whole_problem():
    planner = Clock()
    planner.passes_vias = True
    plan_through(planner, through(JointGoal(MIDDLE)), Budget(9.0), quiet)
    assert [len(problem.vias) for problem, _ in planner.asked] == [1]


def test_legs_of_a_planner_that_times_obstacles_are_planned_without_those():
    """It would plan each leg as if the obstacles were where they are at the start."""
    planner = Clock()
    planner.times_obstacles = True
    plan_through(planner, derived(through(JointGoal(MIDDLE)), scene=op.Scene([FALLS])), Budget(9.0), quiet)
    assert [len(problem.scene.dynamic_obstacles) for problem, _ in planner.asked] == [0, 0]


def test_an_object_that_only_has_plan_says_the_same_as_a_planner():
    class Straight:
        """Joins legs, holds constraints, and notes what else is asked of it."""

        joins_legs = holds_constraints = passes_vias = True
        end_derivatives, asked = "2", ()

        def plan(self, problem, budget, progress):
            return Clock().plan(problem, budget, progress)

        def check(self, problem, budget):
            self.asked += ("check",)

    given = Straight()
    planner = planner_object(given)
    stated = (planner.joins_legs, planner.holds_constraints, planner.passes_vias, planner.end_derivatives)
    assert (*stated, planner.times_obstacles) == (True, True, True, 2, False)
    planner.check(cases.free(), Budget(1.0))
    assert given.asked == ("check",)
    assert planner.replan(cases.free(), None, Budget(1.0), quiet).trajectory is not None
    given.end_derivatives = None
    with pytest.raises(op.InputError, match=r"planner 'Straight': end_derivatives: .*; expected a whole number"):
        planner_object(given)


def test_the_last_leg_ends_at_the_goal():
    failure = plan_through(Clock(fails=2), through(JointGoal(MIDDLE)), Budget(9.0), quiet).failure
    assert failure.detail == "leg 2 of 2, from via 1 to the goal: out of time"


def test_motions_of_different_degrees_are_joined_without_loss():
    a = Trajectory(("x",), np.array([0.0, 1.0]), np.array([[[0.0], [1.0]]]))
    b = Trajectory(("x",), np.array([0.0, 0.5, 2.0]), np.array([[[1.0], [0.0], [4.0], [0.0]], [[2.0], [1], [0], [0]]]))
    both = join_trajectories([a, b])
    assert both.breakpoints.tolist() == [0.0, 1.0, 1.5, 3.0]
    t = np.linspace(0.0, 2.0, 21)
    assert both(1.0 + t)[1:] == pytest.approx(b(t)[1:], abs=1e-14)
    assert np.array_equal(both(t[:10]), a(t[:10]))


def test_an_answer_among_moving_obstacles_is_checked_too():
    class Nothing(Planner):
        def plan(self, problem, budget, progress):
            return None

    with pytest.raises(PlannerAnswerError, match="returned None"):
        plan_through(Nothing(), derived(cases.free(), scene=op.Scene([FALLS])), Budget(1.0), quiet)
