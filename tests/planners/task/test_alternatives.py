"""Alternatives of a task: what is reported of those that were not tried."""

import pytest

import optiplan as op
from optiplan.planners.base import Failure, PlanResult, silent
from optiplan.planners.task.alternatives import plan_alternatives


@pytest.mark.parametrize(("seconds", "words"), [(0.0, "1 alternatives tried, of 2,"), (60.0, "2 alternatives")])
def test_a_failure_counts_the_alternatives_that_were_tried(seconds, words):
    problem = op.Problem("ur5", "ready", task=op.Task().either(op.Task().dwell(0.1), op.Task().dwell(0.2)))

    def failed(*_):
        return PlanResult(None, Failure("no-path", "step 1: a wall"))

    found = plan_alternatives(failed, None, problem, op.Budget(seconds), silent)
    assert found.failure.detail == f"none of {words} can be done; of one, step 1: a wall"
