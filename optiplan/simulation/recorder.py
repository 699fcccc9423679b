"""Records the steps of a loop: errors of every step, arrays of some."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.simulation.contacts import ContactWatch
from optiplan.simulation.controllers.base import Command, JointTarget
from optiplan.simulation.log import MOST_SAMPLES, Log, Tracking
from optiplan.simulation.plants.base import Input
from optiplan.simulation.references.base import ToolTarget

_FULL = 1.0 - 1e-9  # share of a torque limit at which a drive counts as saturated


class Recorder:
    """Gathers a block of steps, judges it whole, and keeps every k-th step for the log."""

    def __init__(self, robot: Robot, limits: Limits, steps: int, dt: float, input: Input) -> None:
        self._robot, self._limits, self._dt, self._input = robot, limits, dt, input
        self._every = -(-(steps + 1) // MOST_SAMPLES)
        self._poses = ToolPoses(robot)
        self._count = 0
        self._squares, self._peak = np.zeros(robot.n), np.zeros(robot.n)
        self._tool_squares, self._tool_peak = np.zeros(2), np.zeros(2)
        self._saturated = np.zeros(robot.n)
        self._beyond = np.zeros((2, robot.n))
        self._kept: list[dict[str, Array]] = []
        self._slack: dict[str, dict[int, float]] = {}
        self._active: dict[str, int] = {}
        self._seconds: list[float] = []
        self._begin()

    def _begin(self) -> None:
        self._rows: list[tuple[Array, Array, Array, Array]] = []
        self._targets: list[ToolTarget] = []

    def add(self, q: Array, v: Array, command: Command, applied: Array, target: JointTarget | ToolTarget) -> None:
        """Take one step: true q and v (n,), what was commanded and applied, what was wanted."""
        self._rows.append((q, v, command.q, applied))
        if isinstance(target, ToolTarget):
            self._targets.append(target)
        step = command.step
        if step is not None:
            index = self._count + len(self._rows) - 1
            self._seconds.append(step.seconds)
            for name, value in step.slack.items():
                self._slack.setdefault(name, {})[index] = value
            for name in step.active:
                self._active[name] = self._active.get(name, 0) + 1

    def end_block(self, t: Array, watch: ContactWatch | None) -> None:
        """Judge the steps taken since the last block, at times t (K,), s, of which the first were taken."""
        if not self._rows:
            return
        q, v, wanted, applied = (np.array(column) for column in zip(*self._rows, strict=True))
        t = t[: len(q)]
        error = wanted - q
        self._squares += (error**2).sum(axis=0)
        self._peak = np.maximum(self._peak, np.abs(error).max(axis=0))
        there = self._poses.of(wanted)
        if self._targets:
            there = homogeneous([target.X_WF for target in self._targets])
        tool = pose_errors(there, self._poses.of(q))
        self._tool_squares += (tool**2).sum(axis=0)
        self._tool_peak = np.maximum(self._tool_peak, tool.max(axis=0))
        if self._input == "torque":
            self._saturated += (np.abs(applied) >= _FULL * self._limits.torque).sum(axis=0)
        limits = self._limits
        outside = np.maximum(limits.lower - q, q - limits.upper), np.abs(v) - limits.velocity
        self._beyond = np.maximum(self._beyond, [part.max(axis=0) for part in outside])
        if watch is not None:
            watch.look(t, q)
        rows = np.arange(-self._count % self._every, len(t), self._every)
        columns = {"t": t, "q": q, "v": v, "wanted": wanted, "applied": applied, "tool_error": tool}
        self._kept.append({name: values[rows] for name, values in columns.items()})
        self._count += len(t)
        self._begin()

    def log(self, statuses: Mapping[str, int], watch: ContactWatch | None, stopped: str = "") -> Log:
        """The log of everything that was taken."""
        arrays = {name: np.concatenate([block[name] for block in self._kept]) for name in self._kept[0]}
        steps = np.arange(0, self._count, self._every)
        slack = {name: np.array([found.get(k, 0.0) for k in steps.tolist()]) for name, found in self._slack.items()}
        count = self._count
        (tool_rms, turn_rms), (tool_peak, turn_peak) = np.sqrt(self._tool_squares / count), self._tool_peak
        tracking = Tracking(
            rms=np.sqrt(self._squares / count),
            peak=self._peak,
            tool_rms=float(tool_rms),
            tool_peak=float(tool_peak),
            turn_rms=float(turn_rms),
            turn_peak=float(turn_peak),
            saturated=self._saturated / count,
            beyond_position=self._beyond[0],
            beyond_velocity=self._beyond[1],
        )
        return Log(
            joint_names=self._robot.joint_names,
            dt=self._dt,
            **arrays,
            input=self._input,
            tracking=tracking,
            contacts=None if watch is None else watch.result(),
            slack=slack,
            active={name: found / count for name, found in sorted(self._active.items())},
            statuses=dict(statuses),
            solve_seconds=np.array(self._seconds)[:: self._every],
            stopped=stopped,
        )


class ToolPoses:
    """Poses of a frame of a robot at many configurations."""

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        index = robot.frame_id(frame or robot.tool_frame)
        placed = robot.model.frames[index]
        self._joint, self._placement = int(placed.parentJoint), np.array(placed.placement.homogeneous)
        self._kinematics = robot.kinematics

    def of(self, Q: Array) -> Array:
        """X_WF at configurations Q (K, n): (K, 4, 4)."""
        return np.asarray(self._kinematics.poses(Q)[:, self._joint] @ self._placement)


def pose_errors(wanted: Array, actual: Array) -> Array:
    """Distance, m, and angle, rad, between poses (K, 4, 4) and (K, 4, 4): (K, 2).

    The angle is 2 asin(|R - R'|_F / sqrt 8), exact for small angles as well, where the arc cosine of the trace is not.
    """
    distance = np.linalg.norm(wanted[:, :3, 3] - actual[:, :3, 3], axis=1)
    chord = np.linalg.norm(wanted[:, :3, :3] - actual[:, :3, :3], axis=(1, 2))
    return np.column_stack([distance, 2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))])


def homogeneous(poses: list[pin.SE3]) -> Array:
    """Poses as an array (K, 4, 4)."""
    return np.array([X.homogeneous for X in poses]).reshape(-1, 4, 4)
