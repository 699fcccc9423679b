"""Whole turns of joints: every configuration within limits is an image of one between -pi and pi."""

from itertools import product
from time import perf_counter

import numpy as np
import pytest

import optiplan as op
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.kinematics.ik.joint_wraps import images, images_within, whole_turns
from optiplan.robot.frames import frame_poses


@pytest.mark.parametrize("name", ["puma560", "ur5"])
def test_an_arm_is_found_where_it_stands_whatever_the_ranges_of_its_joints(name):
    """The PUMA's elbow goes from -3.93 to 0.79 rad: its closed form, between -pi and pi, is a turn off."""
    robot, rng = op.load_robot(name), np.random.default_rng(0)
    Q = rng.uniform(robot.limits.lower, robot.limits.upper, (100, robot.n))
    solved = closed_form(robot, robot.tool_frame).solve(frame_poses(robot, Q, robot.tool_frame))
    for q, branches, valid in zip(Q, solved.q, solved.valid, strict=True):
        found = images_within(robot, robot.limits, branches[valid], q)
        assert (found >= robot.limits.lower).all()
        assert (found <= robot.limits.upper).all()
        assert np.abs(found - q).max(axis=1).min() < 1e-6


@pytest.mark.parametrize("name", ["puma560", "srra", "ur5"])
def test_an_arm_is_found_where_a_joint_stands_on_its_limit(name):
    robot, rng = op.load_robot(name), np.random.default_rng(0)
    low, high = robot.limits.lower, robot.limits.upper
    for j, end in [(j, end[j]) for j in range(robot.n) for end in (low, high)]:
        if j == 4 and abs(np.sin(end)) < 1e-6:
            continue  # there the wrist is singular
        q = rng.uniform(0.8 * low + 0.2 * high, 0.2 * low + 0.8 * high)
        q[j] = end
        found = op.ik(robot, robot.fk(q), all=True, near=q)
        assert np.abs(found - q).max(axis=1).min(initial=1.0) < 1e-6
        assert ((found >= low) & (found <= high)).all()
        beside = np.where(np.arange(robot.n) == j, q + 1e-12 * np.sign(end - 0.5 * (low[j] + high[j])), q)[None]
        assert len(images_within(robot, robot.limits, beside, q))


def test_joints_of_wide_ranges_have_images_a_turn_farther():
    robot = op.load_robot("ur5")
    q = np.full((1, 6), 0.5)
    found = images_within(robot, robot.limits, q, np.zeros(6))
    assert {tuple(np.round((one - 0.5) / np.pi).astype(int)) for one in found} == {
        (0,) * 6,
        *(tuple(-2 * (np.arange(6) == j).astype(int)) for j in (0, 1, 3, 4, 5)),  # the elbow has half the range
    }


@pytest.mark.parametrize("name", ["panda", "puma560", "ur5", "delbot", "baxter"])
def test_where_no_joint_has_a_choice_there_is_one_configuration(name):
    robot, rng = op.load_robot(name), np.random.default_rng(1)
    for q in rng.uniform(-4.0, 4.0, (40, robot.n)):
        each = images(robot, q, np.zeros(robot.n))
        count = np.prod([max(1, len(values[:2])) for values in each])
        found = whole_turns(robot, q, np.zeros(robot.n), 1000)
        assert len(found) == count
        assert np.array_equal(found[0], [values[0] if len(values) else q[j] for j, values in enumerate(each)])


def plain(robot, q):
    return {key: value for key, value in robot.fk(q).to_data().items() if key != "frame"}


@pytest.mark.parametrize("kind", ["tour", "path"])
def test_a_task_beyond_half_a_turn_is_done_without_another_posture(kind):
    """The PUMA begins with its elbow at -3 rad and goes on to -3.7, not round by the other side, 1.5 s longer."""
    robot, start = op.load_robot("puma560"), [0.0, 0.6, -3.0, 0.2, 0.6, 0.1]
    if kind == "tour":
        task = op.Task().tour(
            [{"name": f"t{k}", **plain(robot, [0.1 * k - 0.2, 0.5, -3.4 - 0.08 * k, 0.3, 0.5, 0.2])} for k in range(5)]
        )
    else:
        along = [plain(robot, [0.02 * k - 0.2, 0.5, -3.3 - 0.02 * k, 0.3, 0.5, 0.2]) for k in range(6)]
        task = op.Path(along, 0.05, curve="spline")
    run = op.plan(op.Problem(robot, start, task=task), budget=20.0)
    assert run.verified, run
    assert run.duration < 2.5
    assert run.trajectory.extrema(0)[0][2] < -3.35


@pytest.mark.parametrize("count", [1, 2, 3, 8, 40])
def test_the_soonest_images_are_those_of_all_combinations(count):
    robot, rng = op.load_robot("ur5"), np.random.default_rng(2)
    for _ in range(20):
        q, near = rng.uniform(-3.0, 3.0, (2, robot.n))
        every = np.array(list(product(*(values[:2] for values in images(robot, q, near)))))
        found = np.array(whole_turns(robot, q, near, count))
        expected, times = ((np.abs(Q - near) / robot.limits.velocity).max(axis=1) for Q in (every, found))
        assert np.array_equal(times, np.sort(expected)[:count])
        assert len({tuple(image) for image in found.tolist()} & {tuple(image) for image in every.tolist()}) == len(
            found
        )


def test_images_of_many_joints_are_found_without_all_combinations():
    robot = op.Robot.side_by_side({name: {"use": "ur5", "base": op.Pose((0, k, 0))} for k, name in enumerate("abcd")})
    q = np.tile([0.5, -1.0, 1.0, 0.2, 0.3, -2.0], 4)
    began = perf_counter()
    assert len(whole_turns(robot, q, np.zeros(24), 8)) == 8  # of 2^20
    assert perf_counter() - began < 0.1
    moving = np.arange(24) < 6
    assert all(np.array_equal(one[6:], q[6:]) for one in whole_turns(robot, q, np.zeros(24), 40, moving))
