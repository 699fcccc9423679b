"""What the guard takes for granted."""

import numpy as np
import pytest

import optiplan as op
from optiplan.control.braking_path import BrakingPath


def test_the_simple_bound_of_a_stop_is_one(panda, baxter, delbot):
    rng = np.random.default_rng(0)
    for robot in (panda, baxter, delbot):
        for dt in (0.001, 0.01):
            controller = op.Controller(robot, [], scene=op.Scene())
            start = op.State(next(iter(robot.configurations.values())))
            controller.step(start, dt)
            guard, box, path = controller._guard, controller._box, BrakingPath(robot, False)
            for _ in range(200):
                v = rng.uniform(-1, 1, robot.n) * robot.limits.velocity * rng.choice([1.0, 0.05])
                a = rng.uniform(-1, 1, robot.n) * robot.limits.acceleration
                path.start(start.q, v, a, box, dt)
                way = np.max([np.abs(path.at(k) - start.q) for k in range(0, path.steps + 1, 5)], axis=0)
                assert (guard._longest_way(op.State.of(start.q, v, a)) >= way).all()
                assert path.at(path.steps) == pytest.approx(path.end, abs=1e-10)
