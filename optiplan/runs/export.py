"""Export motions for other programs."""

import io
import json
from collections.abc import Callable, Mapping
from math import ceil
from pathlib import Path

import numpy as np

from optiplan.arrays import Array, number_argument
from optiplan.errors import described, writing, wrong_argument
from optiplan.files import csv_text, write_bytes
from optiplan.records import dataclass
from optiplan.runs.controller_formats import ros_json, ros_yaml, urscript
from optiplan.trajectory.fixed_rate import interpolation_errors, on_cycle
from optiplan.trajectory.tolerances import SAME_TIME
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report

MOST_SAMPLES = 200_000
"""In a file: six minutes at 500 Hz; a server makes them beside others."""


def _csv(trajectory: Trajectory, t: Array) -> bytes:
    """Columns t, q_JOINT, v_JOINT, a_JOINT; s, rad or m."""
    samples = trajectory.sampled(t)
    head = ["t", *(f"{kind}_{name}" for kind in "qva" for name in trajectory.joint_names)]
    rows = zip(samples["t"], samples["q"], samples["v"], samples["a"], strict=True)
    return csv_text(head, ([t, *q, *v, *a] for t, q, v, a in rows)).encode()


def _json(trajectory: Trajectory, t: Array) -> bytes:
    """The polynomials, which are the motion, and samples: what `trajectory.json` of a run folder holds."""
    return json.dumps(trajectory.to_dict() | trajectory.sampled(t), allow_nan=False).encode() + b"\n"


def _npz(trajectory: Trajectory, t: Array) -> bytes:
    """Arrays `joint_names`, `t` (k,), `q`, `v`, `a` (k, n), `breakpoints`, `coefficients`."""
    samples = trajectory.sampled(t)
    arrays = {"joint_names": np.array(trajectory.joint_names)} | {key: np.array(samples[key]) for key in "tqva"}
    file = io.BytesIO()
    arrays |= {"breakpoints": trajectory.breakpoints, "coefficients": trajectory.coefficients}
    np.savez(file, **arrays)  # type: ignore[arg-type]  # the stub takes the names of arrays for options
    return file.getvalue()


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Attributes:
        summary: what it is, for people.
        suffixes: endings of its files, the first for files that are named here.
        content: of a file, from a motion and the times (k,) of its samples, s.
        rate: Hz, of samples unless told otherwise.
        cyclic: whether its reader has a fixed cycle, so that the motion has to end on one.
    """

    summary: str
    suffixes: tuple[str, ...]
    content: Callable[[Trajectory, Array], bytes]
    rate: float = 200.0
    cyclic: bool = False


FORMATS = {
    "csv": Format("columns t, q_JOINT, v_JOINT, a_JOINT", (".csv",), _csv),
    "json": Format("polynomials and samples, as trajectory.json", (".json",), _json),
    "npz": Format("NumPy arrays", (".npz",), _npz),
    "ros": Format("a ROS 2 JointTrajectory message, as YAML, or as JSON by the ending", (".yaml", ".yml"), ros_yaml),
    "urscript": Format("a program for a Universal Robots arm", (".script",), urscript, 500.0, cyclic=True),
}
"""What a motion can be written as, by name."""


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        path: the file.
        duration: s, of the motion in it.
        samples: how many it has.
        errors: what a reader deviates from the motion that interpolates samples in one way or another, rad or m of the
            joint that deviates most: `linear`, `cubic`, `quintic`.
    """

    path: Path
    duration: float
    samples: int
    errors: Mapping[str, float]


def export_trajectory(
    trajectory: Trajectory,
    path: Path,
    format: str | None = None,
    rate: float | None = None,
    *,
    cyclic: bool = False,
    proof: Callable[[Trajectory], Report] | None = None,
) -> Exported:
    """Write a motion; the file is there whole or not at all.

    Args:
        trajectory: the motion.
        path: the file; folders that are missing are made.
        format: a name of `FORMATS`; None: by the file's suffix.
        rate: samples a second, Hz; None: the format's own, of which those of long motions get fewer: 60 000 in all,
            unless they are cyclic.
        cyclic: whether samples are exactly 1 / `rate` apart: the motion is slowed down by less than one cycle, so that
            it ends on one (`trajectory.fixed_rate.on_cycle`). Else there are at least so many samples a second.
        proof: verifies the motion that is slowed down, which is not written where that is refused: slower can mean
            more torque, where gravity is, and the time counts among what moves. None: it is written unproved.

    Raises:
        InputError: there is no such format, the robot does not fit it, there are too many samples, or the file cannot
            be written.
    """
    name = _named(path) if format is None else format
    if not isinstance(name, str) or name not in FORMATS:
        found = repr(format) if isinstance(format, str) else described(format)
        if format is None:
            found = f"{str(path)!r}, whose ending names none"
        raise wrong_argument("Run.export", "format", found, f"one of: {', '.join(FORMATS)}")
    kind = FORMATS[name]
    if rate is not None:
        number_argument("Run.export", "rate", rate, "a number of samples a second in (0, 1e6]", above=0.0, most=1e6)
    cyclic = cyclic or kind.cyclic
    motion = on_cycle(trajectory, float(rate or kind.rate)) if cyclic else trajectory
    if motion.duration != trajectory.duration and proof is not None:
        _refuse_unproved(proof(motion), trajectory, motion)
    t = motion.sample_times(kind.rate) if rate is None and not cyclic else _times(motion, float(rate or kind.rate))
    content = ros_json if name == "ros" and path.suffix.lower() == ".json" else kind.content
    with writing("Run.export", path):
        write_bytes(path, content(motion, t))
    errors = {key: float(error.max()) for key, error in interpolation_errors(motion, t).items()}
    return Exported(path, motion.duration, len(t), errors)


def _refuse_unproved(report: Report, given: Trajectory, slower: Trajectory) -> None:
    if not report.verified:
        refused = ", ".join(check.name for check in report.failures)
        times = f"{given.duration:.6g} to {slower.duration:.6g} s"
        found = f"a motion that is not verified when it is slowed down from {times} to end on a cycle ({refused})"
        raise wrong_argument("Run.export", "cyclic", found, "another rate, or samples that need not be a cycle apart")


def _times(motion: Trajectory, rate: float) -> Array:
    """Return equally spaced times (k,), s, 1 / `rate` apart or less; one that ends on a cycle has them exactly so.

    Raises:
        InputError: they are too many for a file.
    """
    count = ceil(motion.duration * rate * (1.0 - SAME_TIME))
    if count >= MOST_SAMPLES:
        found = f"{rate:g} a second for {motion.duration:.6g} s, {count + 1} samples"
        raise wrong_argument("Run.export", "rate", found, f"a rate at which there are at most {MOST_SAMPLES}")
    return np.linspace(0.0, motion.duration, max(1, count) + 1)


def _named(path: Path) -> str | None:
    """Return the format whose files end so."""
    return next((name for name, kind in FORMATS.items() if path.suffix.lower() in kind.suffixes), None)
