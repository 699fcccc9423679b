"""What is left of a proved clearance: never more than the bodies' true distance, and nearly that on the path."""

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.execution.paths.proved_path import ProvedPath


@pytest.mark.parametrize("name", ["02_shelf", "15_srra"])
def test_it_bounds_the_distance_with_the_joints_off(run_of, name):
    run = run_of(name)
    left = ProvedPath(run, "test").clearance_left
    model = CollisionModel(run.problem.robot, run.problem.scene)
    rng = np.random.default_rng(0)
    for size in (0.0, 1e-3, 0.05):
        for t in rng.uniform(0.0, run.duration, 40):
            off = size * rng.uniform(-1.0, 1.0, run.trajectory.n)
            least = left.least(t, np.abs(off))
            exact = model.clearance(run.trajectory(t) + off).distance
            assert least <= max(exact, 0.0) + 1e-9
            if size == 0.0:
                assert least > 0.0


def test_the_robot_stops_where_too_little_is_left(run_of):
    run = run_of("15_srra")
    executor = op.Executor(run, tracking=op.TrackingPolicy(least_clearance=0.0))
    for _ in range(50):
        tick = executor.tick(1e-3, executor.tick(0.0).q)
    assert tick.status.clearance > 0.0
    assert tick.status.reason == ""
    far = executor.tick(0.0).q + 0.4
    executor.tick(1e-3, far)
    assert "are left of the proved clearance, less than 0 mm" in executor.status.reason


def test_it_is_of_the_scene_of_each_part(run_of):
    run = run_of("40_panda_sorts_cubes")
    left = ProvedPath(run, "test").clearance_left
    still = np.zeros(run.trajectory.n)
    assert all(left.least(t, still) > 0.0 for t in np.linspace(0.0, run.duration, 40))
    assert left.least(0.5 * run.duration, still + 0.5) < 0.0
