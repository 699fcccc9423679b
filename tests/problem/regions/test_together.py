"""Several frames in their places at once."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.problem import derived
from optiplan.problem.regions.together import TogetherSampler, joints_of
from optiplan.robot.frames import frame_pose
from tests.checks import named

HANDS = ("left_gripper", "right_gripper")


@pytest.fixture(scope="module")
def problem():
    left = op.Pose((0.65, 0.14, 0.2), rpy_deg=(90, 0, 0), frame=HANDS[0])
    right = op.Region((0.65, -0.14, 0.2), rpy_deg=(-90, 0, 0), about={"z": "free"}, frame=HANDS[1])
    return op.Problem("baxter", "ready", op.AllOf([left, right]))


def test_samples_put_both_hands_in_their_places(problem):
    (goal,) = problem.goal
    sampler, rng = TogetherSampler(problem.robot, goal), np.random.default_rng(1)
    assert joints_of(problem.robot, goal).all()
    found = []
    for _ in range(40):
        q, inside = sampler.drawn(rng.uniform(problem.robot.limits.lower, problem.robot.limits.upper), rng)
        if inside:
            found.append(q)
            left, right = (problem.robot.fk(q, frame) for frame in HANDS)
            assert np.allclose(left.position, [0.65, 0.14, 0.2], atol=1e-4)
            assert np.allclose(right.position, [0.65, -0.14, 0.2], atol=1e-4)
            assert np.allclose(right.matrix[:3, 2], [0, 1, 0], atol=2e-3)
            assert goal.parts[1].contains(right_pose(problem, q))
    assert len(found) >= 5
    assert np.ptp([q[-1] for q in found]) > 0.1  # the right hand turns as it likes


def right_pose(problem, q):
    return frame_pose(problem.robot, q, HANDS[1])


def test_both_hands_arrive_and_one_alone_is_not_enough(problem):
    run = op.plan(problem, planner="quintic", budget=20.0)
    assert run.verified
    check = named(op.verify(problem, run.trajectory), "goal")
    assert "goal" in check.covers
    moved = op.Pose((0.65, 0.14, 0.21), rpy_deg=(90, 0, 0), frame=HANDS[0])
    other = problem.with_goal(op.AllOf([moved, op.Pose(**right_alone())]))
    report = op.verify(derived(problem, goal=other.goal), run.trajectory)
    assert [check.name for check in report.failures] == ["goal"]
    assert report.failures[0].place == "left_gripper position"


def right_alone():
    return {"position": (0.65, -0.14, 0.2), "frame": HANDS[1], "orientation_tolerance": 3.2}


def test_a_file_says_the_same(problem, tmp_path):
    problem.save(tmp_path / "hands.yaml")
    assert op.load_problem(tmp_path / "hands.yaml").hash == problem.hash
    again = op.Problem("baxter", "ready", problem.goal[0])
    assert again.goal[0].parts[0].frame == HANDS[0]


def test_one_end_and_ends_of_no_frame_are_refused():
    with pytest.raises(InputError, match="at least 2"):
        op.AllOf([op.Pose((0.5, 0, 0.5))])
    with pytest.raises(InputError, match=r"with its frame"):
        op.AllOf([op.Pose((0.5, 0, 0.5)), "ready"])
    far = op.AllOf([op.Pose((3.0, 0.2, 0.2), frame=HANDS[0]), op.Pose((0.65, -0.2, 0.2), frame=HANDS[1])])
    failure = op.plan(op.Problem("baxter", "ready", far), budget=10.0).failure
    assert failure.kind == "goal-unreachable"
    assert "in their places at once" in failure.detail
