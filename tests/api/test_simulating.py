"""`op.execute`: tasks and speeds in our plant, and arguments that cannot be."""

import numpy as np
import pytest

import optiplan as op


@pytest.fixture(scope="module")
def run():
    return op.plan(op.load_problem("01_reach"), budget=3.0)


def test_speeds_are_those_of_an_executor(run):
    log = op.execute(run, speeds=[(0.0, 1.0), (0.2, 0.3), (0.6, 0.8)])
    assert log.t[-1] > 1.3 * run.duration
    assert log.tracking.tool_rms < 1e-4  # no lag: its torques are fed forward
    assert not log.touched
    path = run.trajectory(np.linspace(0.0, run.duration, 4000))
    assert max(np.abs(path - q).max(axis=1).min() for q in log.wanted[::50]) < 1e-3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"engine": "gazebo"}, "engine.*own, mujoco"),
        ({"speeds": "fast"}, "speeds.*pairs"),
        ({"speeds": [(0.0, 1.0), (0.3, 1.2)]}, r"speeds\[1\].*from 0 to 1"),
        ({"speeds": [0.5]}, r"speeds\[0\]"),
        ({"delay": 1e9}, "delay.*multiple.*up to 10 s"),
        ({"delay": 1e-5}, "delay.*multiple of the plant's step"),
        ({"wheels": np.array([1, 2])}, "wheels.*True or False"),
        ({"grip": np.array(["weld", "friction"])}, "grip.*weld, friction"),
        ({"grip": "glue"}, "grip.*weld, friction"),
        ({"grip": "friction"}, "grip.*mujoco"),
        ({"wheels": True}, "wheels.*mujoco"),
        ({"engine": "mujoco", "wheels": True}, "wheels.*'panda'.*delbot"),
        ({"grip": op.FrictionGrip(20.0)}, "grip.*mujoco"),
    ],
)
def test_arguments_that_cannot_be_are_named(run, arguments, words):
    with pytest.raises(op.InputError, match=f"execute.*{words}"):
        op.execute(run, **arguments)


def test_a_run_that_the_executor_refuses_says_why(run):
    moving = op.plan(op.load_problem("37_on_the_move"), budget=3.0)
    with pytest.raises(op.InputError, match="ends in motion"):
        op.execute(moving, speeds=[(0.0, 0.5)])
    assert op.execute(moving).tracking.tool_rms < 1e-3  # as planned it can be followed


def test_of_speeds_at_the_same_time_the_last_counts(run):
    log = op.execute(run, speeds=[(0.0, 1.0), (0.0, 0.5)])
    assert log.t[-1] > 1.5 * run.duration


def test_an_execution_that_ends_early_says_so_where_it_is_printed(run):
    log = op.execute(run, payload=1e9)
    assert log.stopped
    assert log.stopped in repr(log)
