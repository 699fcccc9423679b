"""How a run was found, for the page: its improvements, and what every attempt of `trajopt` did in each iteration."""

from collections.abc import Mapping
from typing import Any

from optiplan.arrays import is_finite
from optiplan.planners.trajopt.program.iteration_log import COLUMNS

BEGUN_AT = {
    "straight": "straight line",
    "line": "straight line with a bump",
    "sampled": "sampled path",
    "relaxed": "path through thinner obstacles",
    "bump": "best curve with a bump",
    "close": "best curve, twice the spans, smaller margin",
    "finer": "best motion, twice the spans, smallest margin",
    "end": "best curve, end free in its goal",
    "warm": "earlier motion",
    "detour": "motion without the moving ends",
    "goal": "curve to another end of the goal",
    "direct": "profile from state to state",
    "in time": "motion among what stands still",
}
"""In words, the `seed` of an attempt."""


def found_by(record: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """`improvements`, [seconds, duration in s] each, and `attempts`; None where a record (`run.json`) tells of neither.

    An attempt has `begun_at` in words, `free`, `duration` (None: none), `iterations`, `ended`, `hindered` (the pair
    that it touches, or the constraint that it breaks; empty: neither) and `log`, columns of an `IterationLog`, or None.
    """
    record = record or {}
    told = (record.get("info") or {}).get("attempts")
    attempts = [_attempt(one) for one in told if isinstance(one, Mapping)] if isinstance(told, list | tuple) else []
    improvements = [[float(seconds), float(duration)] for seconds, duration in record.get("improvements") or ()]
    return {"improvements": improvements, "attempts": attempts} if improvements or attempts else None


def _attempt(told: Mapping[str, Any]) -> dict[str, Any]:
    seed, duration = str(told.get("seed", "")), told.get("duration")
    touches = told.get("touches")
    names = touches if isinstance(touches, list | tuple) else ()
    iterations = told.get("iterations")
    return {
        "begun_at": BEGUN_AT.get(seed, seed),
        "free": bool(told.get("free")),
        "duration": float(duration) if is_finite(duration) else None,
        "iterations": int(iterations) if is_finite(iterations) else 0,
        "ended": str(told.get("ended", "")),
        "hindered": " – ".join(str(name) for name in names) or str(told.get("breaks", "")),
        "log": _log(told.get("log")),
    }


def _log(told: Any) -> dict[str, list[float]] | None:
    """The columns, where there are any, of numbers and of one length."""
    if not isinstance(told, Mapping) or not all(isinstance(told.get(name), list) for name in COLUMNS):
        return None
    if not all(is_finite(value) for name in COLUMNS for value in told[name]):
        return None
    columns = {name: [float(value) for value in told[name]] for name in COLUMNS}
    return columns if {len(column) for column in columns.values()} == {len(columns["duration"]) or -1} else None
