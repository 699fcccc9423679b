import copy
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.scene import Attachment, Box, Capsule, Cylinder, HalfSpace, Obstacle, Scene, Sphere
from optiplan.problem.problem import JointGoal, Problem
from optiplan.robot.robot import Robot, load_robot
from optiplan.trajectory.trajectory import Trajectory
from tests.unchecked_problem import unchecked_problem
from tests.viewer.browsing import visit

__all__ = ["visit"]


def at(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def quintic(robot: Robot, start: np.ndarray, goal: np.ndarray, duration: float) -> Trajectory:
    coefficients = np.zeros((1, 6, robot.n))
    coefficients[0, 0] = start
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        coefficients[0, power] = factor * (goal - start) / duration**power
    return Trajectory(robot.joint_names, np.array([0.0, duration]), coefficients)


@pytest.fixture(scope="session")
def panda() -> Robot:
    return load_robot("panda")


@pytest.fixture(scope="session")
def planar() -> Robot:
    return load_robot("planar2r")


@pytest.fixture(scope="session")
def bare(planar: Robot) -> Problem:
    """Two links that have joints and nothing else."""
    robot = copy.copy(planar)
    robot.__dict__.update(name="bare", visual=pin.GeometryModel(), geometry=pin.GeometryModel())
    return unchecked_problem(
        name="flat",
        robot=robot,
        scene=Scene(),
        start=np.zeros(2),
        goal=(JointGoal(np.array([1.0, -1.0])),),
        limits=robot.limits,
    )


@pytest.fixture(scope="session")
def shelf(panda: Robot) -> Problem:
    """A Panda, something in its hand, and one obstacle of every primitive shape."""
    obstacles = (
        Obstacle("board", Box((0.4, 0.9, 0.02)), at(0.75, 0.0, 0.3)),
        Obstacle("ball", Sphere(0.05), at(0.7, -0.2, 0.36)),
        Obstacle("can", Cylinder(0.03, 0.12), at(0.7, 0.2, 0.37)),
        Obstacle("pill", Capsule(0.03, 0.1), at(0.8, 0.0, 0.39)),
        Obstacle("ground", HalfSpace((0.0, 0.0, 1.0), -0.01), at(0.0, 0.0, 0.0)),
    )
    held = Attachment("part", Box((0.03, 0.03, 0.1)), "panda_hand", at(0.0, 0.0, 0.12))
    goal = np.array([0.6, 0.3, -0.2, -1.6, 0.1, 1.9, 0.9])
    start = panda.configurations["ready"]
    return unchecked_problem(
        name='a <b>shelf</b> & "more"',
        robot=panda,
        scene=Scene(obstacles, (held,)),
        start=start,
        goal=(JointGoal(goal),),
        limits=panda.limits,
    )


@pytest.fixture(scope="session")
def motion() -> Callable[[Problem, float], Trajectory]:
    """The quintic from a problem's start to its first goal, in so many seconds."""

    def build(problem: Problem, duration: float = 1.6) -> Trajectory:
        end = problem.goal[0]
        assert isinstance(end, JointGoal)
        return quintic(problem.robot, problem.start, end.q, duration)

    return build
