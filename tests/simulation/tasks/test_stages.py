"""Stages of a task: where objects change hands, and between which fingers press."""

import numpy as np
import pytest

import optiplan as op
from optiplan.simulation.tasks.stages import stage_at, stages_of


def test_a_task_has_a_stage_for_each_scene_and_grip(fetch):
    stages = stages_of(fetch.problem, fetch.trajectory)
    events = {segment.kind: segment.begin for segment in fetch.trajectory.segments}
    grips = [(s.begin, s.end) for s in fetch.trajectory.segments if s.kind == "gripper"]
    begins = [stage.begin for stage in stages]
    assert begins == pytest.approx([0.0, events["attach"], grips[0][1], grips[1][0], events["detach"]])
    assert [len(stage.actions) for stage in stages] == [0, 1, 0, 0, 1]
    assert [sorted(stage.fingers) for stage in stages] == [[], ["cube"], ["cube"], ["cube"], []]
    assert [sorted(stage.pressed) for stage in stages] == [[], [], ["cube"], [], []]
    assert stages[2].fingers["cube"] == {7: -1.0}  # towards zero, which is closed
    held = [[body.name for body in stage.problem.scene.attached] for stage in stages]
    assert held == [[], ["cube"], ["cube"], ["cube"], []]


def test_a_stage_begins_at_its_place(fetch):
    stages = stages_of(fetch.problem, fetch.trajectory)
    cut = stages[1].begin
    assert stage_at(stages, np.array([-1.0, 0.0, np.nextafter(cut, 0.0), cut, 1e9])).tolist() == [0, 0, 0, 1, 4]


def test_a_motion_to_a_goal_is_one_stage():
    problem = op.load_problem("01_reach")
    run = op.plan(problem, planner="quintic", budget=1.0)
    (stage,) = stages_of(problem, run.trajectory)
    assert stage.problem is problem
    assert not stage.actions
