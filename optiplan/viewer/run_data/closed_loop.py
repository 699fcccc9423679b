"""Curves that only an executed motion has: errors of joints and tool, what was applied, limits that were given up."""

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array, finite_or_none
from optiplan.errors import InputError, Issue
from optiplan.files import folder_of
from optiplan.problem.problem import Problem
from optiplan.robot.limits import joint_units, thousandths
from optiplan.viewer.run_data.curves import short_names
from optiplan.viewer.surfaces import base64_of

LOG = "log.npz"
NEEDED = ("t", "q", "wanted", "applied", "tool_error")
_SLACK = "slack "

Arrays = Mapping[str, Array]


def read_log(folder: Path) -> Arrays | None:
    """Arrays of the log beside a `run.json`; None where there is no log.

    Raises:
        InputError: a log that cannot be read.
    """
    file = folder_of(folder) / LOG
    if not file.is_file():
        return None
    try:
        with np.load(file, allow_pickle=False) as stored:
            arrays = {name: np.asarray(stored[name], float) for name in stored.files if name != "joint_names"}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError([Issue(str(file), None, "file", str(error), "the log of `optiplan control`")]) from None
    rows = arrays.get("t", np.empty(0)).shape
    for name in {**dict.fromkeys(NEEDED), **arrays}:
        values = arrays.get(name, np.empty(0))
        fits, wrong = values.size > 0 and values.shape[:1] == rows, np.argwhere(~np.isfinite(values))
        if not fits or len(wrong):
            found = f"{values[tuple(wrong[0])]} in row {wrong[0][0]}" if fits else "nothing that fits"
            raise InputError([Issue(str(file), None, name, found, "finite numbers, a row for each of `t`")])
    return arrays


def log_quantities(problem: Problem, log: Arrays, most: int) -> list[dict[str, Any]]:
    """JSON-ready quantities, see `curves.curves_of`, each with its own times `t`, s, `most` of them."""
    robot, times = problem.robot, log["t"]
    names = short_names(robot.joint_names)
    unit = thousandths(robot.revolute)
    found = [
        _quantity("tracking error", unit, names, 1e3 * (log["wanted"] - log["q"]), "joints"),
        _quantity("tool error", "mm, mrad", ["position", "orientation"], 1e3 * log["tool_error"], "tools"),
    ]
    torque = problem.limits.torque
    if np.abs(log["applied"]).max(initial=0.0) > 0.0:
        applied = _quantity("applied", joint_units("torque", robot.revolute), names, log["applied"], "joints")
        limit = list(map(finite_or_none, torque))
        found.append(applied | {"low": [None if x is None else -x for x in limit], "high": limit})
    slack = {name.removeprefix(_SLACK): y for name, y in log.items() if name.startswith(_SLACK)}
    if slack:
        found.append(
            _quantity("slack", "of the limit's unit", list(slack), np.column_stack(list(slack.values())), "limits")
        )
    rows = np.unique(np.r_[0 : len(times) : max(1, len(times) // most), len(times) - 1])
    for one in found:
        y = one["y"]
        peaks = [int(np.argmax(np.abs(column))) for column in y.T]
        one["extrema"] = [[[float(times[k]), float(y[k, j])]] for j, k in enumerate(peaks)]
        one["y"], one["t"] = base64_of(y[rows]), base64_of(times[rows])
    return found


def _quantity(name: str, unit: str, names: list[str], values: Array, of: str) -> dict[str, Any]:
    free = [None] * len(names)
    return {
        "name": name,
        "unit": unit,
        "series": names,
        "y": values,
        "low": free,
        "high": free,
        "of": of,
        "kind": "logged",
    }
