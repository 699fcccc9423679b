"""Vias step by step: straight lines, parabolic blends that miss, pseudo-via points that hit."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.figure_style import INK, LIMIT, line_style, sheet
from optiplan.planners.vias.parabolic import Parabolic, ParabolicMotion, ParabolicOptions, Refinement, places_of_vias
from optiplan.problem.examples import find_problem
from optiplan.problem.load import load_problem
from optiplan.problem.problem import JointGoal, Problem
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.paths.parabolic_blends import run_blends
from optiplan.viewer.plots.runs import PlottedRun

PROBLEM = "23_via_blends"
"""Drawn without a run."""

_STEPS = 400
"""Samples of a motion."""


def draw_pseudo_vias(runs: Sequence[PlottedRun]) -> Any:
    """The figure: a row a step of the planner `parabolic`, of the joint whose via is missed most at first.

    Bars are the tolerances of the vias, squares the pseudo-via points; the last panel has the velocities of all steps.

    Raises:
        InputError: no vias, vias that are poses, or blends that overlap at the times given.
    """
    motion, problem = _motion(runs)
    steps = motion.refinements()
    joint = int(steps[0].blends.miss.max(axis=0).argmax())
    units = [problem.robot.unit(order, joint) for order in ORDERS[:2]]
    figure = sheet(2.1 * (len(steps) + 2), width=7.2)
    panels = figure.subplots(len(steps) + 2, 1, sharex=True, squeeze=False)[:, 0]
    times = steps[0].blends.times  # of the points given: there are no others yet
    panels[0].plot(times, motion.points[:, joint], "-", color=line_style(0)["color"])
    panels[0].set_title("straight lines: the velocity would jump at every via")
    for number, (panel, step) in enumerate(zip(panels[1:-1], steps, strict=True), 1):
        colour = line_style(number)["color"]
        t, states = _sampled(motion, step)
        panel.plot(times, motion.points[:, joint], "--", color=INK, linewidth=0.8)
        panel.plot(t, states[0][:, joint], "-", color=colour)
        pseudo = np.setdiff1d(np.arange(len(step.points)), places_of_vias(step.hit))
        panel.plot(step.blends.times[pseudo], step.points[pseudo, joint], "s", color=colour, gid="pseudo")
        panel.set_title(_told(step, motion, number, units[0]))
        panels[-1].plot(t, states[1][:, joint], color=colour, label=f"step {number}")
    for panel in panels[:-1]:
        bars = {"fmt": "o", "color": LIMIT, "markersize": 4, "capsize": 3, "linewidth": 1.0}
        panel.errorbar(times, motion.points[:, joint], yerr=motion.tolerances, **bars)
        panel.set_ylabel(f"{motion.joint_names[joint]}, {units[0]}")
    panels[-1].set(xlabel="time, s", ylabel=f"velocity, {units[1]}")
    panels[-1].legend(loc="best", ncols=len(steps))
    figure.align_ylabels(list(panels))
    figure.suptitle(f"Pseudo-via points step by step: {problem.name}; bars: tolerances of the vias", fontsize=10)
    return figure


def _motion(runs: Sequence[PlottedRun]) -> tuple[ParabolicMotion, Problem]:
    """The parabolic motion of a run's problem between the run's ends, or of the shipped example; and the problem."""
    problem = runs[0].problem if runs else load_problem(find_problem(PROBLEM))
    vias = [via.at for via in problem.vias]
    if not vias or not all(isinstance(at, JointGoal) for at in vias):
        found = "vias that are poses" if vias else "a motion without vias"
        raise InputError([Issue("plot", None, "vias", f"'{problem.name}', {found}", "a problem with vias of joints")])
    ends = (runs[0].trajectory.start, runs[0].trajectory.end) if runs else (problem.start, _goal(problem))
    chain = np.array([ends[0], *(at.q for at in vias if isinstance(at, JointGoal)), ends[1]])
    options = ParabolicOptions(**problem.options) if problem.planner == "parabolic" else ParabolicOptions()
    return Parabolic(options).profile(problem, chain), problem


def _goal(problem: Problem) -> Array:
    return next(np.asarray(goal.q) for goal in problem.goal if isinstance(goal, JointGoal))


def _sampled(motion: ParabolicMotion, step: Refinement) -> tuple[Array, list[Array]]:
    curve = run_blends(motion.points[0], step.blends, motion.joint_names)
    t = np.linspace(0.0, curve.duration, _STEPS)
    return t, [curve(t), curve(t, 1)]


def _told(step: Refinement, motion: ParabolicMotion, number: int, unit: str) -> str:
    """What the step does, and by how much it misses the worst via."""
    miss = np.where(step.hit, 0.0, step.blends.miss.max(axis=1)[places_of_vias(step.hit)])
    worst = int((miss - motion.tolerances).argmax())
    what = "blends" if number == 1 else f"pseudo-via points about via {', '.join(map(str, np.flatnonzero(step.hit)))}"
    if not step.late.any():
        return f"step {number}, {what}: every via within its tolerance"
    allowed = motion.tolerances[worst]
    return f"step {number}, {what}: via {worst} missed by {miss[worst]:.3g} {unit} of {allowed:.3g} allowed"
