"""Motions proved with a clearance: samples never come nearer, what does is refused, and reports tell of both."""

import pickle

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.floors import floors_of
from optiplan.collision.kept_models import collision_model
from optiplan.collision.model import CollisionModel
from optiplan.problem.task.timeline import scene_parts
from optiplan.verify.verify import verify
from tests.checks import named
from tests.planned import planned_until


def collision(report):
    return named(report, "collision")


def least_left(problem, motion, samples=400):
    """Of dense samples the least of what is left above the floors, m."""
    left = np.inf
    for part in scene_parts(problem, motion):
        model = CollisionModel(part.problem.robot, part.problem.scene)
        floors = floors_of(model, part.problem.scene.safety)
        pairs = np.arange(len(model.pairs))
        for q in part.motion(motion)(np.linspace(0.0, part.end - part.begin, samples)):
            floor = floors.over(pairs, np.tile(q, (len(pairs), 1)), np.zeros((len(pairs), motion.n)))
            near = [one for one in model.contacts(q, floor.max() + 0.001) if floor[one.pair.index] > 0.0]
            left = min([left, *(one.distance - floor[one.pair.index] for one in near)])
    return left


@pytest.fixture(scope="module")
def shelf():
    """A motion that passes a shelf at less than a millimetre."""
    return op.plan(op.load_problem("02_shelf").with_parts(clearance=0), budget=1.5)


def test_a_motion_that_shaves_is_refused_and_one_planned_for_it_is_proved(shelf):
    asked = shelf.problem.with_parts(clearance=0.005)
    report = verify(asked, shelf.trajectory)
    assert [check.name for check in report.failures] == ["collision"]
    check = collision(report)
    assert check.detail.startswith("bodies come nearer than the 5 mm required of them")
    assert 0.0 < check.worst < 0.005 == check.limit
    run = planned_until(asked)
    assert run.verified, run
    check = collision(run.report)
    assert min(check.witness["scene_clearance"], check.witness["self_clearance"]) == check.worst > check.limit == 0.005
    assert check.witness["required"] == {"scene": 0.005, "self": 0.005, "within": 0.5, "pairs": 0}
    assert check.witness["nearer"] == []
    assert "scene.safety" in check.covers
    assert least_left(asked, run.trajectory) > 0.0
    (words,) = [one for one in run.report.scope if one.startswith("clearance required")]
    assert words.startswith("clearance required: 5 mm from the scene, 5 mm of the robot from itself")
    assert verify(asked.with_parts(clearance=0), shelf.trajectory).verified


@pytest.mark.parametrize("planner", ["rrtconnect", "trajopt"])
def test_scene_and_self_are_asked_apart(planner, shelf):
    """More than the shelf leaves: a hand keeps it outside, and its fingers reach in."""
    safety = op.Safety(0.08, own=0.001, pairs=(op.SafePairs(("*finger",), ("*",), 0.0),))
    run = planned_until(shelf.problem.with_parts(clearance=safety), planner, 1.5)
    assert run.verified, run
    assert collision(run.report).witness["scene_clearance"] < 0.08  # fingers may come nearer
    assert least_left(run.problem, run.trajectory) > 0.0


def test_a_start_nearer_than_asked_keeps_most_of_its_distance_and_the_report_says_so(shelf):
    """The motion is planned from where the shelf's motion is nearest, to its goal."""
    check = collision(shelf.report)
    near = shelf.trajectory(check.time)
    problem = shelf.problem.with_start(near).with_parts(clearance=op.Safety(0.005, own=0.005, within=0.6))
    run = planned_until(problem)
    assert run.verified, run
    check = collision(run.report)
    (one, *_) = check.witness["nearer"]
    assert one["q"] == pytest.approx(near.tolist())
    assert one["floor"] == pytest.approx(0.8 * one["distance"])
    assert check.limit == min(other["floor"] for other in check.witness["nearer"]) < check.worst
    assert any(words.startswith("nearer at an end, with floors of 0.8 of that") for words in run.report.scope)
    assert least_left(problem, run.trajectory) > 0.0
    slow = run.trajectory.scaled(2.0 * run.trajectory.duration)
    assert verify(problem, slow).verified  # floors are of places, not of times
    away = shelf.trajectory  # passes there without an end there
    assert not verify(shelf.problem.with_parts(clearance=problem.scene.safety), away).verified


def test_a_goal_pose_that_no_configuration_reaches_clear_is_reached_nearer():
    stand = op.Box("stand", size=(0.2, 0.2, 0.2), position=(0.5, 0.0, 0.1))
    goal = op.Pose((0.5, 0.0, 0.2125), rpy=(np.pi, 0, 0))  # fingertips 3 mm above it
    problem = op.Problem("panda", "ready", goal, scene=op.Scene([stand], safety=0.01))
    run = planned_until(problem)
    assert run.verified, run
    check = collision(run.report)
    assert {tuple(one["pair"]) for one in check.witness["nearer"]} >= {("panda_leftfinger", "stand")}
    assert 0.0 < check.worst < 0.01
    assert least_left(problem, run.trajectory) > 0.0


def test_steps_of_a_task_may_begin_and_end_nearer(task):
    assert task.verified, task
    check = collision(task.report)
    assert {tuple(one["pair"]) for one in check.witness["nearer"] if not one["built"]} == {("block", "table")}
    assert least_left(task.problem, task.trajectory, 60) > 0.0
    away = next(segment for segment in task.trajectory.segments if segment.kind == "retreat")
    model = CollisionModel(task.problem.robot, task.problem.scene)
    assert model.clearance(task.trajectory(away.end)).distance > 0.005


@pytest.fixture(scope="module")
def task():
    """The Panda takes a block that lies 1 mm above a table, and lifts it."""
    above = {"rpy": [np.pi, 0, 0]}
    table = op.Box("table", size=(0.6, 0.8, 0.04), position=(0.5, 0, -0.02))
    block = op.Box("block", size=(0.04, 0.04, 0.06), position=(0.5, 0.1, 0.031))
    steps = [
        {"approach": {"pose": {"position": [0.5, 0.1, 0.05], **above}, "distance": 0.08}},
        {"attach": {"object": "block", "link": "panda_hand", "touch": ["panda_leftfinger", "panda_rightfinger"]}},
        {"retreat": {"distance": 0.08}},
    ]
    problem = op.Problem("panda", "ready", task=steps, scene=op.Scene([table, block], safety=0.005))
    return planned_until(problem, seconds=4.0)


def test_a_named_pair_is_measured_though_it_is_proved_never_to_meet():
    robot = op.load_robot("panda")
    start, goal = robot.configurations["ready"].copy(), robot.configurations["ready"].copy()
    start[5], goal[5] = 0.1, 3.0  # where the hand is 0.102 m from link 4, and away from it
    problem = op.Problem(robot, start, goal)
    motion = op.plan(problem, "quintic", budget=1.0).trajectory
    assert robot.allowed["panda_hand", "panda_link4"] == "proved"

    def asked(at_least):
        pairs = (op.SafePairs(("panda_hand",), ("panda_link4",), at_least),)
        return problem.with_parts(clearance=op.Safety(pairs=pairs, within=0.01))

    assert verify(asked(0.10), motion).verified
    check = collision(verify(asked(0.14), motion))
    assert not check.passed
    assert check.detail.startswith("bodies come nearer than the 140 mm required of them")
    again = pickle.loads(pickle.dumps(asked(0.14)))
    assert not verify(again, motion).verified


def test_what_is_checked_does_not_depend_on_what_a_problem_was_made_of():
    plain = op.Problem("panda", "ready", "extended")
    pairs = (op.SafePairs(("panda_hand",), ("panda_link4",), 0.01),)
    asked = plain.with_parts(clearance=op.Safety(pairs=pairs))
    known = {one: len(collision_model(one.robot, one.scene).pairs) for one in (plain, asked)}
    assert known[asked] == known[plain] + 1
    for again in (
        asked.with_parts(clearance=0.005),
        asked.with_scene([]),
        op.Problem(asked.robot, "ready", "extended"),
    ):
        same = again.scene.safety is not None and bool(again.scene.safety.pairs)
        assert len(collision_model(again.robot, again.scene).pairs) == known[asked if same else plain]
