"""What was seen of a robot, as a run folder."""

import json

import numpy as np

from optiplan.robot.frames import frame_poses
from optiplan.simulation.log import LOG
from optiplan.simulation.recording import RecordedMotion
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.run_data.closed_loop import read_log
from tests.simulation.conftest import READY, swing


def test_the_folder_has_the_motion_and_its_errors(reach, tmp_path):
    motion = swing(reach.robot.joint_names, READY, 0.3, 2.0)
    t = np.linspace(0.0, 2.0, 51)
    wanted, v = motion(t), motion(t, 1)
    q = wanted.copy()
    q[:, 0] += 1e-3
    files = RecordedMotion(reach, "somebody", t + 7.0, q, v, wanted).files()
    record, motion = (json.loads(files[name]) for name in ("run.json", "trajectory.json"))
    assert (record["planner"], record["duration"]) == ("somebody", 2.0)
    assert not record["report"]["verified"]
    np.testing.assert_allclose(Trajectory.from_dict(motion)(t), q, atol=1e-9)
    (tmp_path / LOG).write_bytes(files[LOG])
    log = read_log(tmp_path)
    np.testing.assert_allclose((log["wanted"] - log["q"])[:, 0], -1e-3)
    apart = frame_poses(reach.robot, q, reach.robot.tool_frame) - frame_poses(
        reach.robot, wanted, reach.robot.tool_frame
    )
    np.testing.assert_allclose(log["tool_error"][:, 0], np.linalg.norm(apart[:, :3, 3], axis=1), atol=1e-9)
