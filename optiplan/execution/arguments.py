"""What is handed to an executor while the robot moves, checked without raising, whatever it is."""

import warnings
from typing import Any

import numpy as np

from optiplan.arrays import Array, is_finite, number_argument
from optiplan.errors import described, wrong_argument
from optiplan.runs.run import Run
from optiplan.trajectory.state import State

SAME_STATE = 1e-8
"""rad or m, and the same per s and s²: how far apart two states may be where one motion takes over."""

LONGEST_TICK = 0.1
"""s: after a longer one the robot had no set-points for too long, and stops."""

LONGEST_COAST = 1e6
"""s: beyond it the time of a law has no digits left for ticks of a millisecond."""

ROUNDED = 1e-9
"""s by which the longest tick may be longer: the difference of two times of a loop at 10 Hz."""


def coasted(duration: Any) -> float:
    """Return a time to coast, s.

    Raises:
        InputError: it is no number from 0 to `LONGEST_COAST`.
    """
    expected = f"seconds >= 0 and <= {LONGEST_COAST:g}"
    return number_argument("Executor.coast", "duration", duration, expected, 0.0, most=LONGEST_COAST)


def is_share(value: Any) -> bool:
    """Whether a value is a number from 0 to 1."""
    return is_finite(value) and bool(0.0 <= value <= 1.0)


def numbers(values: Any) -> Array:
    """Return values as an array; an empty one where they are no real numbers."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of complex numbers
            return np.asarray(values, dtype=float)
    except Exception:  # an object may raise anything when it is asked for its numbers
        return np.empty(0)


def same_state(a: State, b: State) -> bool:
    """Whether two states are one, but for rounding."""
    return all(np.allclose(x, y, rtol=0.0, atol=SAME_STATE) for x, y in ((a.q, b.q), (a.v, b.v), (a.a, b.a)))


def checked_arguments(run: Any, override: Any, deviation: Any, clearance: Any) -> None:
    """Refuse arguments of `Executor` that do not fit.

    Raises:
        InputError: the first one.
    """
    if not isinstance(run, Run):
        raise wrong_argument("Executor", "run", described(run), "a verified run of op.plan(…)")
    if not is_share(override):
        raise wrong_argument("Executor", "override", described(override), "a speed from 0 to 1")
    if deviation is not None:
        number_argument("Executor", "deviation", deviation, "a distance > 0, rad or m, or None", above=0.0)
    number_argument("Executor", "clearance", clearance, "a distance >= 0, m", 0.0)


def checked_step(dt: Any) -> tuple[float, str]:
    """Return the length of a tick, s; where it cannot be, 0 or the longest, and why the robot must stop."""
    if not is_finite(dt) or dt < 0.0:
        return 0.0, f"tick: found a step of {described(dt)}; expected seconds >= 0"
    if dt > LONGEST_TICK + ROUNDED:
        return LONGEST_TICK, f"tick: found a step of {dt:.3f} s; expected at most {LONGEST_TICK} s"
    return float(dt), ""


def stop_words(reason: Any, how: Any) -> tuple[str, bool]:
    """Return the reason of a stop in words, whatever it is, and whether the joints are to stop off the path."""
    if not isinstance(how, str) or how not in ("path", "joints"):
        return f"stop: found {described(how)}; expected 'path' or 'joints'", False
    return reason if isinstance(reason, str) else described(reason), how == "joints"
