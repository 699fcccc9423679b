"""Steps of different length: what holds in one step can be kept in the next, however long that is."""

import numpy as np
import pytest

import optiplan as op
from benchmarks.demonstrations import controller_uneven_steps as uneven


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
@pytest.mark.parametrize("name", list(uneven.START))
@pytest.mark.parametrize(("longest", "mixed"), [(0.02, False), (0.1, False), (0.1, True)])
def test_no_limit_of_a_joint_is_passed(name, form, longest, mixed):
    found = uneven.passes(name, form, longest, 400, mixed, scene=False, seed=1)
    assert found.pop("braked") < 0.05
    assert max(found.values()) <= 1e-7, found


def test_bodies_stay_apart_too():
    found = uneven.passes("panda", "velocity", 0.05, 400, mixed=True, scene=True, seed=2)
    assert max(found.values()) <= 1e-6, found


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_a_step_beyond_the_longest_goes_along_the_stop_and_says_so(panda, form):
    limits, far = panda.limits, panda.configurations["ready"] + 9.0
    controller = op.Controller(panda, [op.PostureTask(far, cost=1.0)], form=form, longest_step=0.02)
    state, rng, late = op.State(panda.configurations["ready"]), np.random.default_rng(0), 0
    for _ in range(400):
        dt = float(rng.choice([0.01, 0.02, 0.03, 0.4], p=[0.5, 0.3, 0.1, 0.1]))
        step = controller.step(state, dt)
        if dt > 0.02:
            late += 1
            assert step.status in ("stopping", "stopped")
            assert f"the step of {dt:g} s is longer than 0.02 s" in step.reason
            assert np.abs(step.v).max() <= max(np.abs(state.v).max(), 1e-12) + 0.02
        else:
            assert step.solver != "braking"
        state = step.state
        assert (np.maximum(limits.lower - state.q, state.q - limits.upper) <= 1e-8).all()
        assert (np.abs(state.v) <= limits.velocity + 1e-8).all()
    assert late > 30
    assert (state.q > limits.upper - 1e-3).sum() >= 5, "the limits were worth testing"


@pytest.mark.parametrize("longest", [0.0, -1.0, float("inf"), None, "long"])
def test_a_longest_step_is_a_time(panda, longest):
    with pytest.raises(op.InputError, match="longest_step"):
        op.Controller(panda, [], longest_step=longest)
