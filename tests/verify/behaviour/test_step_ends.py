"""Where a task lets pairs be nearer than its clearance: at ends that its steps state, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.problem.problem import derived
from optiplan.problem.seams.actions import PathEvent, SeamPath
from optiplan.problem.seams.building import SeamShape
from optiplan.problem.task.steps import TaskStep
from optiplan.problem.task.timeline import mismatch, proved_parts, scene_parts
from optiplan.problem.task.tour_steps import in_order
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.joining import standstill
from optiplan.trajectory.segments import ON_PATH, PASSING, Segment
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.collision_check import collision
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.tasks.task_check import task_scope
from optiplan.verify.tasks.task_parts import step_parts
from tests.verify.tasks.test_arms_check import FIRST, SECOND, problem_of

BEND, RATE, T = 0.6, 0.5, 2.0
TIMES = (0.0, 0.1, 0.2, 1.0, 1.0, 1.8, 2.0)
KINDS = (ON_PATH, ON_PATH, ON_PATH, PASSING, ON_PATH, ON_PATH)


@pytest.fixture(scope="module")
def on_path(planar):
    """The tool goes round: to a path, along it past an event, and on."""
    motion = Trajectory(planar.joint_names, np.array([0.0, T]), np.array([[[0.0, BEND], [RATE, 0.0]]]))
    poses = [frame_pose(planar, motion(t), "tool") for t in np.linspace(TIMES[2], TIMES[-2], 41)]
    points = np.array([X.translation for X in poses[::2]])
    through = {k: poses[2 * k - 1].translation for k in range(1, len(points))}
    curve = SeamShape(points, through, False, 0.0, np.array([X.rotation[:, 2] for X in poses[::2]]), None).curve()
    event = (PathEvent(0.5 * curve.length, "on"),)
    path = SeamPath(planar.joint_names, "tool", curve, curve.length / 1.6, 0.01, 0.0, 0.0, 1e-4, 1e-3, event)
    plain = op.Problem(planar, [0.0, BEND], [1.0, BEND]).with_parts(clearance=0.005)
    problem = derived(plain, goal=(), task=(TaskStep(1, "path", "path", path),))
    begins = [*TIMES[:3], TIMES[3], TIMES[4], TIMES[5]]
    ends = [*TIMES[1:4], TIMES[3], TIMES[5], TIMES[6]]
    rows = zip(KINDS, begins, ends, strict=True)
    segments = tuple(Segment(1, kind, "on" if kind == PASSING else "path", begin, end) for kind, begin, end in rows)
    return problem, replace(motion, segments=segments)


def times(motion, parts):
    """When the motion is at the ends of its parts, by its first joint, which turns evenly."""
    return sorted({round(float(q[0]) / RATE, 6) for part in parts for q in part.problem.scene.safety.ends})


def test_a_path_has_its_ends_and_no_place_to_which_the_robot_goes_freely(on_path):
    problem, motion = on_path
    assert not mismatch(problem, motion)
    assert times(motion, scene_parts(problem, motion)) == [0.0, 0.2, 1.8]


def test_the_scope_says_that_contacts_are_allowed_on_the_way_to_a_path_too(on_path):
    problem, motion = on_path
    (step,) = problem.task
    touching = derived(problem, task=(replace(step, allowed=frozenset({frozenset({"tool", "part"})})),))
    ordered = in_order(touching, motion)
    (said,) = task_scope(ordered, motion, list(step_parts(ordered, motion)))
    assert said.endswith("part – tool in step 1, the ways to its path and from it included")


def test_an_arm_on_its_way_is_at_no_end_of_another():
    problem = problem_of(FIRST, SECOND).with_parts(clearance=0.005)
    names = problem.robot.joint_names
    moved = np.array([2.4 if name.endswith("shoulder") or name.endswith("1") else 0.0 for name in names])
    motion = Trajectory(names, np.array([0.0, 2.0]), np.stack([problem.start, moved / 2.0])[None])
    (other,) = (step.action.joints for step in problem.task if step.name == "second")
    for second, on_its_way in (((0.5, 2.0), set(other)), ((1.0, 2.0), set())):
        segments = (Segment(1, "move", "first", 0.0, 1.0), Segment(2, "move", "second", *second))
        parts = scene_parts(problem, replace(motion, segments=segments))
        found = {tuple(q) for part in parts for q in part.problem.scene.safety.ends}
        assert len(found) == 3, (second, found)
        unknown = {name for q in found for name, value in zip(names, q, strict=True) if np.isnan(value)}
        assert unknown == on_its_way


def test_a_part_without_an_end_asks_for_the_whole_distance(planar):
    """A ball is nearer than asked where the motion ends: that may be where the end is known alone."""
    end = np.array([0.4, 0.0])
    place = frame_pose(planar, end, "tool").translation + np.array([0.1, 0.0, 0.0])
    problem = op.Problem(planar, [0.0, 0.0], end, scene=[op.Sphere("ball", 0.05, position=tuple(place))])
    distance = CollisionModel(problem.robot, problem.scene).clearance(end).distance
    asked = problem.with_parts(clearance=distance + 0.004)
    motion = standstill(planar.joint_names, end, 1.0)
    (part,) = scene_parts(asked, motion)
    assert collision(part.problem, motion, VerifyPolicy()).passed
    assert not collision(asked, motion, VerifyPolicy()).passed


def test_an_end_stays_one_while_the_arm_stands_there(planar):
    """What is released after a pause is as near as the end of the move before lets it be."""
    held = op.Sphere("held", 0.02, position=(0.1, 0, 0)).attached_to("tool")
    task = op.Task().move([1.0, BEND]).dwell(0.5).detach("held")
    problem = op.Problem(planar, [0.0, BEND], scene=op.Scene(attached=[held], safety=0.005), task=task)
    pieces = [[[0.0, BEND], [1.0, 0.0]], [[1.0, BEND], [0.0, 0.0]]]
    motion = Trajectory(planar.joint_names, np.array([0.0, 1.0, 1.5]), np.array(pieces))
    steps = [("move", 0.0, 1.0), ("dwell", 1.0, 1.5), ("detach", 1.5, 1.5)]
    segments = tuple(Segment(k, kind, "", *bounds) for k, (kind, *bounds) in enumerate(steps, 1))
    last = proved_parts(problem, replace(motion, segments=segments))[-1]
    assert [q.tolist() for q in last.problem.scene.safety.ends] == [[1.0, BEND]]
