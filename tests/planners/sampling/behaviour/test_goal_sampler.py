"""Goal configurations while searching: more of them, nearer ones, and when there are no others."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.goal_ranking import GoalSampler, goal_sampler, ranked_goals
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.sample_path import SamplingOptions, path_check, sample_path
from optiplan.problem.goals import GoalOptions
from optiplan.problem.problem import JointGoal, PoseGoal, derived
from optiplan.robot.robot import load_robot
from optiplan.runs.pipeline import run
from optiplan.trajectory.timing.lower_bound import lower_bounds
from tests.planners import cases
from tests.problem.goal_errors import goal_residual
from tests.robot.robots import BARE, LINK, joint, write_robot
from tests.unchecked_problem import unchecked_problem


def sampler(problem, seed=0, **options):
    model = CollisionModel(problem.robot, problem.scene)
    return GoalSampler(problem, model, seed, GoalOptions(**options))


def bounds(problem, goals):
    return lower_bounds(problem.start, np.array(goals), problem.limits)


def loose(position, orientation=1e-3):
    problem = cases.pose()
    goal = problem.goal[0]
    return derived(problem, goal=(PoseGoal(goal.frame, goal.X_WG, position, orientation),))


def test_more_are_new_free_in_the_goal_and_ranked():
    problem = cases.pose()
    first, again = sampler(problem), sampler(problem)
    before = list(first.configurations)
    new = first.more(5)
    assert len(new) >= 5
    assert np.array_equal(new, again.more(5))
    assert all(np.abs(q - other).max() > 0.01 for q in new for other in before)
    assert all(goal_residual(problem, q)[0].reached for q in first.configurations)
    assert len(first.configurations) == len(before) + len(new)
    assert (np.diff(bounds(problem, first.configurations)) >= 0.0).all()
    assert not np.array_equal(new, sampler(problem, seed=1).more(5))


def test_ends_moved_later_are_those_moved_at_once():
    problem = loose(0.03)
    model = CollisionModel(problem.robot, problem.scene)
    at_once = GoalSampler(problem, model, 0, GoalOptions())
    later = GoalSampler(problem, model, 0, GoalOptions(), moved=1)
    assert len(later.configurations) < len(at_once.configurations)
    later.move(lambda: True, count=0)
    later.move()
    assert np.array_equal(later.configurations, at_once.configurations)
    assert np.array_equal(GoalSampler(problem, model, 0, GoalOptions(), moved=1).more(2), at_once.more(2))


def test_lists_of_joint_goals_and_of_closed_forms_are_complete():
    assert sampler(cases.any_of()).complete
    assert sampler(cases.any_of()).more(3) == []
    pose = PoseGoal("tool0", cases.tool_pose("ur5", np.array([0.3, -1.2, 1.4, -0.5, 1.1, 0.2])))
    problem = cases.problem("ur5", [0.0, -1.0, 1.0, 0.0, 1.0, 0.0], [pose])
    assert sampler(problem).complete
    wide = derived(problem, goal=(replace(pose, position=0.05),))
    assert not sampler(wide).complete
    assert sampler(wide).more(3)
    assert not sampler(cases.pose()).complete


def test_redundancy_brings_the_end_nearer_and_exact_goals_stay():
    problem = cases.small_reach()
    model = CollisionModel(problem.robot, problem.scene)
    exact, nearer = (ranked_goals(problem, model, Budget(20.0), nearer=nearer) for nearer in (False, True))
    assert bounds(problem, nearer)[0] < 0.98 * bounds(problem, exact)[0]
    for q in exact:
        assert goal_residual(problem, q)[0].position <= 0.5e-4


@pytest.mark.parametrize(("position", "orientation", "share"), [(0.2, 1e-3, 0.8), (1e-4, 0.5, 0.95), (0.1, np.pi, 0.7)])
def test_tolerances_are_used(position, orientation, share):
    problem = loose(position, orientation)
    tight = ranked_goals(cases.pose(), CollisionModel(problem.robot, problem.scene), Budget(20.0))
    goals = sampler(problem).configurations
    assert bounds(problem, goals)[0] < share * bounds(problem, tight)[0]
    for q in goals:
        error = goal_residual(problem, q)[0]
        assert error.position <= 0.95 * position
        assert orientation >= np.pi or error.orientation <= 0.95 * orientation


def test_a_motion_ends_within_the_tolerance_and_is_shorter():
    tight, wide = (
        run(problem, "rrtconnect", {}, Budget(20.0), lambda *a: None) for problem in (cases.pose(), loose(0.2))
    )
    assert tight.verified
    assert wide.verified
    assert wide.duration < 0.85 * tight.duration


def test_goals_that_all_collide_are_final_only_after_looking_for_others():
    """Of 24 configurations of the first draw none is free; later ones are, or the failure comes when time is up."""
    problem = cases.goal_in_wall()
    model = CollisionModel(problem.robot, problem.scene)
    assert isinstance(ranked_goals(problem, model, Budget(20.0)), Failure)  # a joint goal: at once
    at = PoseGoal(problem.robot.tool_frame, cases.tool_pose("panda", cases.LEFT))
    blocked = derived(problem, goal=(at,))
    asked = []
    collides = model.collides
    model.collides = lambda q: asked.append(q) or collides(q)
    found = ranked_goals(blocked, model, Budget(1.0))
    assert found.kind == "goal-in-collision"
    assert len(asked) > 40  # more than the first draw


def test_more_finds_what_the_first_draw_missed():
    problem = cases.pose()
    model = CollisionModel(problem.robot, problem.scene)
    first = sampler(problem)
    missed = {tuple(q) for q in (*first.configurations, *first._drawn)}
    model.collides = lambda q: tuple(q) in missed  # pockets: all that the first draw has found
    found = goal_sampler(problem, model, Budget(20.0))
    assert found.configurations
    assert all(tuple(q) not in missed for q in found.configurations)


@pytest.fixture(scope="module")
def two_arms(tmp_path_factory):
    """Two arms of twenty joints each on one base; bodies at the tips alone, so that pairs are few."""
    names = [f"{arm}{k}" for arm in "ab" for k in range(20)]
    parents = ["base" if name[1:] == "0" else f"l{name[0]}{int(name[1:]) - 1}" for name in names]
    links = [LINK.format("base"), *((LINK if name[1:] == "19" else BARE).format(f"l{name}") for name in names)]
    joints = [joint(name, parent, f"l{name}", x=0.1) for name, parent in zip(names, parents, strict=True)]
    extra = f"group: [{', '.join(names)}]\ntool_frame: la19\nallowed_collisions: [[la19, lb19]]\n"
    return load_robot(str(write_robot(tmp_path_factory.mktemp("arms"), [*links, *joints], extra)))


def many_joints(robot, q, *obstacles):
    """From zero to where the first arm's tip is at q."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    goal = PoseGoal("la19", data.oMf[robot.model.getFrameId("la19")].copy())
    return unchecked_problem(
        name="many", robot=robot, scene=Scene(obstacles), start=np.zeros(robot.n), goal=(goal,), limits=robot.limits
    )


def test_joints_that_do_not_move_the_frame_stay(two_arms):
    assert joints_that_move(two_arms, "la19").tolist() == [name.startswith("a") for name in two_arms.joint_names]
    problem = many_joints(two_arms, np.where(np.arange(40) < 20, 0.05, 0.0))
    found = sampler(problem, count=4)
    assert found.configurations
    assert all(not q[20:].any() for q in (*found.configurations, *found.more(2)))


def test_many_joints_of_which_few_need_move(two_arms):
    """A free straight line is the answer; round a post the second arm stands still."""
    free = many_joints(two_arms, np.where(np.arange(40) < 20, 0.05, 0.0))
    straight = run(free, "rrtconnect", {}, Budget(20.0), lambda *a: None)
    assert straight.verified, straight.failure
    assert straight.info["waypoints"] == 2
    bent = np.where(np.arange(40) < 20, 0.06, 0.0)
    data = two_arms.model.createData()
    pin.framesForwardKinematics(two_arms.model, data, 0.5 * bent)
    tip = data.oMf[two_arms.model.getFrameId("la19")].translation
    post = cases.box("post", (0.05, 0.05, 0.3), tip)
    around = derived(free, scene=Scene((post,)), goal=(JointGoal(bent),))
    model = CollisionModel(two_arms, around.scene)
    assert not MotionCheck(model, around.limits).free(around.start, bent)
    path = sample_path(path_check(model, around.limits), around.start, [bent], SamplingOptions(Budget(20.0)))
    assert not path.waypoints[:, 20:].any()


def test_what_is_added_takes_the_place_of_those_near_it():
    """One projected by millimetres is added, since that which it comes from does not hold the constraint."""
    found = sampler(cases.pose())
    before, q = list(found.configurations), found.configurations[0] + 0.005
    found.add(q)
    assert any(one is q for one in found.configurations)
    assert all(one is q or np.abs(one - q).max() > 0.02 for one in found.configurations)
    assert len(found.configurations) <= len(before)
