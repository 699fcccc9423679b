"""Show a path that was refused before it was timed, as a motion at a constant rate."""

from collections.abc import Sequence
from typing import Any

from optiplan.robot.limits import Limits
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.timing.time_scaling import speed_ratio
from optiplan.trajectory.trajectory import Trajectory

_LONGEST = 60.0  # s; a path takes longer only where its rates grow without bound, at a singularity
_MOST_PIECES = 400  # of a path: the record of a failure stays below a megabyte


def refused_path(sections: Sequence[Trajectory], section: int, s: float, limits: Limits) -> dict[str, Any]:
    """Return entries of a `Failure.witness`: the path as a `motion`, and its time `t` at the refused place.

    Each section q(s) runs at the constant rate ds/dt that just meets its tightest limit of velocity, acceleration or
    jerk between its ends. It does not rest at its ends, since it has no time law. Its shape is exactly the path's.

    Args:
        sections: of the path, each beginning where the one before ends; s from 0 up.
        section: number of the one that is refused.
        s: where, in that section's parameter.
        limits: of the n joints.

    Returns:
        `motion`, as `Trajectory.to_dict`, `t`, s, and `untimed`, True. Nothing where the path stands still, has more
        than 400 pieces or would take more than a minute.
    """
    ratios = [speed_ratio(path, limits) for path in sections]
    lengths = [path.duration * ratio for path, ratio in zip(sections, ratios, strict=True)]
    pieces = sum(len(path.coefficients) for path in sections)
    if min(ratios) <= 0.0 or not sum(lengths) <= _LONGEST or pieces > _MOST_PIECES:
        return {}
    motions = [path.scaled(length) for path, length in zip(sections, lengths, strict=True)]
    t = sum(lengths[:section]) + s * ratios[section]
    return {"motion": join_trajectories(motions).to_dict(), "t": float(t), "untimed": True}
