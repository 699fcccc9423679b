"""What steps of a task state besides their ends: the speed of lines, and distances from what moves."""

import numpy as np
import pytest

import optiplan as op
from optiplan.problem.problem import derived
from tests.checks import named

START = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]

ABOVE = (0.5, 0.2, 1.1)
"""m: over the hand."""


def lines(speed):
    task = op.Task().line(by=(0.0, 0.0, 0.15), speed=speed).retreat(0.05, speed=1.0)
    return op.Problem("ur5", START, task=task)


def test_a_line_that_is_faster_than_its_speed_is_refused():
    run = op.plan(lines(0.5), budget=5.0)
    assert run.verified
    assert named(run.report, "line speed").worst <= 0.5 * 1.001
    slower = op.verify(lines(0.1), run.trajectory)
    assert [check.name for check in slower.failures] == ["line speed"]
    (refused,) = slower.failures
    assert refused.limit == pytest.approx(0.1, rel=2e-3)
    assert refused.worst > 0.2
    assert "step 1 (line)" in refused.detail
    assert refused.time < run.trajectory.segments[0].end


@pytest.mark.parametrize(("wait", "holds"), [(0.0, True), (2.0, False)])
def test_a_clearance_of_a_step_counts_where_things_are_then(wait, holds):
    """A ball falls at 0.2 m/s: while the arm waits it comes nearer than the step allows."""
    ball = op.Sphere("ball", 0.05, position=ABOVE).moving([[0], [0], [0, -0.2]], until=2.0)
    keep = op.PairClearance([("ball", "wrist_3_link")], at_least=0.3)
    end = [*START[:5], 0.05]
    task = op.Task().dwell(wait or 1e-3).move(end, path_constraints=[keep])
    run = op.plan(op.Problem("ur5", START, scene=[ball], task=task), budget=5.0)
    begin = run.trajectory.segments[1].begin
    assert begin == pytest.approx(wait or 1e-3)
    found = named(run.report, "clearance constraint")
    assert found.passed is holds
    assert run.verified is holds
    if not holds:
        assert found.time >= begin
        place = np.array(found.witness["points"])[found.witness["pair"].index("ball")]
        assert place[2] < ABOVE[2] - 0.2 * begin + 0.05 + 1e-3


CUP = op.Cylinder("cup", 0.02, 0.1, position=(0, 0, 0.13)).attached_to("panda_hand", touch=["panda_leftfinger"])
UP = op.OrientationCone("cup", (0, 0, 1), (0, 0, -1), 0.6)
AWAY = [0.3, 0.2, 0, -1.2, 0.9, 1.6, 0.8]


def test_a_constraint_of_the_whole_on_what_a_step_releases_is_refused():
    """Held again it may be held otherwise, and in between it is no frame of the robot."""
    scene = op.Scene(attached=[CUP])
    task = op.Task().move(AWAY, path_constraints=[UP]).detach("cup").retreat(0.1)
    assert op.Problem("panda", "ready", scene=scene, task=task).task[0].constraints
    words = "'cup', which a step of the task releases; expected the constraint in each"
    with pytest.raises(op.InputError, match=words):
        op.Problem("panda", "ready", scene=scene, task=task, path_constraints=[UP])


def test_an_expression_of_the_whole_is_judged_with_the_load_of_each_time():
    """A torque that rises by what is taken: without the ball it would stay below."""
    ball = op.Sphere("ball", 0.03, position=(0.42, 0.0, 0.45))
    task = op.Task().dwell(0.1).attach("ball", "panda_hand", mass=3.0).dwell(0.1)
    run = op.plan(op.Problem("panda", "ready", scene=[ball], task=task), "quintic", budget=5.0)
    assert run.verified, run
    found = []
    for bound in (1e3, 0.0):
        weak = op.Expression("weak", lambda k: k.torque()[3], upper=bound, lower=-1e3 if bound else -np.inf)
        problem = derived(run.problem, path_constraints=(weak,))
        found.append([check for check in op.verify(problem, run.trajectory).checks if check.name == "weak constraint"])
    held = [check.worst for check in found[1]]
    assert len(held) == 2
    assert abs(held[1] - held[0]) > 5.0
    assert [check.time < 0.1 for check in found[1]] == [True, False]


FINGERS = ("panda_hand", "panda_leftfinger", "panda_rightfinger")
TOUCHED = [("held", finger) for finger in FINGERS]
LAST = {
    "torque": lambda more: op.Task().move("ready").attach("cube", "panda_hand", mass=50.0 if more else 0.1),
    "collision": lambda more: op.Task().move("ready").detach("held", allowed_collisions=[] if more else TOUCHED),
}


@pytest.mark.parametrize("check", LAST)
def test_what_the_last_event_leaves_is_proved_too(check):
    """What is held or released at the end is as heavy, and as near, as it would be in a step after that."""
    aside = [0.4, *op.load_robot("panda").configurations["ready"][1:]]
    cube = op.Box("cube", size=(0.05, 0.05, 0.05), position=(0.5, 0, 0.1))
    held = op.Box("held", size=(0.05, 0.2, 0.05), position=(0, 0, 0.1)).attached_to("panda_hand", touch=FINGERS)
    of = {more: op.Problem("panda", aside, scene=op.Scene([cube], [held]), task=LAST[check](more)) for more in (0, 1)}
    run = op.plan(of[0], planner="quintic", budget=10.0)
    assert run.verified
    assert [one.name for one in op.verify(of[1], run.trajectory).failures] == [check]
    refused = op.plan(of[1], planner="quintic", budget=10.0)
    assert "as soon as '" in refused.failure.detail
