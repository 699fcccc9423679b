"""Goal regions: coordinates and their rates, what files and Python say, configurations in them, the proof of ends."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.kinematics.ik.numeric import random_seeds
from optiplan.kinematics.symbolic.state import BatchedExpression
from optiplan.planners.base import Budget
from optiplan.planners.common.goal_ranking import goal_sampler
from optiplan.planners.path_constraints.goals import goal_inequalities
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.sampling import RegionSampler
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.limit_checks import goal as goal_check
from optiplan.viewer.scene import build_scene
from tests.problem.goal_errors import goal_residual

FREE = [(), (0,), (1,), (2,), (0, 1, 2)]


def region(free, seed=0, width=1.0):
    rng = np.random.default_rng(seed)
    low = -width * np.array([0.1, 0.2, 0.3, 0.5, 0.6, 0.7])
    high = -0.5 * low
    for axis in free:
        low[3 + axis], high[3 + axis] = -np.inf, np.inf
    X_WR, X_RF = (pin.SE3(pin.exp3(rng.uniform(-1, 1, 3)), rng.uniform(-0.3, 0.3, 3)) for _ in range(2))
    return RegionGoal("panda_hand_tcp", X_WR, X_RF, low, high)


@pytest.mark.parametrize("free", FREE)
def test_coordinates_are_those_of_the_pose_and_rates_are_differences(free):
    goal, rng, h = region(free), np.random.default_rng(1), 1e-6
    counted = [k for k in range(6) if k - 3 not in free]
    for c in [np.zeros(6), *rng.uniform(-1.0, 1.0, (10, 6))]:
        X = goal.pose(c)
        np.testing.assert_allclose(goal.coordinates(X), c, atol=1e-9)
        twist = rng.standard_normal(6)
        after, before = (
            goal.coordinates(pin.SE3(pin.exp3(s * twist[3:]) @ X.rotation, X.translation + s * twist[:3]))
            for s in (h, -h)
        )
        np.testing.assert_allclose(((after - before) / (2.0 * h))[counted], (goal.rates(X) @ twist)[counted], atol=1e-5)
        assert not goal.rates(X)[[3 + axis for axis in free]].any()


@pytest.mark.parametrize("free", FREE)
def test_nearest_and_drawn_poses_are_inside(free):
    goal, rng = region(free), np.random.default_rng(2)
    for _ in range(20):
        X = goal.pose(rng.uniform(-1.5, 1.5, 6))
        assert goal.inner(0.5).contains(goal.inner(0.5 - 1e-9).nearest(X))
        drawn = goal.inner(0.9).drawn(X, rng)
        assert goal.contains(drawn)
        assert goal.excess(X) == pytest.approx(goal.coordinates(X) - np.clip(goal.coordinates(X), goal.low, goal.high))


@pytest.mark.parametrize("free", [(), (1,), (0, 1, 2)])
def test_terms_of_the_free_end_are_its_coordinates(free):
    """The rows of the optimiser are coordinate minus bound, of the region with a tenth less, with exact slopes."""
    robot, goal = op.load_robot("panda"), region(free, width=0.8)
    for q in (robot.configurations["ready"], 0.7 * robot.configurations["ready"]):
        goal = dataclasses.replace(goal, X_WR=frame_pose(robot, q, goal.frame) * goal.X_RF.inverse())
        q = q + 0.1 * np.sin(np.arange(robot.n))
        c, inner = goal.coordinates(frame_pose(robot, q, goal.frame)), goal.inner(0.9)
        found = []
        for one in goal_inequalities(goal):
            rows = BatchedExpression(robot, "inequality", one.build)
            still, h = np.zeros((1, robot.n)), 1e-6
            value, slopes = rows([q[None], still, still])
            for j, step in enumerate(h * np.eye(robot.n)):
                after, before = (rows([(q + s * step)[None], still, still])[0][0] for s in (1.0, -1.0))
                np.testing.assert_allclose(slopes[0][0][:, j], (after - before) / (2.0 * h), atol=1e-6)
            found += value[0].tolist()
        expected = [
            value
            for part in (range(3), range(3, 6))
            for value in (
                *(c[k] - inner.low[k] for k in part if np.isfinite(inner.low[k])),
                *(inner.high[k] - c[k] for k in part if np.isfinite(inner.high[k])),
            )
        ]
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_files_and_python_state_the_same():
    given = op.Region(
        (0.5, 0.1, 0.3),
        rpy=(np.pi, 0.0, 0.0),
        along={"x": 0.1, "y": (-0.2, 0.3), "z": (0.0, "free")},
        about={"z": "free", "x": 0.2},
        offset=op.Pose((0.0, 0.0, 0.1)),
    )
    said = {
        "position": [0.5, 0.1, 0.3],
        "rpy": [np.pi, 0, 0],
        "along": {"x": 0.1, "y": [-0.2, 0.3], "z": [0.0, "free"]},
        "about": {"z": "free", "x": 0.2},
        "offset": {"position": [0, 0, 0.1]},
    }
    problems = [op.Problem("panda", start="ready", goal=goal) for goal in (given, {"region": said})]
    assert problems[0].hash == problems[1].hash
    goal = problems[0].goal[0]
    np.testing.assert_array_equal(goal.low, [-0.1, -0.2, 0.0, -0.2, -1e-3, -np.inf])
    np.testing.assert_array_equal(goal.high, [0.1, 0.3, np.inf, 0.2, 1e-3, np.inf])
    again = problems[0].with_goal(goal).goal[0]
    np.testing.assert_array_equal([again.low, again.high], [goal.low, goal.high])
    assert again.X_WR.isApprox(goal.X_WR)
    assert again.X_RF.isApprox(goal.X_RF)
    assert "region of panda_hand_tcp" in repr(problems[0])


@pytest.mark.parametrize(
    ("said", "place", "expected"),
    [
        ("{along: {x: [0.2, 0.1]}}", "goal.region.along.x", "from < to"),
        ("{along: {x: anything}}", "goal.region.along.x", "`free`"),
        ("{along: {x: [free, free]}}", "goal.region.along.x", "`free`"),
        ("{along: {x: 0}}", "goal.region.along.x", "> 0"),
        ("{along: {x: [1, 2, 3]}}", "goal.region.along.x", "3 values"),
        ("{along: {w: 1}}", "goal.region.along.w", "x, y, z"),
        ("{about: {x: free, y: free}}", "goal.region", "free about two axes"),
        ("{about: {x: 3.2}}", "goal.region", "at most 3 rad"),
        ("{about: {z: [0, free]}}", "goal.region", "at most 3 rad"),
        ("{along: free, about: free}", "goal.region", "a bound"),
        ("{along: {z: free}, frame: nowhere}", "goal.region.frame", "nowhere"),
        ("{position: [0, 0]}", "goal.region.position", "3 values"),
    ],
)
def test_bad_regions_are_refused_with_their_place(write, said, place, expected):
    with pytest.raises(InputError) as refused:
        op.load_problem(write("goal: {joints: [1, 0.5]}", f"goal: {{region: {said}}}"))
    told = str(refused.value)
    assert f"{place}:" in told, told
    assert expected in told, told


def test_python_names_the_argument():
    with pytest.raises(InputError, match=r"op\.Region: along\.x: .*from < to"):
        op.Region((0, 0, 0), along={"x": (1.0, 0.0)})


@pytest.mark.parametrize("free", FREE)
def test_configurations_are_projected_into_the_region_and_drawn_from_it(free):
    robot, rng = op.load_robot("panda"), np.random.default_rng(0)
    ready = robot.configurations["ready"]
    goal = region(free, width=0.3)
    goal = dataclasses.replace(goal, X_WR=frame_pose(robot, ready, goal.frame) * goal.X_RF.inverse())
    sampler = RegionSampler(robot, goal)
    found = [sampler.drawn(seed, rng) for seed in random_seeds(robot, ready, rng, 20)]
    inside = [q for q, there in found if there]
    assert len(inside) >= 5
    for q in inside:
        assert goal.contains(frame_pose(robot, q, goal.frame))
        assert (robot.limits.lower <= q).all()
        assert (q <= robot.limits.upper).all()
    assert np.ptp(inside, axis=0).max() > 0.5
    q, there = sampler.onto(ready + 0.4)
    assert there
    assert goal.contains(frame_pose(robot, q, goal.frame))


def test_the_proof_holds_the_end_against_the_region():
    goal = op.Region((0.5, 0.0, 0.3), rpy=(np.pi, 0, 0), along={"x": 0.1, "y": 0.1, "z": ("free", 0.0)}, about="free")
    problem = op.Problem("panda", start="ready", goal=goal)
    robot = problem.robot
    for z, x, good in ((0.35, 0.05, True), (0.35, 0.11, False), (0.29, 0.0, False), (0.3001, 0.0999, True)):
        target = pin.SE3(problem.goal[0].X_WR.rotation, np.array([0.5 + x, 0.0, z]))
        q = goal_sampler(
            op.Problem(robot, start="ready", goal=op.Pose.from_matrix(target)), model_of(problem), Budget(5.0)
        ).configurations[0]
        still = Trajectory(robot.joint_names, np.array([0.0, 1.0]), q[None, None])
        check = goal_check(problem, still)
        assert check.passed is good, check
        assert goal_residual(problem, q)[0].reached is good
        if not good:
            assert check.place == f"panda_hand_tcp along {'x' if z > 0.3 else 'z'} position"


def test_an_unreachable_region_says_by_how_much():
    problem = op.Problem("panda", start="ready", goal=op.Region((2.0, 0.0, 0.3), along={"y": "free"}, about="free"))
    found = goal_sampler(problem, model_of(problem), Budget(20.0))
    assert found.kind == "goal-unreachable"
    assert "in the goal region" in found.detail
    assert 1.0 < found.witness["position_error"] < 1.4


def model_of(problem):
    return CollisionModel(problem.robot, problem.scene)


def test_a_region_of_an_arm_of_two_joints(write):
    """Two joints cannot hold all coordinates: the region is what remains."""
    text = "goal: {region: {position: [0.6, 0.6, 0], along: {x: 0.05, y: 0.05, z: 0.2}, about: free}}"
    problem = op.load_problem(write("goal: {joints: [1, 0.5]}", text))
    run = op.plan(problem, planner="quintic", budget=5)
    assert run.verified, run.failure


REGION = {"position": [0.5, 0.2, 0.4], "rpy": [np.pi, 0.0, 0.0], "along": {"x": 0.1, "y": 0.1}, "about": {"z": "free"}}


def test_a_move_of_a_task_ends_in_a_region():
    problem = op.Problem(
        "panda", start="ready", task=[{"move": {"region": REGION}}, {"move": {"configuration": "ready"}}]
    )
    run = op.plan(problem, budget=10.0)
    assert run.verified, run.failure


def test_a_moving_start_and_an_earlier_run_lead_to_a_region_too():
    problem = op.Problem("panda", start="ready", goal={"region": REGION})
    run = op.plan(problem, budget=3.0)
    assert run.verified
    assert run.duration < 1.05 * min(problem.lower_bounds([run.trajectory.end]))
    start = problem.start + 0.05
    again = op.plan(problem.with_start(start), budget=3.0, warm_start=run)
    assert again.verified
    moving = op.plan(problem.with_start(op.State(start, v=np.full(7, 0.1))), budget=5.0)
    assert moving.verified, moving.failure


def test_the_page_draws_the_extent_of_a_region_and_a_ring_about_its_free_axis():
    problem = op.load_problem("44_can_from_any_side")
    (drawn,) = build_scene(problem, []).regions
    np.testing.assert_allclose(drawn["size"], [0.004, 0.004, 0.06])
    np.testing.assert_allclose(drawn["pose"][:3], [0.5, 0.2, 0.28])
    assert drawn["ring"]["radius"] == pytest.approx(0.12)
    np.testing.assert_allclose(drawn["ring"]["pose"], [0.5, 0.2, 0.28, 0.0, 0.0, 0.0, 1.0], atol=1e-9)
    plane = problem.with_goal(
        op.Region((0.0, 0.0, 0.4), along={"x": "free", "y": "free", "z": (0.0, "free")}, about="free")
    )
    (drawn,) = build_scene(plane, []).regions
    np.testing.assert_allclose(drawn["size"], [1.0, 1.0, 0.5])
    assert drawn["ring"] is None
    (target,) = build_scene(plane, []).targets
    np.testing.assert_allclose(target[:3], [0.0, 0.0, 0.4])
