"""Exported samples: as many as are said, as far apart as a controller plays them, and only where they are proved."""

import json
import re

import numpy as np
import pytest

import optiplan as op
from optiplan.runs.export import MOST_SAMPLES, depends_on_time, export

START = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]
END = [0.5, -1.4, 1.4, -1.5, -1.5, 0.0]


def turning(seconds):
    c = np.zeros((1, 4, 6))
    c[0, 0], c[0, 2], c[0, 3] = START, 3.0 / seconds**2, -2.0 / seconds**3
    return op.Trajectory([f"j{k}" for k in range(6)], [0.0, seconds], c)


def test_a_long_program_takes_as_long_as_the_motion(tmp_path):
    """Of more than two minutes at 500 Hz, 60 000 samples were written, each of them for 2 ms: much too fast."""
    written = export(turning(200.001), tmp_path / "long.script")
    lines = [line for line in (tmp_path / "long.script").read_text().splitlines() if "servoj(" in line]
    assert len(lines) == written.samples - 1 == round(written.duration * 500)
    assert all(", t=0.002," in line for line in lines)
    assert 0.0 <= written.duration - 200.001 < 0.002


@pytest.mark.parametrize("rate", [125.0, 333.0, 500.0, 243.37879113187682])
@pytest.mark.parametrize("seconds", [0.0101, 16.713622348939396, 48.8897151525647, 130.0])
def test_a_cycle_is_kept(tmp_path, rate, seconds):
    export(turning(seconds), tmp_path / "x.npz", rate=rate, cyclic=True)
    t = np.load(tmp_path / "x.npz")["t"]
    assert np.diff(t) == pytest.approx(1.0 / rate, rel=1e-9)
    assert seconds * (1.0 - 1e-9) <= t[-1] < seconds + 1.0 / rate


def test_a_rate_is_kept_or_refused(tmp_path):
    assert export(turning(100.0), tmp_path / "x.npz", rate=1000.0).samples == 100_001
    with pytest.raises(op.InputError, match=f"at most {MOST_SAMPLES}"):
        export(turning(100.0), tmp_path / "y.npz", rate=1e4)
    assert not (tmp_path / "y.npz").exists()


def test_a_slower_motion_among_what_moves_is_verified_first(tmp_path):
    """A ball crosses the way a second after the arm has gone."""
    problem = op.Problem("ur5", START, END)
    alone = op.plan(problem, "quintic")
    tool = op.load_robot("ur5")
    place = op.Pose.from_matrix(_tool(tool, 0.5 * np.add(START, END))).position
    ball = op.Sphere("ball", 0.05, position=(*place[:2], place[2] + 1.0)).moving([[0], [0], [0, -0.9]], until=2.5)
    run = op.plan(op.Problem("ur5", START, END, scene=[ball]), "quintic")
    assert run.verified
    assert run.duration == pytest.approx(alone.duration)
    assert run.export(tmp_path / "x.script").duration >= run.duration
    with pytest.raises(op.InputError, match="depends on the time"):
        run.export(tmp_path / "x.csv", rate=0.5, cyclic=True)
    assert run.export(tmp_path / "x.csv", rate=0.5).samples == 2


def _tool(robot, q):
    from optiplan.kinematics.jacobians import frame_pose

    return frame_pose(robot, q, robot.tool_frame)


def test_what_a_slower_motion_may_not_be_a_motion_for():
    rest = {"start": {"joints": [0]}, "goal": {"any_of": [{"joints": [1]}]}}
    assert not depends_on_time(rest)
    assert depends_on_time(rest | {"start": {"joints": [0], "velocity": [1]}})
    assert depends_on_time(rest | {"goal": {"any_of": [{"joints": [1], "velocity": [1]}]}})
    assert depends_on_time(rest | {"scene": {"obstacles": [{"name": "a"}, {"name": "b", "motion": {}}]}})


def test_a_name_of_a_step_is_one_line():
    """It stands in a comment of a robot's program."""
    motion = turning(1.0)
    data = motion.to_dict() | {
        "segments": [{"step": 1, "kind": "gripper", "name": "x\n  halt", "begin": 0.0, "end": 1.0}]
    }
    with pytest.raises(op.InputError, match=re.escape("segments[0]")):
        op.Trajectory.from_dict(json.loads(json.dumps(data)))
