"""Problems made from problems: what they say of themselves is what they are, or nothing."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError
from optiplan.geometry.scene import Attachment, Box, Capsule, Cylinder, HalfSpace, Mesh, Obstacle, Scene, Sphere
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.problem.problem import JointGoal, PoseGoal, Problem, Via, derived

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.fixture
def problem(write):
    return load_problem(write())


def far(x: float) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([x, 5.0, 0.0]))


def everything(folder: Path) -> Scene:
    (folder / "a.obj").write_text(MESH)
    shapes = [Box((0.1, 0.2, 0.3)), Sphere(0.1), Cylinder(0.1, 0.2), Capsule(0.1, 0.2), Mesh(folder / "a.obj")]
    bodies = [Obstacle(f"body{k}", shape, far(3.0 * k)) for k, shape in enumerate(shapes)]
    floor = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), -2.0), pin.SE3.Identity())
    held = Attachment("held", Sphere(0.01), "tip", pin.SE3.Identity(), frozenset({"fore"}))
    return Scene((*bodies, floor), (held,), frozenset({frozenset({"body0", "tip"})}))


def test_a_task_takes_the_place_of_a_goal_with_its_vias_and_a_goal_that_of_a_task(problem):
    task = problem.with_vias([0.5, 0.1]).with_task([{"move": {"joints": [0.3, 0.2]}}])
    assert (len(task.task), task.goal, task.vias) == (1, (), ())
    assert problem_from_dict(task.source).hash == task.hash
    assert task.with_goal(problem.goal[0]).hash == problem.hash
    by_hand = derived(task).with_goal(problem.goal[0])
    assert (len(by_hand.task), len(by_hand.goal)) == (0, 1)
    by_hand = derived(problem.with_vias([0.5, 0.1])).with_task(task.task)
    assert (len(by_hand.task), by_hand.goal, by_hand.vias) == (1, (), ())
    with pytest.raises(InputError, match="`goal` beside a task"):
        problem.with_parts(task=[{"dwell": 1.0}], goal=problem.goal[0])


def test_what_is_derived_says_what_it_is(problem, tmp_path):
    """Of every kind: the source makes the same problem again, with the same hash, which is none of the others'."""
    frame = problem.robot.tool_frame
    scene = everything(tmp_path)
    X_WG = pin.SE3(np.eye(3), np.array([0.7, 0.2, 0.0]))
    made = {
        "start": problem.with_start(np.array([0.1, 0.2])),
        "joints": problem.with_goal(JointGoal(np.array([0.3, 0.2]))),
        "any": problem.with_goal(JointGoal(np.array([0.3, 0.2])), PoseGoal(frame, X_WG, 0.01, 0.02)),
        "vias": problem.with_vias(
            Via(JointGoal(np.array([0.5, 0.1]), 0.01), np.array([0.1, 0.0]), 1.0), Via(PoseGoal(frame, X_WG), time=2.0)
        ),
        "scene": problem.with_scene(scene),
        "limits": problem.with_limits(velocity=0.5, jerk="none"),
    }
    assert len({problem.hash, *(one.hash for one in made.values())}) == len(made) + 1
    for one in made.values():
        again = problem_from_dict(one.source)
        assert again.hash == one.hash
        np.testing.assert_array_equal(again.start, one.start)
        assert one.robot is problem.robot
    np.testing.assert_array_equal(made["start"].start, [0.1, 0.2])
    assert made["any"].goal[1].position == 0.01
    np.testing.assert_allclose(made["any"].goal[1].X_WG.homogeneous, X_WG.homogeneous, atol=1e-15)
    assert [via.time for via in made["vias"].vias] == [1.0, 2.0]
    for found, given in zip(made["scene"].scene.obstacles, scene.obstacles, strict=True):
        assert (found.name, found.shape) == (given.name, given.shape)
        np.testing.assert_allclose(found.X_WO.homogeneous, given.X_WO.homogeneous, atol=1e-14)
    assert made["scene"].scene.attached[0].touch == {"fore"}
    assert made["scene"].scene.allowed == scene.allowed
    np.testing.assert_allclose(made["limits"].limits.velocity, 0.5 * problem.robot.limits.velocity)
    assert np.isinf(made["limits"].limits.jerk).all()


def test_the_same_start_again_is_the_same_problem(problem):
    assert problem.with_start(problem.start).hash == problem.hash
    assert problem.with_start(np.array([0.1, 0.2])).with_start(problem.start).hash == problem.hash


def test_what_is_derived_has_no_hash_of_another_problem(problem):
    """The fault: run.json described another problem than the one that was planned."""
    grafted = derived(problem, start=np.array([0.1, 0.2]))
    assert (grafted.hash, dict(grafted.source)) == ("", {})
    with pytest.raises((TypeError, ValueError)):
        derived(problem, start=np.array([0.1, 0.2]), hash=problem.hash)


def test_no_argument_switches_the_checks_off(problem):
    with pytest.raises(InputError, match="limits"):
        Problem(problem.robot, start=[9.0, 9.0], goal=[0.0, 0.0], limits=problem.robot.limits)
    with pytest.raises(TypeError, match="gaol"):
        derived(problem, gaol=())


def test_the_seed_is_recorded_beside_the_hash(problem):
    other = problem.with_seed(7)
    assert (other.seed, other.hash, other.source) == (7, problem.hash, problem.source)
    assert other.with_start(np.array([0.1, 0.2])).seed == 7


def test_what_is_derived_is_checked_as_a_file_is(problem):
    with pytest.raises(InputError, match="start"):
        problem.with_start(np.array([9.0, 0.0]))
    with pytest.raises(InputError, match="limits"):
        problem.with_limits(speed=0.5)
    with pytest.raises(InputError, match="tolerance"):
        problem.with_goal(JointGoal(np.array([0.3, 0.2]), 0.1))


def test_a_problem_without_source_stays_one(problem):
    bare = derived(problem)
    assert bare.with_start(np.array([0.1, 0.2])).hash == ""
    np.testing.assert_allclose(bare.with_limits(velocity=0.5).limits.velocity, 0.5 * problem.robot.limits.velocity)
