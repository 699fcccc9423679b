"""Cubic, quintic, LSPB, bang-bang and S-curve side by side: one displacement in one duration."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.figure_style import INK, line_style, sheet
from optiplan.records import dataclass
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.profiles.laws import CUBIC, QUINTIC, BangBang, Bounds, Law, SCurve, Trapezoid
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.plots.refined_extrema import PieceSamples
from optiplan.viewer.plots.runs import PlottedRun

SEVENTHS = Bounds(velocity=1.75, acceleration=6.125, jerk=42.875)
"""Bounds of unit distance and time within which the seven phases of an S-curve last a seventh each."""
LAWS: dict[str, tuple[Law, Bounds]] = {
    "cubic": (CUBIC, Bounds()),
    "quintic": (QUINTIC, Bounds()),
    "LSPB": (Trapezoid(), Bounds()),
    "bang-bang": (BangBang(), Bounds()),
    "S-curve": (SCurve(), SEVENTHS),
}
"""By name: the law, and the bounds of unit distance and time that shape it. LSPB blends for a third of the time."""

_SAMPLES = 300
_JUMP = 1e-6  # of the largest acceleration: a larger change at a breakpoint is a jump
_ARROW = 0.8  # of a panel's half height: an impulse of jerk


@dataclass(frozen=True)
class Displacement:
    """What the laws are drawn of: `title`, the distance D, rad or m, the duration T, s, and units of orders 0 to 3."""

    title: str
    distance: float
    duration: float
    units: tuple[str, ...]

    @classmethod
    def of(cls, runs: Sequence[PlottedRun]) -> "Displacement":
        """Of the joint that moves farthest in a run, in the run's time; without a run 1 in 1."""
        if not runs:
            return cls("displacement 1 in the time 1", 1.0, 1.0, ("", "", "", ""))
        run = runs[0]
        robot, ways = run.problem.robot, run.trajectory.end - run.trajectory.start
        joint = int(np.abs(ways).argmax())
        units = tuple(f", {robot.unit(order, joint)}" for order in ORDERS)
        T = run.trajectory.duration
        title = f"{run.problem.name}: {robot.joint_names[joint]} moves by {ways[joint]:.4g}{units[0][1:]} in {T:.4g} s"
        return cls(title, float(ways[joint]), T, units)

    def motion(self, name: str) -> Trajectory:
        """The motion by a law of `LAWS`, from 0, exact polynomial pieces."""
        law, bounds = LAWS[name]
        pieces = law.pieces(1.0, bounds).stretched(self.duration)
        return Trajectory((name,), pieces.breakpoints, self.distance * pieces.coefficients[:, :, None])


def draw_laws(runs: Sequence[PlottedRun]) -> Any:
    """The figure: a column a law, a row an order up to the jerk, with the exact peak of each as a number.

    The acceleration begins and ends at 0, so a jump from rest is seen; arrows are the impulses of jerk of such jumps.
    """
    what = Displacement.of(runs)
    figure = sheet(6.4, width=9.2)
    panels = figure.subplots(len(ORDERS), len(LAWS), sharex=True, sharey="row", squeeze=False)
    for column, name in enumerate(LAWS):
        motion, style = what.motion(name), line_style(column)
        samples = PieceSamples.of(motion, _SAMPLES)
        for order, (panel, values) in enumerate(zip(panels[:, column], samples.states(), strict=True)):
            t, y = samples.t, values[:, 0]
            panel.plot(np.r_[0.0, t, t[-1]], np.r_[0.0, y, 0.0] if order else np.r_[y[0], y, y[-1]], **style)
            panel.axhline(0.0, color=INK, linewidth=0.6)
            if order:
                e = motion.extrema_at(order)
                peak = max(abs(float(e.low[0])), abs(float(e.high[0])))
                endless = order == len(ORDERS) - 1 and acceleration_jumps(motion).any()
                panel.set_title("no bound: impulses" if endless else f"peak {peak:.4g}", fontsize=8, loc="right")
        panels[0, column].set_title(name)
    for row, order_name, unit in zip(panels, ORDERS, what.units, strict=True):
        row[0].set_ylabel(f"{order_name}{unit}")
    for column, name in enumerate(LAWS):
        _draw_impulses(panels[3, column], what.motion(name), line_style(column)["color"])
        panels[-1, column].set_xlabel("time, s" if runs else "time")
    figure.align_ylabels(list(panels[:, 0]))
    figure.suptitle(f"Time laws: {what.title}; arrows: impulses of jerk, where the acceleration jumps", fontsize=10)
    return figure


def _draw_impulses(panel: Any, motion: Trajectory, colour: str) -> None:
    low, high = panel.get_ylim()
    size = _ARROW * min(abs(low), abs(high))
    for t, jump in zip(motion.breakpoints, acceleration_jumps(motion), strict=True):
        if jump:
            ends = {"xy": (t, np.sign(jump) * size), "xytext": (t, 0.0)}
            arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6}
            panel.annotate("", **ends, arrowprops=arrow, gid="impulse")


def acceleration_jumps(motion: Trajectory) -> Array:
    """Change of the acceleration at each breakpoint, (m + 1,), from and to rest at the ends; rounding is none."""
    inside = PieceSamples.of(motion, 1)
    a, first = inside.states()[2][:, 0], np.searchsorted(inside.piece, np.arange(len(motion.breakpoints)))
    begins, ends = a[first[:-1]], a[first[1:] - 1]
    jumps = np.r_[begins, 0.0] - np.r_[0.0, ends]
    return np.where(np.abs(jumps) > _JUMP * np.abs(a).max(), jumps, 0.0)
