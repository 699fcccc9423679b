"""Goal configurations: free, distinct, ranked; reasons where there are none."""

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.problem.goals import GoalOptions, goal_configurations, listed_ends
from optiplan.problem.problem import JointGoal, PoseGoal, derived
from optiplan.trajectory.timing.lower_bound import lower_bounds
from tests.planners import cases
from tests.problem.goal_errors import goal_residual


def find(problem, **options):
    model = CollisionModel(problem.robot, problem.scene)
    return goal_configurations(problem, model, np.random.default_rng(0), GoalOptions(**options))


def test_pose_gives_distinct_free_configurations_that_reach_it():
    problem = cases.pose()
    found = find(problem).configurations
    assert len(found) == 8
    model = CollisionModel(problem.robot, problem.scene)
    for q in found:
        assert not model.collides(q)
        assert goal_residual(problem, q)[0].reached


def test_ranked_by_lower_bound_and_repeatable():
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    goals, again = (np.array(ranked_goals(problem, model, Budget(20.0))) for _ in range(2))
    assert np.array_equal(goals, again)
    assert (np.diff(lower_bounds(problem.start, goals, problem.limits)) >= 0.0).all()


def test_any_of_collects_all_alternatives():
    problem = cases.any_of()
    assert [tuple(q) for q in find(problem).configurations] == [tuple(problem.goal[1].q), tuple(problem.goal[0].q)]


def test_joint_goals_are_met_at_any_turn_of_an_endless_joint():
    problem = cases.endless()
    q = problem.goal[0].q
    turned = [tuple(q + np.array([2.0 * np.pi, 0.0])), tuple(q)]
    assert [tuple(found) for found in find(problem).configurations] == turned
    assert [tuple(end) for end in listed_ends(problem)] == turned
    assert goal_residual(problem, np.array(turned[0]))[0].reached


def test_images_of_one_configuration_by_whole_turns_are_listed_once():
    """Whichever image a goal names, the free configurations are the same, and no two of them are."""
    problem = cases.endless()
    q = problem.goal[0].q
    turns = [np.array([2.0 * np.pi * k, 0.0]) for k in (0, 1, -1)]
    several = derived(problem, goal=tuple(JointGoal(q + turn) for turn in (*turns, 1e-7 + turns[0])))
    found = np.array(find(several).configurations)
    apart = np.abs(found[:, None] - found).max(axis=2) + np.eye(len(found))
    assert len(found) >= 2
    assert (apart >= 1e-6).all()
    both = derived(problem, goal=(JointGoal(q), JointGoal(q + 1e-5)))  # 1e-6 apart in any joint is another one
    assert len(find(both).configurations) == 2 * len(find(problem).configurations)


def test_a_blocked_alternative_does_not_hide_a_free_one():
    problem = cases.goal_in_wall()
    both = derived(problem, goal=(*problem.goal, JointGoal(cases.READY + 0.1)))
    assert [tuple(q) for q in find(both).configurations] == [tuple(cases.READY + 0.1)]


def test_all_alternatives_refused_are_all_named():
    problem = cases.goal_in_wall()
    far = cases.too_far().goal[0]
    found = find(derived(problem, goal=(*problem.goal, far)))
    assert found.kind == "goal-in-collision"
    assert "alternative 0: " in found.reason
    assert "alternative 1: no configuration" in found.reason
    assert len(found.witness["alternatives"]) == 2


def test_residuals_measure_what_their_goals_ask():
    problem = cases.pose()
    goal = problem.goal[0]
    both = derived(problem, goal=(JointGoal(cases.LEFT, tolerance=0.01), PoseGoal(goal.frame, goal.X_WG, 1e-4, 1e-3)))
    near = cases.LEFT + np.array([0, 0, 0, 0, 0, 0, 0.005])
    joint, pose = goal_residual(both, near)
    assert joint.joint == pytest.approx(0.005)
    assert joint.reached
    assert pose.orientation == pytest.approx(0.005, rel=1e-6)
    assert pose.position < 1e-9
    assert not pose.reached


def test_stop_is_obeyed():
    assert find(cases.too_far(), stop=lambda: True).kind == "goal-unreachable"
