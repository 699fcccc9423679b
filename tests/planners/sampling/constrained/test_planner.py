"""Sampling planners under path constraints: projection, walks, motions that are proved to hold them."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.planners.sampling.constrained import planner as constrained_planner
from optiplan.planners.sampling.constrained.constrained_steps import ConstrainedSteps
from optiplan.planners.sampling.constrained.manifold import Manifold
from optiplan.planners.sampling.constrained.searches import Query, connect, roadmap, star
from optiplan.planners.sampling.constrained.smoothing import shortcut
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.robot.frames import frame_pose
from tests.planners.constraint_cases import CONSTRAINTS, assert_held_and_proved, key_of, stated

pytestmark = pytest.mark.usefixtures("processor_clock")

PLANNERS = {"rrtconnect": {}, "prm": {}, "rrtstar": {"iterations": 8}, "informed_rrtstar": {"iterations": 8}}
"""With options of little effort: that more of it makes paths shorter is looked at with `star` itself."""
HEIGHT = 0.486869558
PLANE = {"plane": {"normal": [0, 0, 1], "offset": HEIGHT, "within": 0.001}}
DOWN = {"orientation": {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.02}}


@pytest.fixture(scope="module")
def around():
    """On a plane, the tool pointing down, around a post."""
    post = op.Box("post", size=(0.06, 0.06, 0.9), position=(0.45, 0.15, 0.45))
    goal = op.Pose((0.5, 0.35, HEIGHT), rpy=(np.pi, 0.0, 0.0))
    return op.Problem("panda", start="ready", goal=goal, scene=[post], path_constraints=[PLANE, DOWN])


@pytest.fixture(scope="module")
def query(around):
    model = planning_model(around.robot, around.scene)
    goals = [q for q in op.plan(around, "trajopt", budget=3.0).trajectory(np.array([1e9]), clamp=True)]
    manifold = Manifold(around, np.vstack([around.start, *goals]))
    check = MotionCheck(model, around.limits, Gravity(around.robot, around.limits.torque))
    return Query(ConstrainedSteps(manifold, check, Budget(20.0)), around.start, np.array(goals), seed=1, iterations=60)


@pytest.mark.parametrize("name", [name for name in CONSTRAINTS if key_of(name) not in ("tool_speed", "wheel_speed")])
def test_projection_holds_the_constraint(name):
    problem = stated(name)
    constraints, rng = PathConstraints(problem), np.random.default_rng(0)
    manifold = Manifold(problem, problem.start[None])
    still = np.zeros((1, problem.robot.n))
    drawn = problem.start + rng.uniform(-0.5, 0.5, (20, problem.robot.n))
    found = [q for q in (manifold.project(q) for q in drawn) if q is not None]
    assert len(found) >= (1 if key_of(name) == "clearance" else 8)
    for q in found:
        assert manifold.holds(q)
        violation = max(kept.worst([q[None], still, still])[0] for kept in constraints.all)
        assert violation <= 1e-9
        assert (problem.limits.lower <= q).all()
        assert (q <= problem.limits.upper).all()


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_rrtconnect_holds_it_and_the_verifier_proves_it(name, monkeypatch):
    """By its trees: nothing is in the way of these motions, so that a walk straight to the goal would get there."""
    monkeypatch.setattr(constrained_planner, "_straight", lambda query: None)
    assert assert_held_and_proved(name, "rrtconnect").info["states"] > 1


@pytest.mark.parametrize("planner", PLANNERS)
def test_each_goes_around_an_obstacle_on_a_plane(around, planner):
    run = op.plan(around, planner, options=PLANNERS[planner], budget=20.0)
    assert run.verified, run.failure
    assert run.info["states"] > 1
    assert sum(check.name.endswith("constraint") for check in run.report.checks) == 2


def test_a_walk_stays_on_the_constraints_and_ends_where_it_is_sent(query):
    steps, start = query.steps, query.start
    assert steps.joined(start, query.goals[0]) is None, "the post is in the way"
    rng, reached = np.random.default_rng(0), 0
    for _ in range(20):
        target = steps.manifold.project(start + rng.uniform(-0.3, 0.3, 7))
        points = [] if target is None else steps.towards(start, target)
        reached += bool(points) and points[-1] is target
        for a, b in zip([start, *points], points, strict=False):
            assert steps.manifold.holds(b)
            assert steps.manifold.holds(0.5 * (a + b))
            assert steps.check.free(a, b)
    assert reached >= 5


@pytest.mark.parametrize("search", [connect, roadmap])
def test_searches_return_paths_on_the_constraints_from_the_start_to_a_goal(query, search):
    path = search(query)
    np.testing.assert_array_equal(path[0], query.start)
    np.testing.assert_array_equal(path[-1], query.goals[0])
    assert all(query.steps.manifold.holds(q) for q in path)
    draws = np.random.default_rng(0).uniform(size=(60, 2))
    shorter = shortcut(query.steps, path, draws)
    assert query.steps.cost(shorter) <= query.steps.cost(path)
    best = star(query, shorter)
    assert query.steps.cost(best) <= query.steps.cost(shorter)
    assert all(query.steps.manifold.holds(q) for q in best)
    np.testing.assert_array_equal(best[[0, -1]], path[[0, -1]])


def test_the_same_seed_gives_the_same_motion(around):
    one, other = (op.plan(around, "rrtconnect", seed=3, budget=20.0) for _ in range(2))
    np.testing.assert_array_equal(one.trajectory.coefficients, other.trajectory.coefficients)


def test_constraints_of_a_part_of_the_motion_are_refused_in_words(around):
    part = around.with_constraints({"plane": {**PLANE["plane"], "during": [0.2, 0.8]}})
    run = op.plan(part, "rrtconnect", budget=2.0)
    assert run.failure.kind == "unsupported"
    assert "plane" in run.failure.detail


def test_goals_that_cannot_hold_the_constraint_are_a_reason(around):
    off = around.with_goal(op.Pose((0.5, 0.35, 0.4), rpy=(np.pi, 0.0, 0.0)))
    run = op.plan(off, "rrtconnect", budget=4.0)
    assert run.failure.kind == "constraint"
    assert "off the plane" in run.failure.detail


@pytest.mark.parametrize("planner", ["kpiece", "bitstar"])
def test_others_say_what_they_do_not_hold(around, planner):
    run = op.plan(around, planner, budget=2.0)
    assert run.failure.kind == "unsupported"
    assert "plane" in run.failure.detail


def test_a_search_without_success_names_the_constraints_and_how_near_it_came(around):
    """A plane through both ends, which walls before and behind the arm cut in two."""
    walls = [op.Box(name, size=(1.0, 0.04, 0.3), position=(x, 0.2, HEIGHT)) for name, x in (("a", 0.6), ("b", -0.6))]
    run = op.plan(around.with_scene(walls), "rrtconnect", budget=1.0)
    assert run.failure.kind == "no-path"
    assert run.failure.witness["constraint"] == "plane, orientation"
    assert "(plane, orientation)" in run.failure.detail
    assert "none nearer to a goal than" in run.failure.detail
    q = np.array(run.failure.witness["q"])
    assert np.abs(q - around.start).max() > 0.05
    assert Manifold(around, around.start[None]).holds(q)


@pytest.mark.parametrize("planner", ["trajopt", "rrtconnect"])
def test_a_goal_of_one_hand_takes_the_other_with_it(planner):
    """Inverse kinematics leaves the second arm where it was: the goals that it finds are moved onto the constraint."""
    robot = op.load_robot("baxter")
    poses = [frame_pose(robot, robot.configurations["ready"], hand) for hand in ("left_gripper", "right_gripper")]
    X = poses[1].actInv(poses[0])
    held = {"position": X.translation.tolist(), "rpy": pin.rpy.matrixToRpy(X.rotation).tolist()}
    held |= {"frame": "left_gripper", "to": "right_gripper", "tolerance": {"position": 1e-3, "orientation": 5e-3}}
    there = poses[0].translation + np.array([0.0, 0.04, 0.05])
    goal = op.Pose(tuple(there), rpy=tuple(pin.rpy.matrixToRpy(poses[0].rotation)))
    problem = op.Problem("baxter", "ready", goal, path_constraints=[{"relative_pose": held}])
    run = op.plan(problem, planner, budget=8.0)
    assert run.verified, run.failure
    assert np.abs(run.trajectory.end - problem.start)[7:].max() > 0.01
