"""Alternatives of a task: what is told of them while they are planned, and of those that were not tried."""

import time

import pytest

import optiplan as op
from optiplan.planners.base import Candidate, Failure, PlanResult, announce, silent
from optiplan.planners.task.alternatives import plan_alternatives
from optiplan.trajectory.trajectory import Trajectory


@pytest.mark.parametrize(("seconds", "words"), [(0.0, "1 alternatives tried, of 2,"), (60.0, "2 alternatives")])
def test_a_failure_counts_the_alternatives_that_were_tried(seconds, words):
    problem = op.Problem("ur5", "ready", task=op.Task().either(op.Task().dwell(0.1), op.Task().dwell(0.2)))

    def failed(*_):
        return PlanResult(None, Failure("no-path", "step 1: a wall"))

    found = plan_alternatives(failed, None, problem, op.Budget(seconds), silent)
    assert found.failure.detail == f"none of {words} can be done; of one, step 1: a wall"


class Told:
    """A progress that keeps the durations of the motions that it is told of."""

    def __init__(self):
        self.durations = []

    def __call__(self, stage, fraction):
        pass

    def found(self, motion, bound):
        assert bound == 0.0  # that of one alternative is none of the task
        self.durations.append(motion.duration)


@pytest.mark.parametrize(
    ("durations", "told"), [(((9, 7), (8, 6, 4)), [9, 7, 6, 4]), (((5, 4), (9, 6)), [5, 4]), (((5,), (9, 2)), [5, 2])]
)
def test_motions_of_alternatives_are_told_when_they_are_found_if_they_are_the_quickest(durations, told):
    """Nobody was told of a motion before all alternatives were planned, and the times of the later ones were wrong."""
    problem = op.Problem("ur5", "ready", task=op.Task().either(op.Task().dwell(0.1), op.Task().dwell(0.2)))
    alternatives = iter(durations)

    def planned(planner, own, budget, progress):
        found = [Trajectory(("a",), (0.0, float(T)), [[[0.0]]]) for T in next(alternatives)]
        for motion in found:
            announce(progress, motion, 1.0)
        time.sleep(0.02)
        *earlier, last = (Candidate(motion, 0.01) for motion in found)
        return PlanResult(last.trajectory, None, {}, {}, tuple(earlier), last.seconds)

    progress = Told()
    found = plan_alternatives(planned, None, problem, op.Budget(60.0), progress)
    assert progress.durations == told
    before = [one.trajectory.duration for one in found.earlier]
    assert found.trajectory.duration == min(told)
    assert before == sorted(before, reverse=True)
    assert {*told, durations[0][-1], durations[1][-1]} == {*before, min(told)}
    late = [one.seconds for one in found.earlier if one.trajectory.duration in durations[1]]
    assert all(seconds > 0.02 for seconds in late)
    assert (found.seconds > 0.02) == (min(told) in durations[1])
