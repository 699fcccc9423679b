"""Export motions for other programs."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from optiplan.arrays import is_finite
from optiplan.errors import described, wrong_argument
from optiplan.files import write_bytes
from optiplan.trajectory.trajectory import Trajectory


def _csv(trajectory: Trajectory, rate: float) -> bytes:
    """Columns t, q_JOINT, v_JOINT, a_JOINT; s, rad or m."""
    samples = trajectory.to_dict(rate)
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *(f"{kind}_{name}" for kind in "qva" for name in trajectory.joint_names)])
    for row in zip(samples["t"], samples["q"], samples["v"], samples["a"], strict=True):
        writer.writerow([row[0], *row[1], *row[2], *row[3]])
    return text.getvalue().encode()


def _json(trajectory: Trajectory, rate: float) -> bytes:
    """The polynomials, which are the motion, and samples: what `trajectory.json` of a run folder holds."""
    return json.dumps(trajectory.to_dict(rate), allow_nan=False).encode() + b"\n"


def _npz(trajectory: Trajectory, rate: float) -> bytes:
    """Arrays `joint_names`, `t` (k,), `q`, `v`, `a` (k, n), `breakpoints`, `coefficients`."""
    samples = trajectory.to_dict(rate)
    arrays = {key: np.array(samples[key]) for key in ("joint_names", "t", "q", "v", "a")}
    file = io.BytesIO()
    arrays |= {"breakpoints": trajectory.breakpoints, "coefficients": trajectory.coefficients}
    np.savez(file, **arrays)  # type: ignore[arg-type]  # the stub takes the names of arrays for options
    return file.getvalue()


FORMATS: dict[str, Callable[[Trajectory, float], bytes]] = {"csv": _csv, "json": _json, "npz": _npz}
"""Content of a file by the name of its format, from a motion and samples a second, Hz."""


def export(trajectory: Trajectory, path: Path, format: str | None, rate: float) -> None:
    """Write a motion; the file is there whole or not at all.

    Args:
        trajectory: the motion.
        path: the file; folders that are missing are made.
        format: a name of `FORMATS`; None: by the file's suffix.
        rate: samples a second, Hz.

    Raises:
        InputError: there is no such format, or the file cannot be written.
    """
    name = path.suffix.lower().removeprefix(".") if format is None else format
    if not isinstance(name, str) or name not in FORMATS:
        found = repr(format) if isinstance(format, str) else described(format)
        if format is None:
            found = f"{str(path)!r}, whose ending names none"
        raise wrong_argument("Run.export", "format", found, f"one of: {', '.join(FORMATS)}")
    if not is_finite(rate) or not 0.0 < rate <= 1e6:
        raise wrong_argument("Run.export", "rate", described(rate), "a number of samples a second in (0, 1e6]")
    try:
        write_bytes(path, FORMATS[name](trajectory, float(rate)))
    except OSError as error:
        found = f"{str(path)!r} ({(error.strerror or str(error)).lower()})"
        raise wrong_argument("Run.export", "path", found, "a file that can be written") from None
