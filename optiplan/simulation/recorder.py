"""Records the steps of a loop: errors of every step, arrays of some."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.frames import frame_poses, pose_errors
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.simulation.contacts import ContactWatch
from optiplan.simulation.controllers.base import Command, JointTarget
from optiplan.simulation.log import MOST_SAMPLES, Log, Tracking
from optiplan.simulation.plants.base import Input
from optiplan.simulation.references.base import ToolTarget

_FULL = 1.0 - 1e-9  # share of a torque limit at which a drive counts as saturated


class Recorder:
    """Gathers a block of steps, judges it whole, and keeps every k-th step for the log.

    The error of the tool is that of `frame`; None: the robot's tool frame.
    """

    def __init__(
        self, robot: Robot, limits: Limits, steps: int, dt: float, input: Input, frame: str | None = None
    ) -> None:
        self._robot, self._limits, self._dt, self._input = robot, limits, dt, input
        self._frame = robot.tool_frame if frame is None else frame
        self._every = -(-(steps + 1) // MOST_SAMPLES)
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
        there = np.array([target.X_WF.homogeneous for target in self._targets])
        if not self._targets:
            there = frame_poses(self._robot, wanted, self._frame)
        tool = pose_errors(frame_poses(self._robot, q, self._frame), there)
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
        arrays: dict[str, Any] = {name: np.concatenate([block[name] for block in self._kept]) for name in self._kept[0]}
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
