"""Poses drawn from a goal region, evenly: where a line may end in it."""

import numpy as np

from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.regions.region import RegionGoal

PLACES = 48
"""Poses in a region that a line may end at."""

_STEPS = 1.0 / 1.1347241384 ** np.arange(1, 7)
"""Steps of the additive sequence in six dimensions; 1.1347 solves x^7 = x + 1.

Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018; it fills a box evenly.
"""

_SHARE = 0.9
"""Share of each width in which they lie; the rest is for the tolerance of the poses."""

_SHIFT, _TURN = 0.03, 0.02
"""Shares of the least width, m, by which the tolerances of position and rotation may move what the region bounds."""


def unbounded(region: RegionGoal) -> str:
    """Return the axes along which a region has no bound, from which no even poses can be drawn; empty for none."""
    free = [not (np.isfinite(region.low[k]) and np.isfinite(region.high[k])) for k in range(3)]
    return " and ".join(f"along {axis}" for axis, endless in zip("xyz", free, strict=True) if endless)


def places(region: RegionGoal, count: int = PLACES) -> list[PoseGoal]:
    """Return poses of a region that is bounded along its axes, its middle first; free rotations take whole turns."""
    bounded = np.isfinite(region.low) & np.isfinite(region.high)
    low, high = np.where(bounded, region.low, -np.pi), np.where(bounded, region.high, np.pi)
    width = high - low
    middle, half = 0.5 * (low + high), 0.5 * np.where(bounded, _SHARE, 1.0) * width
    position = float(min(1e-4, _SHIFT * np.min(width[:3])))
    arm = float(np.linalg.norm(region.X_RF.translation)) + 1e-12
    orientation = float(min(1e-3, 0.05 * np.min(width[3:]), _TURN * np.min(width[:3]) / arm))
    shares = 2.0 * np.mod(0.5 + np.arange(count)[:, None] * _STEPS, 1.0) - 1.0
    return [PoseGoal(region.frame, region.pose(middle + half * share), position, orientation) for share in shares]
