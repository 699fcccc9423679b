"""From what a step did to its record: which limits were active, what was given up, the status in words."""

import time
from collections.abc import Mapping
from dataclasses import field

from optiplan.arrays import Array
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.objective import Demand
from optiplan.control.qp.program import Program
from optiplan.control.row_stack import RowStack
from optiplan.control.step import ControlStep, NearestPair, Status
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

HELD_BACK = 0.02
"""Share of what tasks ask for that may stay undone before a step counts as limited."""
STANDING = 1e-3
"""rad/s or m/s: slower joints count as standing."""
OFF = 1e-4
"""Weighted error, such as m or rad, below which a target counts as reached."""
SETS_OUT = 1e-6
"""rad/s or m/s: a robot that gains more than this in a step has only begun to move."""


@dataclass(slots=True, eq=False)
class StepOutcome:
    """What became of a step, filled in on the way."""

    state: State
    dt: float
    how: str = "braking"
    demand: Demand | None = None
    program: Program | None = None
    level: int = 0
    slack: Mapping[str, float] = field(default_factory=dict)
    share: float = 1.0
    why: str = "the solver gave no answer that can be accepted"
    solve_seconds: float = 0.0


class StepReporter:
    """Makes the records."""

    def __init__(self, robot: Robot, box: JointBox, rows: RowStack) -> None:
        self._names, self._box, self._rows = robot.joint_names, box, rows
        self._last: Array | None = None

    def step(self, outcome: StepOutcome, state: State, nearest: NearestPair | None, begin: float) -> ControlStep:
        """The record of a step to a state that began at `begin` of the clock `time.perf_counter`."""
        x, demand = state.v, outcome.demand
        active: tuple[str, ...] = ()
        slack: dict[str, float] = {}
        if outcome.how == "braking":
            stopping: tuple[Status, str] = ("stopping", "brakes") if x.any() else ("stopped", "stands")
            status, reason = stopping[0], f"{stopping[1]}: {outcome.why}"
        else:
            if outcome.how != "unconstrained":
                active = self._active(x)
                slack = {**self._box.violations(state.q, x), **(self._rows.violations(x) if outcome.slack else {})}
            status, reason = self._status(outcome, x, active, slack)
        self._last = x
        return ControlStep(
            state=state,
            status=status,
            reason=reason,
            active=active,
            slack=slack,
            error=0.0 if demand is None else demand.error,
            manipulability=None if demand is None else demand.manipulability,
            nearest=nearest,
            solve_seconds=outcome.solve_seconds,
            seconds=time.perf_counter() - begin,
            solver=outcome.how,
        )

    def _active(self, x: Array) -> tuple[str, ...]:
        found = [f"{name} of {self._names[j]} ({end})" for name, j, end in self._box.at(x)]
        if self._rows.any:
            found += [f"{name}: {label}" for name, label in self._rows.at(x)]
        return tuple(dict.fromkeys(found))

    def _status(
        self, outcome: StepOutcome, x: Array, active: tuple[str, ...], slack: Mapping[str, float]
    ) -> tuple[Status, str]:
        demand = outcome.demand
        if slack:
            return "recovering", f"back within limits: {', '.join(slack)}"
        if demand is None or not len(demand.b):
            return "tracking", "no task"
        if demand.error > OFF and _stands(outcome.state.v if self._last is None else self._last, x):
            if active:
                return "nearest", f"nearest pose: the target is behind {', '.join(active)}"
            return "nearest", "nearest pose: target out of reach, or tasks against each other"
        if not active and outcome.share == 1.0:
            return "tracking", "the tasks are followed"
        undone, wanted = demand.undone(x)
        if undone <= HELD_BACK * wanted + 1e-6:
            return "tracking", "the tasks are followed"
        return "limited", f"held back by {', '.join(active) or 'what could be stopped clear'}"


def _stands(before: Array, x: Array) -> bool:
    """Whether velocities x (n,) are too small to count, and do not grow from those before the step (n,)."""
    fastest: float = max(map(abs, x.tolist()))
    gained: float = fastest - max(map(abs, before.tolist()))
    return fastest < STANDING and gained <= SETS_OUT
