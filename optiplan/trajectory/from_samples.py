"""A motion from samples; the interpolation between them is part of the proof, so it is stated."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import described
from optiplan.trajectory.paths.hermite import hermite_trajectory
from optiplan.trajectory.paths.via_splines import smooth_spline, spline_of_velocities
from optiplan.trajectory.trajectory import Trajectory

_POSITIONS = (
    "cubic spline through the positions, acceleration continuous, at rest at both ends "
    "(one more knot in the middle of the first and of the last interval)"
)
_VELOCITIES = (
    "quintic spline through positions and velocities, acceleration and jerk continuous, no acceleration at both ends"
)
_ACCELERATIONS = "quintic polynomials between samples of position, velocity and acceleration"


def interpolation(v: Array | None, a: Array | None) -> str:
    """Name the interpolation that `from_samples` makes of samples with these derivatives."""
    if v is None:
        return _POSITIONS
    return _VELOCITIES if a is None else _ACCELERATIONS


def from_samples(
    joint_names: Sequence[str], t: Array, q: Array, v: Array | None = None, a: Array | None = None
) -> Trajectory:
    """Interpolate samples as `interpolation` says; every sample is passed exactly, and time starts at the first.

    At 200 Hz, positions alone restore a motion at its limits with an error of a few parts in a thousand. Positions,
    velocities and accelerations at the breakpoints of a piecewise quintic restore it to the last digits.

    Args:
        joint_names: of the n joints.
        t: (k,) increasing, s; two or more.
        q: (k, n) positions, rad or m.
        v: (k, n) velocities, rad/s or m/s.
        a: (k, n) accelerations, rad/s² or m/s²; only together with v.

    Raises:
        ValueError: if shapes do not fit each other, a number is not finite, times do not increase, or there are
            accelerations without velocities.
    """
    if not isinstance(joint_names, Sequence):
        raise ValueError(f"joint_names: found {described(joint_names)}; expected names of the joints")
    names = tuple(joint_names)
    if a is not None and v is None:
        raise ValueError("a: found accelerations without velocities; expected both, velocities or neither")
    t = _numbers("t", t)
    if t.ndim != 1 or len(t) < 2:
        raise ValueError(f"t: found shape {t.shape}; expected two times or more")
    if not (np.isfinite(t).all() and (np.diff(t) > 0.0).all()):
        raise ValueError("t: found times that are not finite or do not increase; expected increasing times, s")
    given = {key: _numbers(key, x) for key, x in (("q", q), ("v", v), ("a", a)) if x is not None}
    for key, samples in given.items():
        if samples.shape != (len(t), len(names)):
            expected = f"({len(t)}, {len(names)}) for {len(t)} times and {len(names)} joints"
            raise ValueError(f"{key}: found shape {samples.shape}; expected {expected}")
        if not np.isfinite(samples).all():
            raise ValueError(f"{key}: found {samples[~np.isfinite(samples)][0]}; expected finite numbers")
    if not names or len(set(names)) < len(names) or not "".join(map(str, names)).isprintable():
        expected = "one or more different names without control characters or unusual blanks"
        raise ValueError(f"joint_names: found {names!r:.120}; expected {expected}")
    try:
        with np.errstate(all="ignore"):
            return _through(names, t - t[0], **given)
    except ValueError:
        found = f"samples as near as {np.diff(t).min():.3g} s and values up to {np.abs(given['q']).max():.3g}"
        raise ValueError(f"t: found {found}; expected a motion whose derivatives are finite") from None


def _through(names: tuple[str, ...], t: Array, q: Array, v: Array | None = None, a: Array | None = None) -> Trajectory:
    """Interpolate samples whose shapes fit.

    Raises:
        ValueError: numbers overflow.
    """
    if v is None:
        return smooth_spline(q, t, 3, names)
    if a is None:
        return spline_of_velocities(q, t, v, 5, names)
    return hermite_trajectory(names, t, np.stack([q, v, a], axis=1))


def _numbers(key: str, values: Any) -> Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{key}: found {described(values)}; expected an array of numbers") from None
