"""Scores of base poses: what is missing, what is better, and what a map covers."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.planners.base import Budget
from optiplan.planners.tours.placing import PlaceRange, PlaceScore, moved_base, search_places


@pytest.fixture(scope="module")
def problem():
    targets = [{"position": (0.45, y, 0.3), "axis": (0, 0, -1)} for y in (-0.2, 0.0, 0.2)]
    return op.Problem("ur5", "ready", task=op.Tour(targets, closed=True))


def test_a_base_is_moved_and_turned_about_itself():
    X = moved_base(pin.SE3(np.eye(3), np.array([1.0, 2.0, 0.0])), np.array([0.1, 0.2, 0.3, np.pi / 2]))
    assert np.allclose(X.translation, [1.1, 2.2, 0.3])
    assert np.allclose(X.rotation @ [1, 0, 0], [0, 1, 0])


def test_places_out_of_reach_are_counted(problem):
    score = PlaceScore(problem, Budget(60.0))
    assert score.at(np.zeros(4))[0] == 0
    missing, seconds = score.at(np.array([-0.4, 0.0, 0.0, 0.0]))
    assert 0 < missing < 3
    assert seconds == np.inf
    assert score.at(np.array([-2.0, 0.0, 0.0, 0.0])) == (3, np.inf)
    wall = problem.with_scene([op.Box("column", size=(0.3, 0.3, 0.3), position=(0.0, -0.8, 0.4))])
    assert PlaceScore(wall, Budget(60.0)).at(np.array([0.0, -0.8, 0.0, 0.0]))[0] == 4  # the start is not free


@pytest.mark.parametrize("along", [(-0.3, 0.3), (0.2, 0.3)])
def test_a_wide_region_is_more_than_its_middle(along):
    """Something stands in the middle, or that is no part of it."""
    ball = op.Sphere("ball", radius=0.08, position=(0.5, 0.0, 0.3))
    goal = op.Region((0.5, 0.0, 0.3), rpy=(np.pi, 0, 0), along={"y": along}, about={"z": "free"})
    score = PlaceScore(op.Problem("ur5", "ready", goal, scene=[ball]), Budget(60.0))
    missing, seconds = score.at(np.zeros(4))
    assert missing == 0
    assert np.isfinite(seconds)


def test_the_search_is_no_worse_than_its_map_and_the_given_base(problem):
    where = PlaceRange(0.2, 0.2, yaw=0.0, points=3)
    scores = search_places(problem, where, Budget(60.0), lambda stage, fraction: None)
    assert (scores.moved[0] == 0.0).all()
    best = scores.ranked()[0]
    assert scores.missing[best] == 0
    assert scores.seconds[best] == scores.seconds.min() < scores.seconds[0]
    assert (np.abs(scores.moved) <= where.reach + 1e-12).all()
    grid = {tuple(row) for row in np.round(scores.moved, 6).tolist()}
    assert {(x, y, 0.0, 0.0) for x in (-0.2, 0.0, 0.2) for y in (-0.2, 0.0, 0.2)} <= grid


def test_ends_of_what_is_held_later_are_left_out(problems):
    score = PlaceScore(op.load_problem(problems / "51_tool_changer.yaml"), Budget(60.0))
    assert len(score.places) == 10  # of two ends each of five approaches, without the plate's
    assert score.at(np.zeros(4))[0] <= 10


def test_fingers_that_close_are_no_way_back_to_the_start():
    near, far = (op.Pose((0.5, y, 0.3), rpy=(np.pi, 0, 0)) for y in (0.3, 0.35))
    plain, with_fingers = op.Task().move(near).move(far), op.Task().move(near).gripper("hand", [0.02]).move(far)
    scores = [PlaceScore(op.Problem("panda", "ready", task=t), Budget(60.0)) for t in (plain, with_fingers)]
    assert [len(score.places) for score in scores] == [2, 2]
    assert len({score.at(np.zeros(4)) for score in scores}) == 1
