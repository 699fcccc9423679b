"""Exported samples: as many as are said, as far apart as a controller plays them, and only where they are proved."""

import json
import re

import numpy as np
import pytest

import optiplan as op
from optiplan.runs.export import MOST_SAMPLES, export_trajectory
from optiplan.runs.run import Run
from tests.verify.motions import quintic

START = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]
END = [0.5, -1.4, 1.4, -1.5, -1.5, 0.0]


def turning(seconds):
    c = np.zeros((1, 4, 6))
    c[0, 0], c[0, 2], c[0, 3] = START, 3.0 / seconds**2, -2.0 / seconds**3
    return op.Trajectory([f"j{k}" for k in range(6)], [0.0, seconds], c)


def test_a_long_program_takes_as_long_as_the_motion(tmp_path):
    """Of more than two minutes at 500 Hz, 60 000 samples were written, each of them for 2 ms: much too fast."""
    written = export_trajectory(turning(200.001), tmp_path / "long.script")
    lines = [line for line in (tmp_path / "long.script").read_text().splitlines() if "servoj(" in line]
    assert len(lines) == written.samples - 1 == round(written.duration * 500)
    assert all(", t=0.002," in line for line in lines)
    assert 0.0 <= written.duration - 200.001 < 0.002


@pytest.mark.parametrize(
    ("seconds", "rate"),
    [(0.0101, 125.0), (0.0101, 500.0), (16.713622348939396, 243.37879113187682), (48.8897151525647, 333.0)],
)
def test_a_cycle_is_kept(tmp_path, seconds, rate):
    export_trajectory(turning(seconds), tmp_path / "x.npz", rate=rate, cyclic=True)
    t = np.load(tmp_path / "x.npz")["t"]
    np.testing.assert_allclose(np.diff(t), 1.0 / rate, rtol=1e-9)
    assert seconds * (1.0 - 1e-9) <= t[-1] < seconds + 1.0 / rate


def test_a_rate_is_kept_or_refused(tmp_path):
    assert export_trajectory(turning(20.0), tmp_path / "x.npz", rate=1000.0).samples == 20_001
    with pytest.raises(op.InputError, match=f"at most {MOST_SAMPLES}"):
        export_trajectory(turning(100.0), tmp_path / "y.npz", rate=1e4)
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
    with pytest.raises(op.InputError, match="not verified when it is slowed down"):
        run.export(tmp_path / "x.csv", rate=0.5, cyclic=True)
    assert run.export(tmp_path / "x.csv", rate=0.5).samples == 2


def _tool(robot, q):
    from optiplan.robot.frames import frame_pose

    return frame_pose(robot, q, robot.tool_frame)


ARM = """<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 -1 0"/>
<limit lower="-2" upper="2" velocity="3" effort="9.5"/></joint></robot>"""


def test_slower_can_be_more_torque_and_is_proved_again(tmp_path):
    """Gravity alone asks for 9.81 N·m on the way; the arm brakes there, so that 9.5 do, unless it is slow."""
    (tmp_path / "arm.urdf").write_text(ARM)
    limits = {"acceleration": 20.0, "jerk": 200.0}
    robot = op.Robot.from_urdf(tmp_path / "arm.urdf", limits=limits, collision="none")
    problem = op.Problem(robot, [-1.2], [0.3])
    motion = quintic(robot.joint_names, [-1.2], [0.3], 1.5)
    report = op.verify(problem, motion)
    assert report.verified, report
    run = Run(problem, "own", {}, motion, None, report, None, None, {}, {})
    assert run.export(tmp_path / "fast.json", rate=100.0, cyclic=True).duration == pytest.approx(1.5)
    for name, rate in (("slow.json", 0.1), ("slow.csv", 0.2)):
        with pytest.raises(op.InputError, match=r"slowed down from 1\.5 to .* to end on a cycle \(torque\)"):
            run.export(tmp_path / name, rate=rate, cyclic=True)
        assert not (tmp_path / name).exists()
    slow = run.export(tmp_path / "slow.json", rate=0.1, cyclic=True, unverified=True)
    assert slow.duration == pytest.approx(10.0)


def test_every_motion_that_is_slowed_down_is_verified_in_the_file(tmp_path):
    problem = op.Problem("ur5", START, END)
    run = op.plan(problem, "quintic")
    written = run.export(tmp_path / "x.json", rate=7.0, cyclic=True)
    assert written.duration > run.duration
    assert op.verify(problem, tmp_path / "x.json").verified


def test_a_name_of_a_step_is_one_line():
    """It stands in a comment of a robot's program."""
    motion = turning(1.0)
    data = motion.to_dict() | {
        "segments": [{"step": 1, "kind": "gripper", "name": "x\n  halt", "begin": 0.0, "end": 1.0}]
    }
    with pytest.raises(op.InputError, match=re.escape("segments[0]")):
        op.Trajectory.from_dict(json.loads(json.dumps(data)))
