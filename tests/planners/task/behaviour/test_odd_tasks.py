"""Tasks that people write by accident: moves that go nowhere, steps that contradict themselves."""

from itertools import count

import numpy as np
import pytest

import optiplan as op
from optiplan.planners import base

START = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]
DOWN = [np.pi, 0.0, 0.0]


def test_moves_that_go_nowhere_are_done():
    task = op.Task().move(START).move(START).dwell(0.1).move("up").move("up")
    run = op.plan(op.Problem("ur5", START, task=task), budget=4.0)
    assert run.verified, run.failure
    assert run.duration > 0.1


def test_a_step_that_contradicts_itself_is_named_though_the_budget_ends(monkeypatch):
    """On a plane, and meanwhile on another 20 cm above it. The budget is 2000 looks at the clock, on any machine."""
    looks = count()
    monkeypatch.setattr(base, "clock", lambda: 1e-3 * next(looks))
    level, raised = ({"plane": {"normal": [0, 0, 1], "offset": z, "within": 0.001}} for z in (0.3, 0.5))
    raised["plane"]["during"] = [0.4, 0.6]
    there, here = ({"move": {"pose": {"position": [0.45, y, 0.3], "rpy": DOWN}}} for y in (0.2, -0.3))
    task = [there, {**here, "path_constraints": [level, raised], "name": "impossible"}]
    run = op.plan(op.Problem("ur5", START, task=task), budget=2.0)
    assert not run.verified
    assert run.failure.kind == "constraint"
    assert run.failure.detail.startswith("step 2 (impossible): ")
    assert run.failure.witness["constraint"] == "plane"
    assert run.failure.witness["step"] == 2
    assert len(run.failure.witness["q"]) == 6


@pytest.mark.parametrize("closed", [False, True])
def test_a_tour_to_where_the_arm_stands_is_done(closed):
    here = op.load_robot("ur5").fk(START).to_data()
    target = {"position": here["position"], "quaternion": here["quaternion"]}
    run = op.plan(op.Problem("ur5", START, task=op.Tour([target], closed=closed)), budget=4.0)
    assert run.verified, run.failure or run.report.failures
    assert run.duration < 0.01
