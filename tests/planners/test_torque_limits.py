"""Torque limits as the simple planners meet them: slower motion, or a reason."""

from dataclasses import replace

import numpy as np
import pytest

from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from tests.planners import cases


def plan(name, share):
    problem = cases.free()
    limits = replace(problem.limits, torque=problem.limits.torque * share)
    return make_planner(name).plan(replace(problem, limits=limits), Budget(20.0), lambda stage, fraction: None)


@pytest.mark.parametrize("name", ["quintic", "rrtconnect"])
def test_weaker_motors_are_slower(name):
    strong, weak = (plan(name, share).trajectory for share in (np.inf, 0.45))
    assert weak.duration > 1.03 * strong.duration


@pytest.mark.parametrize("name", ["quintic", "rrtconnect"])
def test_an_arm_too_heavy_for_its_motors_is_told(name):
    result = plan(name, 0.1)
    assert result.trajectory is None
    assert result.failure.kind == "unsupported"
    assert "gravity" in result.failure.detail
