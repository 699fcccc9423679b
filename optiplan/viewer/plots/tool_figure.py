"""The tool against time: its position, speed and turning."""

from collections.abc import Sequence
from typing import Any

from optiplan.figure_style import line_style, sheet
from optiplan.viewer.plots.runs import PlottedRun

ROWS = ("x, m", "y, m", "z, m", "speed, m/s", "turning, rad/s")


def draw_tool(runs: Sequence[PlottedRun]) -> Any:
    """The figure: origin of the tool frame in the world, its speed and its angular speed, a colour a run."""
    figure = sheet(1.3 * len(ROWS) + 0.6)
    panels = figure.subplots(len(ROWS), 1, sharex=True)
    for k, run in enumerate(runs):
        curves = run.curves
        values = (*curves.X_WT[:, :3, 3].T, curves.speed, curves.turning)
        for panel, value in zip(panels, values, strict=True):
            panel.plot(curves.t, value, label=run.legend, **line_style(k))
    for panel, title in zip(panels, ROWS, strict=True):
        panel.set_ylabel(title)
    panels[-1].set_xlabel("time, s")
    figure.align_ylabels(list(panels))
    robot = runs[0].problem.robot
    names = ", ".join(dict.fromkeys(run.problem.name for run in runs))
    figure.suptitle(f"{names}: frame {robot.tool_frame} of {robot.name} in the world", fontsize=9)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=min(3, len(runs)))
    return figure
