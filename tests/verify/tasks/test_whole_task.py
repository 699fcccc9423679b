"""What is stated of a tour holds during the whole of it, also while the tool rests at a target."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.trajectory.joining import join_trajectories, standstill
from optiplan.trajectory.profiles.laws import SCurve
from optiplan.trajectory.profiles.synchronisation import RestToRest
from optiplan.trajectory.segments import Segment

DWELL = 4.0


@pytest.mark.parametrize("at_least", [0.1, 0.3])
def test_a_clearance_from_what_moves_is_proved_while_the_tool_rests(at_least):
    """A ball comes to about 0.2 m from the hand, long after that has arrived."""
    robot = op.load_robot("panda")
    q = np.array(robot.configurations["ready"])[:7]
    q[0] += 0.3
    there, hand = robot.fk(q).to_data(), robot.fk(q, "panda_hand").position
    ball = op.Sphere("ball", 0.03, position=(hand[0] + 1.5, *hand[1:])).moving([[0, -0.5], [0], [0]], until=2.5)
    keep = [{"clearance": {"pairs": [["panda_hand", "ball"]], "at_least": at_least}}]
    target = {"name": "a", "position": there["position"], "quaternion": there["quaternion"]}
    task = op.Task().tour([target], at_each=[{"dwell": DWELL}], path_constraints=keep)
    problem = op.Problem("panda", "ready", scene=[ball], task=task)
    names, end = problem.robot.joint_names, np.array(problem.start)
    end[names.index("panda_joint1")] += 0.3
    leg = RestToRest(problem.start, end, problem.limits, names, lambda _: SCurve()).trajectory()
    whole = join_trajectories([leg, standstill(names, end, DWELL)])
    segments = Segment(1, "tour", "a", 0.0, leg.duration), Segment(1, "dwell", "dwell", leg.duration, whole.duration)
    report = op.verify(problem, replace(whole, segments=segments))
    if at_least == 0.1:
        assert report.verified, report.failures
        return
    (refused,) = report.failures
    assert refused.name == "clearance constraint"
    assert refused.time > leg.duration
