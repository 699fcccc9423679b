"""Path constraints: what holds during the whole motion, or a part of it."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from optiplan.problem.constraints import motions, points, poses
from optiplan.problem.constraints.base import WHOLE, During, Statement

PathConstraint: TypeAlias = Statement
"""Any statement of `KINDS`."""

KINDS: dict[str, type[Statement]] = {
    kind.KEY: kind
    for room in (poses, points, motions)
    for kind in vars(room).values()
    if isinstance(kind, type) and issubclass(kind, Statement) and kind is not Statement
}
"""Classes of constraints by their key in a problem file."""


def constraint_of(key: str, data: Mapping[str, Any], frame: str) -> PathConstraint:
    """Return the constraint of a validated entry of a file.

    Args:
        key: one of `KINDS`.
        data: the entry, all values there.
        frame: of an entry that names none.
    """
    during: During = tuple(data["during"]) if data.get("during") is not None else WHOLE
    return KINDS[key].of(data, data.get("frame") or frame, during)


def constraint_data(one: PathConstraint) -> dict[str, Any]:
    """Return a constraint as a problem file says it: its key, and under that its values."""
    data = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in one.to_data().items()}
    frame = frame_of(one)
    if frame is not None:
        data["frame"] = frame
    if tuple(one.during) != WHOLE:
        data["during"] = list(one.during)
    return {one.KEY: data}


def frame_of(one: PathConstraint) -> str | None:
    """Return the frame that a constraint is about, if it is about one."""
    frame: str | None = getattr(one, "frame", None)
    return frame
