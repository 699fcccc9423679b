"""Obstacles that appear, change and vanish while a run is executed."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.execution.paths.path_laws import PathLaws

DT = 1e-3


@pytest.fixture(scope="module")
def ahead(run_of):
    """A run, and where the tool will be."""
    run = run_of("01_reach")
    return run, tuple(run.problem.robot.fk(run.trajectory(0.7 * run.duration)).matrix[:3, 3])


def started(run, **options):
    executor = op.Executor(run, clearance=0.01, **options)
    for _ in range(100):
        executor.tick(DT)
    return executor


def test_a_prepared_path_is_not_made_by_the_first_update(ahead, monkeypatch):
    run, at = ahead
    executor = op.Executor(run, clearance=0.01)
    executor.prepare()
    executor.tick(DT)
    monkeypatch.setattr("optiplan.execution.scene.scene_watch.NativeCollisionModel", None)  # cannot be made any more
    executor.update_scene({"new": op.Sphere("new", 0.06, position=at)})
    assert "'new'" in executor.status.reason


@pytest.mark.parametrize(
    "shape", [lambda at: op.Sphere("new", 0.06, position=at), lambda at: op.Box("new", (0.1, 0.1, 0.1), position=at)]
)
def test_an_obstacle_that_appears_blocks_the_path_until_it_is_gone(ahead, shape, monkeypatch):
    """The robot goes on as soon as limits leave room for that, if they leave none at the very moment."""
    run, at = ahead
    executor = started(run)
    executor.update_scene({"new": shape(at)})
    assert "'new'" in executor.status.reason
    for _ in range(1000):
        executor.tick(DT)
    assert executor.status.phase == "waiting"
    monkeypatch.setattr(PathLaws, "change", lambda *_: None)
    executor.update_scene({"new": None})
    assert executor.status.reason == ""
    while executor.status.phase != "done":
        executor.tick(DT)


def test_it_blocks_where_one_that_was_known_blocks(ahead):
    run, at = ahead
    known = op.plan(run.problem.with_scene([op.Sphere("ball", 0.06, position=(2.0, 0.0, 0.5))]), budget=3.0)
    reasons = []
    for one, update in ((run, op.Sphere("ball", 0.06, position=at)), (known, op.Pose(at))):
        executor = started(one)
        executor.update_scene({"ball": update})
        reasons.append(executor.status.reason)
    assert reasons[0] == reasons[1] != ""


def test_an_obstacle_of_another_size_replaces_the_one_of_its_name(ahead):
    run, at = ahead
    beside = (at[0], at[1], at[2] + 0.5)
    executor = started(run)
    executor.update_scene({"new": op.Sphere("new", 0.05, position=beside)})
    assert executor.status.reason == ""
    executor.update_scene({"new": op.Sphere("new", 0.45, position=beside)})
    assert "'new'" in executor.status.reason


def test_bodies_of_obstacles_that_are_gone_are_taken_again(ahead):
    executor = started(ahead[0])
    for k in range(30):
        executor.update_scene({f"ball{k}": op.Sphere(f"ball{k}", 0.05, position=(2.0, 0.0, 0.5))})
        executor.update_scene({f"ball{k}": None})
    (part,) = next(iter(executor._scene.watch._watches.values()))
    assert len(part._added) == 1


@pytest.mark.parametrize(
    ("update", "words"),
    [
        ({"new": None}, "expected an obstacle, as none is known yet"),
        ({3: op.Sphere("new", 0.05, position=(2, 0, 0))}, "and a name"),
        ({"new": op.Sphere("new", 0.05, position=(2, 0, 0)).moving([[0], [0, 1.0], [0]])}, "one that stands"),
        ({"new": "a ball"}, "poses by name, obstacles, or None"),
    ],
)
def test_updates_that_cannot_be_used_end_in_a_stop(ahead, update, words):
    executor = started(ahead[0])
    executor.update_scene(update)
    assert words in executor.status.reason
    assert executor.status.phase == "stopping"


def test_the_scene_of_a_plan_is_the_one_that_will_be_there(ahead):
    run, at = ahead
    executor = started(run)
    flying = op.Sphere("flying", 0.05, position=(2.0, 0.0, 0.5))
    executor.update_scene({"flying": flying, "new": op.Sphere("new", 0.05, position=at)}, {"flying": (-1.0, 0.0, 0.0)})
    scene = executor._scene.at(executor.time + 0.2)
    moved = next(one for one in scene.obstacles if one.name == "flying")
    np.testing.assert_allclose(moved.X_WO.translation, (1.8, 0.0, 0.5), atol=1e-12)
    assert [one.name for one in scene.dynamic_obstacles] == ["flying"]
    assert [one.name for one in scene.standing.obstacles] == ["new"]


def poses_of(obstacles):
    return {one.name: op.Pose(one.X_WO.translation, quaternion=pin.SE3ToXYZQUAT(one.X_WO)[3:]) for one in obstacles}


def test_what_stands_where_the_run_has_it_blocks_nothing(run_of):
    """Bodies are watched in cells, and so near to the path the robot waited for ever, for a wall or a cube taken."""
    run = run_of("40_panda_sorts_cubes")
    executor, poses = op.Executor(run), poses_of(run.problem.scene.obstacles)
    executor.update_scene(poses)
    assert (executor.status.reason, executor.status.phase) == ("", "running")
    executor.update_scene({"wall": op.Pose(poses["wall"].position + np.array([0.0, 0.0, 1e-4]))})
    assert "'wall'" in executor.status.reason


def test_a_cube_that_is_back_where_it_was_taken_is_not_where_the_run_has_it(run_of):
    run = run_of("40_panda_sorts_cubes")
    executor, poses = op.Executor(run), poses_of(run.problem.scene.obstacles)
    released = next(one for one in run.trajectory.segments if one.kind == "detach")
    while executor.status.place <= released.begin:
        executor.tick(0.02)
    there = poses_of(executor._path.parts[executor._path.part_at(executor.status.place)].problem.scene.obstacles)
    for pose, expected in ((poses[released.object], False), (there[released.object], True)):
        executor.update_scene({released.object: pose})
        assert executor._scene._obstacles[released.object].expected is expected


def test_older_data_neither_replace_nor_erase_newer_ones(ahead):
    run, at = ahead
    executor = started(run)
    executor.update_scene({"new": op.Sphere("new", 0.06, position=at)})
    for older in (None, op.Pose((2.0, 0.0, 0.5))):
        executor.update_scene({"new": older}, age=0.05)
        assert executor._scene._obstacles["new"].time == executor.time
        assert executor.status.phase != "running"
    executor.update_scene({"new": None})
    executor.update_scene({"new": op.Sphere("new", 0.06, position=at)}, age=0.05)
    assert executor._scene.names == ()


def test_a_velocity_that_is_written_again_moves_no_obstacle_that_was_seen(ahead):
    """A program may keep one array for all velocities that it hands over."""
    run, at = ahead
    ball, velocity = op.Sphere("ball", 0.05, position=(at[0], at[1] + 1.5, at[2])), np.zeros(3)
    executor = started(run)
    executor.update_scene({"ball": ball}, {"ball": velocity})
    velocity[1] = -1.5 / (0.7 * run.duration - 0.1)  # of another one, seen next: this would be in the way
    executor.update_scene({})
    assert executor.status.reason == ""
    executor.update_scene({"ball": ball}, {"ball": velocity})
    assert "'ball'" in executor.status.reason
