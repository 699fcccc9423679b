"""Motions in the languages of controllers: ROS 2's JointTrajectory message and URScript."""

import json
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import wrong_argument
from optiplan.trajectory.segments import EVENTS
from optiplan.trajectory.trajectory import Trajectory

_NANO = 1_000_000_000

_START_TOLERANCE = 0.01  # rad; how far the arm may stand from the first sample when a URScript program begins
_UR_JOINTS = 6


def ros_json(trajectory: Trajectory, t: Array) -> bytes:
    """Return a `trajectory_msgs/msg/JointTrajectory` as JSON, in the form that rosbridge takes."""
    return json.dumps(joint_trajectory(trajectory, t), allow_nan=False).encode() + b"\n"


def ros_yaml(trajectory: Trajectory, t: Array) -> bytes:
    """Return the same as YAML, a line a point, for `ros2 topic pub` and parameter files."""
    message = joint_trajectory(trajectory, t)
    lines = [
        "# trajectory_msgs/msg/JointTrajectory; rad or m, s. Between points: quintic polynomials.",
        *(f"# at {t:.3f} s: {words}" for t, words in _events(trajectory)),
        f"header: {json.dumps(message['header'])}",
        f"joint_names: {json.dumps(message['joint_names'])}",
        "points:",
        *(f"- {json.dumps(point, allow_nan=False)}" for point in message["points"]),
    ]
    return ("\n".join(lines) + "\n").encode()


def joint_trajectory(trajectory: Trajectory, t: Array) -> dict[str, Any]:
    """Return the message as a dictionary, with points at times t (k,), s."""
    samples = trajectory.sampled(t)
    points = [
        {"positions": q, "velocities": v, "accelerations": a, "effort": [], "time_from_start": _duration(at)}
        for at, q, v, a in zip(samples["t"], samples["q"], samples["v"], samples["a"], strict=True)
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(trajectory.joint_names), "points": points}


def urscript(trajectory: Trajectory, t: Array) -> bytes:
    """Return a program that servos an arm through samples at times t (k,), s, one a cycle, from 0 to the end.

    It refuses to begin where the arm does not stand at the start. `servoj` filters what it is given (`lookahead_time`,
    s) and follows with a lag, so the arm is near the motion, not on it.

    Raises:
        InputError: the motion is not of six joints, in the order of the arm.
    """
    names = trajectory.joint_names
    if len(names) != _UR_JOINTS:
        found = f"a motion of {len(names)} joints ({', '.join(names[:8])})"
        raise wrong_argument("Run.export", "format", found, "of urscript: one of the six joints of the arm")
    Q, cycle = trajectory(t), trajectory.duration / (len(t) - 1)
    start, events = _row(Q[0]), _events(trajectory)
    servos = []
    for before, after, q in zip(t[:-1], t[1:], Q[1:], strict=True):
        servos += [f"  # at {at:.3f} s: {words}" for at, words in events if before <= at < after]
        servos.append(f"  servoj({_row(q)}, t={cycle:.6g}, lookahead_time=0.03, gain=500)")
    servos += [f"  # at {at:.3f} s: {words}" for at, words in events if at >= t[-1]]
    lines = [
        f"# {trajectory.duration:.3f} s, {len(Q)} samples at {1.0 / cycle:g} Hz, rad; joints: {', '.join(names)}",
        "def optiplan_motion():",
        "  local here = get_actual_joint_positions()",
        f"  local start = {start}",
        "  local joint = 0",
        f"  while joint < {_UR_JOINTS}:",
        f"    if norm(here[joint] - start[joint]) > {_START_TOLERANCE}:",
        '      popup("The arm is not at the start of the motion.", title="OptiPlan", error=True, blocking=True)',
        "      halt",
        "    end",
        "    joint = joint + 1",
        "  end",
        *servos,
        "  stopj(2.0)",
        "end",
        "optiplan_motion()",
    ]
    return ("\n".join(lines) + "\n").encode()


def _events(trajectory: Trajectory) -> list[tuple[float, str]]:
    """Return when what is held changes or a gripper moves, s, and what it is, in one line."""
    return [(one.begin, f"step {one.step}, {one.name}") for one in trajectory.segments if one.kind in EVENTS]


def _row(q: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    return "[" + ", ".join(f"{x:.7f}" for x in q) + "]"


def _duration(t: float) -> dict[str, int]:
    whole, rest = divmod(round(t * _NANO), _NANO)
    return {"sec": whole, "nanosec": rest}
