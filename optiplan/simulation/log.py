"""`Log`: what happened in a closed loop, as arrays over time, and what it comes to."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.simulation.plants.base import Input
from optiplan.trajectory.trajectory import Trajectory

LOG = "log.npz"
"""The file of its arrays, beside `run.json`."""

MOST_SAMPLES = 60_000
"""Rows of a log; a longer loop is logged more thinly, its largest and mean errors are still of every step."""

MOST_PIECES = 6000
"""Pieces of the executed motion, which is for looking at; the log has the samples."""


@dataclass(frozen=True, eq=False)
class Tracking:
    """Errors over every control step.

    Attributes:
        rms: (n,), rad or m, of the joints; `peak`: (n,) largest.
        tool_rms: m, of the tool's position; `tool_peak`: m; `turn_rms`, `turn_peak`: rad, of its orientation.
        saturated: (n,) share of the steps in which the drive was at its limit.
        beyond_position: rad or m, farthest beyond a position limit, (n,), 0 where never; `beyond_velocity`: (n,).
    """

    rms: Array
    peak: Array
    tool_rms: float
    tool_peak: float
    turn_rms: float
    turn_peak: float
    saturated: Array
    beyond_position: Array
    beyond_velocity: Array

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready form."""
        return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in vars(self).items()}


@dataclass(frozen=True, eq=False)
class ContactLog:
    """Distances along the executed motion, measured every `interval` s.

    Attributes:
        interval: s.
        least: m, the least distance of any pair, at most `window`, which is as far as was looked; negative is the
            depth of penetration; None without pairs.
        window: m.
        pair: the two bodies of `least`, where one was nearer than `window`; `time`: s of it.
        touched: pairs of bodies that touched, with the first time, s; an engine's own contacts among them.
    """

    interval: float
    least: float | None
    window: float
    pair: tuple[str, str] | None
    time: float | None
    touched: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready form."""
        touched = [{"pair": list(pair), "time": time} for pair, time in self.touched.items()]
        return {**vars(self), "pair": None if self.pair is None else list(self.pair), "touched": touched}


@dataclass(frozen=True, eq=False)
class ObjectLog:
    """What became of an object of a task.

    Attributes:
        poses: (K, 7), position, m, and quaternion x, y, z, w, in the world, at the times of the log.
        offset: (3,) m, from where the plan has it at the end to where it is.
        error: m, its length; `turn`: rad, of the orientation.
        slip: m, farthest that it moved in a link while that held it.
    """

    poses: Array
    offset: Array
    error: float
    turn: float
    slip: float

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready form, without the poses."""
        return {"offset": self.offset.tolist(), "error": self.error, "turn": self.turn, "slip": self.slip}


@dataclass(frozen=True)
class WheelLog:
    """What the wheels of a base did.

    Attributes:
        drift: m, from where their rates say that the base is at the end to where it is; `turn_drift`: rad.
        travel: m, on which it drifted.
        lift: m, farthest that the base went up or down on its rollers.
    """

    drift: float
    turn_drift: float
    travel: float
    lift: float


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A closed loop that was run.

    Attributes:
        joint_names: of the n joints.
        dt: the control period, s.
        t: (K,), s.
        q: (K, n) true positions, rad or m; `v`: (K, n).
        wanted: (K, n) positions that were wanted.
        applied: (K, n) input of the plant after saturation, as `input` says.
        input: what the plant takes: `torque`, N·m or N, or `velocity`, rad/s or m/s.
        tool_error: (K, 2), m and rad, of the tool, or of the frame that has a reference.
        tracking: the errors over every step.
        contacts: distances; None where they were not measured.
        slack: by limit, (K,) in its own unit, of a task-space controller; empty for others.
        active: by limit, share of the steps in which it held the command back.
        statuses: how many steps the controller had each status.
        solve_seconds: (K,) time of the controller's steps, s; empty for controllers of the joints.
        stopped: why the loop ended early, or what did not hold at its end; empty otherwise.
        objects: of a task, by name.
        slip_margin: least share of the friction of grips that was left; negative where more was needed than there is;
            None without such grips.
        wheels: of a base that drives on wheels; else None.
        report: of an execution, the rows of a report: see `optiplan.simulation.execution_report`.
    """

    joint_names: tuple[str, ...]
    dt: float
    t: Array
    q: Array
    v: Array
    wanted: Array
    applied: Array
    input: Input
    tool_error: Array
    tracking: Tracking
    contacts: ContactLog | None = None
    slack: Mapping[str, Array] = field(default_factory=dict)
    active: Mapping[str, float] = field(default_factory=dict)
    statuses: Mapping[str, int] = field(default_factory=dict)
    solve_seconds: Array = field(default_factory=lambda: np.empty(0))
    stopped: str = ""
    objects: Mapping[str, ObjectLog] = field(default_factory=dict)
    slip_margin: float | None = None
    wheels: WheelLog | None = None
    report: Mapping[str, Any] = field(default_factory=dict)

    @property
    def trajectory(self) -> Trajectory:
        """The executed motion: cubic pieces through the logged positions and velocities, `MOST_PIECES` at most."""
        from scipy.interpolate import CubicHermiteSpline  # takes a third of a second, and most processes read no motion

        rows = np.unique(np.r_[0 : len(self.t) : -(-len(self.t) // MOST_PIECES), len(self.t) - 1])
        spline = CubicHermiteSpline(self.t[rows] - self.t[0], self.q[rows], self.v[rows])
        return Trajectory(self.joint_names, spline.x, np.swapaxes(spline.c[::-1], 0, 1))

    @property
    def touched(self) -> bool:
        """Whether any two bodies did."""
        return self.contacts is not None and bool(self.contacts.touched)

    @property
    def error(self) -> Array:
        """Wanted less true positions, (K, n), rad or m."""
        return np.asarray(self.wanted - self.q)

    def summary(self) -> dict[str, Any]:
        """JSON-ready: everything but the arrays over time."""
        return {
            "duration": float(self.t[-1]),
            "dt": self.dt,
            "joint_names": list(self.joint_names),
            "tracking": self.tracking.to_dict(),
            "contacts": None if self.contacts is None else self.contacts.to_dict(),
            "active": dict(self.active),
            "slack": {name: float(np.max(values, initial=0.0)) for name, values in self.slack.items()},
            "statuses": dict(self.statuses),
            "step_ms": _percentiles(self.solve_seconds),
            "stopped": self.stopped,
            "objects": {name: found.to_dict() for name, found in self.objects.items()},
            "slip_margin": self.slip_margin,
            "wheels": self.wheels and vars(self.wheels),
        }

    def __repr__(self) -> str:
        """Length, errors, contact and why it ended early in one line."""
        tool = f"tool error {1e3 * self.tracking.tool_rms:.3g} mm RMS, {1e3 * self.tracking.tool_peak:.3g} mm at most"
        touching = "" if self.contacts is None else "; contact" if self.touched else "; no contact"
        errors = [found.error for found in self.objects.values()]
        objects = f"; objects end within {1e3 * max(errors):.3g} mm of the plan" if errors else ""
        ended = f"; {self.stopped}" if self.stopped else ""
        return f"Log: {self.t[-1]:.3f} s, {tool}{touching}{objects}{ended}"


def npz_of(log: Log) -> bytes:
    """Return the arrays as a file: t, q, v, wanted, applied, tool_error; `slack <limit>`; joint_names."""
    arrays: dict[str, Any] = {"joint_names": np.array(log.joint_names)}
    arrays |= {name: getattr(log, name) for name in ("t", "q", "v", "wanted", "applied", "tool_error")}
    arrays |= {f"slack {name}": values for name, values in log.slack.items()}
    if len(log.solve_seconds):
        arrays["step_seconds"] = log.solve_seconds
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _percentiles(seconds: Array) -> dict[str, float] | None:
    if not len(seconds):
        return None
    names: Sequence[tuple[str, float]] = (("median", 50.0), ("p99", 99.0), ("max", 100.0))
    return {name: float(1e3 * np.percentile(seconds, p)) for name, p in names}
