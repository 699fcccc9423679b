"""Inverse kinematics against forward kinematics."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.numeric import IkOptions, random_seeds, solve_ik
from optiplan.robot.robot import load_robot


def pose_of(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(robot.tool_frame)].copy()


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_solutions_reach_the_pose_within_limits_and_differ(name):
    robot = load_robot(name)
    rng = np.random.default_rng(4)
    for _ in range(5):
        X_WG = pose_of(robot, random_seeds(robot, np.zeros(robot.n), rng, 1)[0])
        result = solve_ik(robot, robot.tool_frame, X_WG, random_seeds(robot, np.zeros(robot.n), rng, 60), IkOptions())
        assert len(result.solutions) > 1
        for k, q in enumerate(result.solutions):
            position, orientation = pose_error(pose_of(robot, q), X_WG)
            assert max(position, orientation) <= 1e-8
            assert ((robot.limits.lower <= q) & (q <= robot.limits.upper)).all()
            assert all(np.abs(q - other).max() > 0.1 for other in result.solutions[:k])


def test_a_seed_near_a_solution_ends_there():
    robot = load_robot("panda")
    ready = robot.configurations["ready"]
    result = solve_ik(robot, robot.tool_frame, pose_of(robot, ready), [ready + 1e-3], IkOptions())
    assert result.solutions[0] == pytest.approx(ready, abs=5e-3)


def test_out_of_reach_reports_the_nearest_miss():
    robot = load_robot("planar2r")
    X_WG = pin.SE3(np.eye(3), np.array([3.0, 0.18, 0.5]))
    seeds = random_seeds(robot, np.zeros(2), np.random.default_rng(0), 20)
    result = solve_ik(robot, robot.tool_frame, X_WG, seeds, IkOptions())
    assert not result.solutions
    assert result.position_error == pytest.approx(1.9, abs=1e-3)  # the stretched arm reaches 1.1 m
    assert pose_error(pose_of(robot, result.nearest), X_WG)[0] == pytest.approx(result.position_error)


def test_free_orientation_is_not_looked_at():
    robot = load_robot("planar2r")
    target = pin.SE3(pin.rpy.rpyToMatrix(1.0, 0.0, 2.0), pose_of(robot, np.array([0.4, 0.9])).translation)
    seeds = random_seeds(robot, np.zeros(2), np.random.default_rng(0), 20)
    assert not solve_ik(robot, robot.tool_frame, target, seeds, IkOptions()).solutions
    found = solve_ik(robot, robot.tool_frame, target, seeds, IkOptions(orientation=np.pi)).solutions
    assert len(found) == 2  # elbow up and elbow down
    assert all(pose_error(pose_of(robot, q), target)[0] < 1e-8 for q in found)


def test_it_stops_when_told():
    robot = load_robot("panda")
    ready = robot.configurations["ready"]
    seeds = random_seeds(robot, ready, np.random.default_rng(0), 50)
    used = []
    options = IkOptions(count=1000, stop=lambda: len(used) >= 3)
    solve_ik(robot, robot.tool_frame, pose_of(robot, ready), (used.append(1) or seed for seed in seeds), options)
    assert len(used) == 3


def test_no_seed_is_an_error():
    robot = load_robot("planar2r")
    with pytest.raises(ValueError, match="seed"):
        solve_ik(robot, robot.tool_frame, pin.SE3.Identity(), [], IkOptions())
