"""Path constraints that the start or the goal violates are bad input, with both values, whatever their kind."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from tests.planned import planned_until

START, GOAL = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0], [0.3, -1.2, 1.0, -1.2, -1.5, 0.2]
MOVING = op.State(START, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 0.0, 0.0, 0.0])
CASES = {
    "manipulability": (START, {"at_least": 5.0}, ("start", "of manipulability 0.0", "5 is asked for")),
    "coupling": (START, {"joints": {"elbow_joint": 2.0}, "within": 0.5}, ("start", "uncoupled by 3 of 0.5")),
    "tool_speed": (MOVING, {"linear": 0.1}, ("start", "too fast: tool0 at 0.5", "0.1 m/s allowed")),
    "tool_acceleration": (MOVING, {"angular": 1.0}, ("start", "too fast: tool0 at 3", "1 rad/s² allowed")),
    "tip_over": (
        START,
        {"corners": [[1, 0], [2, 0], [2, 1]], "height": -0.5},
        ("start", "tipping over: a margin of -", "0 m is asked for"),
    ),
    "clearance": (START, {"pairs": [["tool0", "base_link"]], "at_least": 0.1}, ("no body",)),
}


@pytest.mark.parametrize("kind", CASES)
def test_a_start_that_violates_it_is_refused(kind):
    start, constraint, words = CASES[kind]
    with pytest.raises(InputError) as caught:
        op.Problem("ur5", start, GOAL, path_constraints=[{kind: constraint}])
    assert all(word in str(caught.value) for word in words), caught.value


def test_a_via_that_violates_it_is_refused():
    coupling = {"joints": {"elbow_joint": 1.0}, "equals": 1.25, "within": 0.3}
    far = [*START[:2], START[2] + 0.5, *START[3:]]
    with pytest.raises(InputError, match=r"via\[0\]: a via that is uncoupled by 0\.75 of 0\.3"):
        op.Problem("ur5", START, GOAL, vias=[far], path_constraints=[{"coupling": coupling}])
    for via, during in ((far, (0.9, 1.0)), (op.ViaPoint(far, tolerance=0.6), (0.0, 1.0))):
        stated = [{"coupling": coupling | {"during": list(during)}}]
        assert op.Problem("ur5", START, GOAL, vias=[via], path_constraints=stated).vias


def test_wheels_that_are_too_fast_at_the_start_are_refused():
    home = op.load_robot("delbot").configurations["home"]
    driving = op.State(home, [0.2, *[0.0] * 8])
    with pytest.raises(InputError, match=r"wheels at 6\.667 rad/s of 2 rad/s allowed"):
        op.Problem("delbot", driving, home + 0.2, path_constraints=[{"wheel_speed": {"at_most": 2.0}}])


@pytest.mark.parametrize("pair", [["wrist_3_link", "wrist_2_link"], ["wrist_3_link", "post"]])
def test_a_pair_that_is_not_checked_cannot_be_asked_to_stay_apart(pair):
    scene = op.Scene(
        [op.Box("post", size=(0.1, 0.1, 0.1), position=(2.0, 0.0, 0.0))], allowed=[("wrist_3_link", "post")]
    )
    with pytest.raises(InputError, match=r"clearance\.pairs\[0\]: .*(adjacent|allows to touch)"):
        op.Problem("ur5", START, GOAL, scene, path_constraints=[{"clearance": {"pairs": [pair], "at_least": 0.01}}])


def test_what_holds_at_both_ends_is_accepted():
    value = 0.02
    given = [{"manipulability": {"at_least": value}}, {"tool_speed": {"linear": 1.0}}]
    assert len(op.Problem("ur5", MOVING, GOAL, path_constraints=given).path_constraints) == 2


def test_a_motion_of_years_is_proved_in_a_moment():
    """A metre in thirty years: intervals and samples of the proof do not grow with it."""
    slow = {"tool_speed": {"linear": 1e-9}}, {"tool_acceleration": {"linear": 1.0}}
    run = op.plan(op.Problem("ur5", START, GOAL, path_constraints=slow), "quintic")
    assert run.trajectory is None
    run = planned_until(op.Problem("ur5", START, GOAL, path_constraints=slow))
    assert run.verified, run.failure
    assert run.trajectory.duration > 1e7
    assert np.isfinite(run.trajectory(run.trajectory.duration)).all()
