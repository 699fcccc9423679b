"""Pictures of a log: errors, limits in use, slack."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from optiplan.arrays import Array
from optiplan.figure_style import LIMIT, line_style, sheet, styled, svg_of
from optiplan.robot.limits import Limits
from optiplan.simulation.log import Log

PICTURES = ("error.svg", "limits.svg", "slack.svg")
"""Names of all pictures that a log may have."""

_SHOWN = 1500
"""Samples of a curve; more are no finer on paper."""


def pictures(log: Log, limits: Limits) -> dict[str, bytes]:
    """SVG files by name: `error.svg`, `limits.svg`, and `slack.svg` where a limit was given up."""
    with styled():
        drawn = {"error.svg": error_picture(log), "limits.svg": limits_picture(log, limits)}
        if log.slack:
            drawn["slack.svg"] = slack_picture(log)
        return {name: svg_of(figure).encode() for name, figure in drawn.items()}


def error_picture(log: Log) -> Figure:
    """Errors of the joints, and of the tool."""
    figure, axes = _figure(2)
    rows = _rows(log)
    for j, name in enumerate(log.joint_names):
        axes[0].plot(log.t[rows], 1e3 * log.error[rows, j], label=name, **line_style(j))
    axes[0].set_ylabel("joint error, mrad (mm)")
    axes[1].plot(log.t[rows], 1e3 * log.tool_error[rows, 0], label="position, mm", **line_style(0))
    axes[1].plot(log.t[rows], 1e3 * log.tool_error[rows, 1], label="orientation, mrad", **line_style(1))
    axes[1].set_ylabel("tool error")
    return _finished(figure, axes)


def limits_picture(log: Log, limits: Limits) -> Figure:
    """Share of the velocity limits and of the drives' limits in use."""
    figure, axes = _figure(2)
    rows = _rows(log)
    used: list[tuple[str, Array, Array]] = [("velocity", log.v, limits.velocity)]
    if log.input == "torque":
        used.append(("torque", log.applied, limits.torque))
    for ax, (name, values, limit) in zip(axes, used, strict=False):
        for j, joint in enumerate(log.joint_names):
            if np.isfinite(limit[j]):
                ax.plot(log.t[rows], values[rows, j] / limit[j], label=joint, **line_style(j))
        for end in (-1.0, 1.0):
            ax.axhline(end, color=LIMIT, lw=0.8, ls="--")
        ax.set_ylabel(f"{name} / limit")
    if len(used) < 2:
        axes[1].remove()
        axes = axes[:1]
    return _finished(figure, axes)


def slack_picture(log: Log) -> Figure:
    """By how much limits were given up, by name."""
    figure, axes = _figure(1)
    rows = _rows(log)
    for k, (name, values) in enumerate(log.slack.items()):
        axes[0].plot(log.t[rows], values[rows], label=name, **line_style(k))
    axes[0].set_ylabel("slack, in the limit's unit")
    return _finished(figure, axes)


def _rows(log: Log) -> slice:
    return slice(None, None, -(-len(log.t) // _SHOWN))


def _figure(count: int) -> tuple[Figure, list[Axes]]:
    figure = sheet(2.2 * count + 0.7)
    return figure, list(np.atleast_1d(figure.subplots(count, 1, sharex=True)))


def _finished(figure: Figure, axes: list[Axes]) -> Figure:
    """Time below, and legends where they hide nothing: one below all where the curves are the same in all."""
    labels = [ax.get_legend_handles_labels()[1] for ax in axes]
    for ax in axes:
        if labels[0] != labels[-1]:
            ax.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.01, 0.5))
    if labels[0] == labels[-1]:
        figure.legend(*axes[0].get_legend_handles_labels(), fontsize=7, ncols=4, loc="outside lower center")
    axes[-1].set_xlabel("t, s")
    return figure
