"""Goals of many poses: the promising ones first."""

import numpy as np
import pinocchio as pin

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget
from optiplan.planners.common.many_ends import AT_ONCE, MANY, end_batches
from optiplan.problem.goals_and_vias import PoseGoal


def test_ends_that_are_reached_and_free_come_first():
    wall = op.Box("wall", size=(0.05, 2.0, 2.0), position=(-0.4, 0, 0.5))
    problem = op.Problem("panda", "ready", op.Pose((0.5, 0, 0.5)), [wall])
    down = pin.exp3(np.array([np.pi, 0, 0]))
    far = [PoseGoal("panda_hand_tcp", pin.SE3(down, np.array([2.0 + 0.1 * k, 0, 0.4]))) for k in range(8)]
    blocked = [PoseGoal("panda_hand_tcp", pin.SE3(down, np.array([-0.4, 0.02 * k, 0.4]))) for k in range(8)]
    free = [PoseGoal("panda_hand_tcp", pin.SE3(down, np.array([0.45, 0.03 * k, 0.4]))) for k in range(MANY)]
    model = planning_model(problem.robot, problem.scene)
    batches = list(end_batches(problem, (*far, *blocked, *free), model, Budget(30.0)))
    assert set(batches[0]) | set(batches[1]) == set(free)
    assert len(batches[0]) == AT_ONCE
    assert sum(map(len, batches)) == 28
    (few,) = end_batches(problem, tuple(free), model, Budget(30.0))
    assert few == tuple(free)
