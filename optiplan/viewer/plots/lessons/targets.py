"""Four targets: accurate or not, repeatable or not, with accuracy and repeatability as ISO 9283 defines them."""

from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.figure_style import COLOURS, INK, LIMIT, sheet
from optiplan.workspace.accuracy import pose_accuracy, repeatability

CYCLES = 30
"""Points reached of a pose, as in ISO 9283."""
RINGS = (0.25, 0.5, 0.75, 1.0)
"""mm."""

_OFFSET = np.array([0.42, 0.3, 0.0])  # mm: of the mean from the middle
_SMALL, _LARGE = 0.06, 0.24  # mm: standard deviation of a coordinate
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))  # rad
TARGETS = {
    "accurate and repeatable": (0.0, _SMALL),
    "repeatable, not accurate": (1.0, _SMALL),
    "accurate on average, not repeatable": (0.0, _LARGE),
    "neither": (1.0, _LARGE),
}
"""Share of the offset, and spread in mm."""


def shots(share: float, spread: float) -> Array:
    """Points (30, 3), mm, in the plane z = 0, spread evenly in probability over a normal distribution about its mean.

    Radii are quantiles of Rayleigh's distribution, directions turn by the golden angle: no seed, and no point twice.
    """
    k = np.arange(CYCLES)
    radius = spread * np.sqrt(-2.0 * np.log(1.0 - (k + 0.5) / CYCLES))
    points = np.stack([radius * np.cos(k * _GOLDEN), radius * np.sin(k * _GOLDEN), np.zeros(CYCLES)], axis=1)
    return np.asarray(points - points.mean(axis=0) + share * _OFFSET)


def draw_targets() -> Any:
    """The figure: points reached, their mean (cross), and the circle of repeatability RP about it; AP is the line."""
    figure = sheet(7.4, width=7.2)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for panel, (title, (share, spread)) in zip(panels.flat, TARGETS.items(), strict=True):
        points = shots(share, spread)
        mean, RP = points.mean(axis=0), repeatability(points)
        AP = pose_accuracy(points, np.zeros(3))
        for radius in RINGS:
            panel.add_patch(_circle((0.0, 0.0), radius, edgecolor=INK, linewidth=0.7))
        panel.plot(*points[:, :2].T, "o", color=COLOURS[0], markersize=3.5, linestyle="", gid="shots")
        panel.add_patch(_circle(mean[:2], RP, edgecolor=LIMIT, linestyle="--", linewidth=1.2))
        panel.plot([0.0, mean[0]], [0.0, mean[1]], color=COLOURS[1], linewidth=1.6)
        panel.plot(*mean[:2], "x", color=COLOURS[1], markersize=8, markeredgewidth=2.0)
        panel.set_title(f"{title}\nAP {AP:.2f} mm, RP {RP:.2f} mm")
        panel.set(xlim=(-1.35, 1.35), ylim=(-1.35, 1.35), aspect="equal")
    for panel in panels[-1]:
        panel.set_xlabel("x, mm")
    for panel in panels[:, 0]:
        panel.set_ylabel("y, mm")
    figure.suptitle(
        f"Accuracy AP: from the target to the mean (line); repeatability RP = l + 3 S (dashed); {CYCLES} cycles",
        fontsize=9,
    )
    return figure


def _circle(centre: Any, radius: float, **style: Any) -> Any:
    from matplotlib.patches import Circle

    return Circle(tuple(centre), radius, fill=False, **style)
