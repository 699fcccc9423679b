"""Check that a robot can be in the states of motion that a problem states, and go on from them, or come to them."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from optiplan.config.document import Document
from optiplan.config.simple_yaml import Place
from optiplan.errors import Issue
from optiplan.problem.goals_and_vias import JointGoal
from optiplan.robot.limits import ORDERS, Limits
from optiplan.robot.robot import Robot

_ROUNDING = 1e-9
"""Share of a limit, and rad or m: a state that was computed may be so far beyond."""


class StatedState(NamedTuple):
    """A state of motion, where it is stated, and whether it is the start."""

    place: Place
    value: JointGoal
    start: bool


def impossible_states(document: Document, robot: Robot, limits: Limits, states: Iterable[StatedState]) -> list[Issue]:
    """Report rates beyond the limits, and states whose motion cannot be stopped before a limit (or have been begun)."""
    issues: list[Issue] = []
    for one in states:
        if one.value.moving:
            found = list(_beyond(document, robot, limits, one))
            issues += found or _unstoppable(document, robot, limits, one)
    return issues


def _beyond(document: Document, robot: Robot, limits: Limits, one: StatedState) -> Iterator[Issue]:
    """Velocities and accelerations beyond their own limits."""
    for rate, most, name in zip((one.value.state.v, one.value.state.a), limits.rates, ORDERS[1:], strict=False):
        for j in np.flatnonzero(np.abs(rate) > most * (1.0 + _ROUNDING)):
            found = f"{robot.joint_names[j]} = {rate[j]:.10g} {robot.unit(name, int(j))}, beyond its limit"
            expected = f"a value in [{-most[j]:.10g}, {most[j]:.10g}]"
            yield document.issue((*one.place, name, int(j)), found, expected)


def _unstoppable(document: Document, robot: Robot, limits: Limits, one: StatedState) -> list[Issue]:
    """States that lead beyond a limit of velocity or position, whatever is done; of a goal, backwards in time."""
    from optiplan.trajectory.timing.stopping import fastest_reached, furthest

    state = one.value.state
    forward = 1.0 if one.start else -1.0
    v = forward * state.v
    slow, fast = fastest_reached(v, state.a, limits)
    low, high = furthest(state.q, v, state.a, limits)
    issues = []
    for j in range(state.n):
        name = robot.joint_names[j]
        here = f"{name} at {state.q[j]:.6g} with velocity {state.v[j]:.6g} and acceleration {state.a[j]:.6g}"
        which = "goes" if one.start else "comes"
        speed, unit = max(fast[j], -slow[j]), robot.unit("velocity", j)
        if speed > limits.velocity[j] * (1.0 + _ROUNDING):
            found = f"{here}, which {which} through {speed:.6g} {unit} under its jerk limit, whatever is done"
            expected = f"a state that stays within its velocity limit of {limits.velocity[j]:.6g} {unit}"
            issues.append(document.issue((*one.place, "acceleration", j), found, expected))
            continue
        beyond = _passed(low[j], high[j], limits.lower[j], limits.upper[j])
        if beyond is not None:
            reached, limit = beyond
            found = f"{here}, which cannot stop before its limit {limit:.6g}: braked at once it goes to {reached:.6g}"
            expected = "a state that can be stopped in time"
            if not one.start:
                found = f"{here}, which no motion within its limit {limit:.6g} leads to: it comes from {reached:.6g}"
                expected = "a state that can be reached"
            issues.append(document.issue((*one.place, "velocity", j), found, expected))
    return issues


def _passed(low: float, high: float, lower: float, upper: float) -> tuple[float, float] | None:
    """The position that is reached beyond a limit, and the limit."""
    if high > upper + _ROUNDING:
        return high, upper
    return (low, lower) if low < lower - _ROUNDING else None
