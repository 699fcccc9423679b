"""Joints against time: position, velocity, acceleration, jerk and torque, with their limits.

One run has all joints in one panel a quantity; several runs have a panel for each quantity and joint.
Dots are the exact extrema over all time; those of torques, rings, are refined samples.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.figure_style import LIMIT, WIDTH, line_style, sheet
from optiplan.robot.limits import ORDERS, joint_units
from optiplan.trajectory.trajectory import Extrema
from optiplan.viewer.plots.runs import PlottedRun

QUANTITIES = (*ORDERS, "torque")
LIMIT_LINE = "limit"
"""Mark of a line that is a limit."""
ROW, COLUMNS = 1.55, 7
"""Height of a panel, in; joints beside each other at most, the others continue below."""

_ROOM = 0.25  # of what the curves of a panel span, on either side: free, or with a limit in it
_FLAT = 1e-9  # of a value, or alone: a smaller span is that of a constant


def draw_joints(runs: Sequence[PlottedRun], joints: Sequence[int], share: bool, by_curve: bool = False) -> Any:
    """The figure: `joints` by their index, values in units or as `share` of their limits, in percent.

    With `by_curve` the axes are as large as the curves need, and a limit is drawn where it lies within them.
    """
    figure = _together(runs[0], joints, share) if len(runs) == 1 else _apart(runs, joints, share)
    if by_curve:
        for panel in figure.axes:
            _fit_curves(panel)
    drawn = any(line.get_gid() == LIMIT_LINE for panel in figure.axes for line in panel.lines)
    figure.suptitle(f"{_title_of(runs)}{'; dashed: limits' if drawn else ''}", fontsize=9)
    return figure


def _title_of(runs: Sequence[PlottedRun]) -> str:
    if len(runs) == 1:
        return f"{runs[0].problem.name}: {runs[0].legend}"
    return ", ".join(dict.fromkeys(run.problem.name for run in runs))


def _fit_curves(panel: Any) -> None:
    """Set a panel's height by its curves; limits outside it are taken away."""
    values = [np.asarray(line.get_ydata()) for line in panel.lines if line.get_gid() != LIMIT_LINE]
    known = np.concatenate([y[np.isfinite(y)] for y in values])
    if not len(known):
        return
    low, high = float(known.min()), float(known.max())
    span = high - low
    room = _ROOM * span if span > _FLAT * max(1.0, abs(low), abs(high)) else 1.0
    panel.set_ylim(low - room, high + room)
    for line in [line for line in panel.lines if line.get_gid() == LIMIT_LINE]:
        if not low - room <= float(line.get_ydata()[0]) <= high + room:
            line.remove()


def _together(run: PlottedRun, joints: Sequence[int], share: bool) -> Any:
    figure = sheet(ROW * len(QUANTITIES) + 0.5)
    panels = figure.subplots(len(QUANTITIES), 1, sharex=True, squeeze=False)[:, 0]
    for quantity, panel in zip(QUANTITIES, panels, strict=True):
        for place, joint in enumerate(joints):
            style = line_style(place) | {"label": run.problem.robot.joint_names[joint]}
            _draw(panel, run, quantity, joint, share, style)
            _draw_limits(panel, _limits(run, quantity, joint, share), style["color"])
        panel.set_ylabel(_title(run, quantity, joints, share))
    panels[-1].set_xlabel("time, s")
    figure.align_ylabels(list(panels))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", title="joint")
    return figure


def _apart(runs: Sequence[PlottedRun], joints: Sequence[int], share: bool) -> Any:
    blocks = [joints[k : k + COLUMNS] for k in range(0, len(joints), COLUMNS)]
    rows = len(QUANTITIES) * len(blocks)
    figure = sheet(1.25 * rows + 0.7, width=max(WIDTH, 2.0 * len(blocks[0])))
    panels = figure.subplots(rows, len(blocks[0]), sharex=True, squeeze=False)
    for b, block in enumerate(blocks):
        for row, quantity in enumerate(QUANTITIES, b * len(QUANTITIES)):
            for panel, joint in zip(panels[row], block, strict=False):
                for k, run in enumerate(runs):
                    _draw(panel, run, quantity, joint, share, line_style(k) | {"label": run.legend})
                    _draw_limits(panel, _limits(run, quantity, joint, share), LIMIT)
                if row == b * len(QUANTITIES):
                    panel.set_title(runs[0].problem.robot.joint_names[joint])
            panels[row, 0].set_ylabel(_title(runs[0], quantity, block, share))
            for panel in panels[row, len(block) :]:
                panel.set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel("time, s")
    figure.align_ylabels(list(panels[:, 0]))
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=min(3, len(runs)))
    return figure


def _draw(panel: Any, run: PlottedRun, quantity: str, joint: int, share: bool, style: dict[str, Any]) -> None:
    """A curve of one joint, with dots at its exact extrema, rings at those of a torque."""
    curves = run.curves
    values = curves.torque if quantity == "torque" else curves.joints[ORDERS.index(quantity)]
    panel.plot(curves.t, _shared(run, quantity, joint, share, values[:, joint]), **style)
    e = extrema_of(run, quantity)
    ends = np.array([e.low[joint], e.high[joint]])
    times = [e.t_low[joint], e.t_high[joint]]
    ring = {"marker": "o", "markersize": 3.0, "fillstyle": "none", "markeredgewidth": 0.8}
    mark = ring if quantity == "torque" else {"marker": ".", "markersize": 4.5}
    panel.plot(times, _shared(run, quantity, joint, share, ends), linestyle="", color=style["color"], **mark)


def extrema_of(run: PlottedRun, quantity: str) -> Extrema:
    """Extrema of all joints over time: exact ones, of torques refined samples."""
    curves = run.curves
    return curves.torque_extrema if quantity == "torque" else curves.extrema[ORDERS.index(quantity)]


def bounds(run: PlottedRun, quantity: str, joint: int) -> tuple[float, float]:
    """Lower and upper limit of a joint, rad/s^order, m/s^order, N m or N; infinite where there is none."""
    limits = run.problem.limits
    if quantity == "position":
        return float(limits.lower[joint]), float(limits.upper[joint])
    largest = float(getattr(limits, quantity)[joint])
    return -largest, largest


def _limits(run: PlottedRun, quantity: str, joint: int, share: bool) -> list[float]:
    """What is drawn of the limits."""
    known = np.array([value for value in bounds(run, quantity, joint) if np.isfinite(value)])
    return [float(value) for value in _shared(run, quantity, joint, share, known)]


def _shared(run: PlottedRun, quantity: str, joint: int, share: bool, values: Array) -> Array:
    """Values in units, or in percent of the limit: -100 at the lower and 100 at the upper one."""
    if not share:
        return values
    low, high = bounds(run, quantity, joint)
    if not np.isfinite(high - low):
        return np.full(len(values), np.nan)
    return 100.0 * (2.0 * values - low - high) / (high - low)


def _draw_limits(panel: Any, limits: Sequence[float], colour: str) -> None:
    for value in limits:
        panel.axhline(value, color=colour, linestyle=(0, (4, 3)), linewidth=0.8, gid=LIMIT_LINE)


def _title(run: PlottedRun, quantity: str, joints: Sequence[int], share: bool) -> str:
    """The quantity with its unit, of revolute and of sliding joints."""
    if share:
        return f"{quantity},\n% of limit"
    return f"{quantity},\n{joint_units(quantity, run.problem.robot.revolute[list(joints)])}"
