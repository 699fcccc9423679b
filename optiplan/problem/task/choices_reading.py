"""Read alternatives of steps: each begins with what is in hand before the choice, and all end with the same."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import prod

from optiplan.config.simple_yaml import Place
from optiplan.problem.builder import Compiler
from optiplan.problem.task.choices import MOST, choices_of
from optiplan.problem.task.rides_reading import RideState
from optiplan.problem.task.steps import TaskStep
from optiplan.problem.tools.tool import MountedTool
from optiplan.records import dataclass
from optiplan.robot.mounting import FixedFrame


@dataclass(frozen=True, eq=False)
class InHand:
    """What the robot has in hand before a step.

    Attributes:
        held: names of objects.
        free: names of those that can be taken.
        moved: names of those that were taken before.
        tool: that is mounted.
        links: which holds each object, and the frame of that.
        ride: with what the arm goes.
    """

    held: set[str]
    free: set[str]
    moved: set[str]
    tool: MountedTool | None
    links: Mapping[str, FixedFrame]
    ride: RideState

    @property
    def hand(self) -> tuple[object, ...]:
        """What must be the same after all alternatives."""
        return frozenset(self.held), self.tool, self.ride.at_rest, {name: one.link for name, one in self.links.items()}


class ChoiceReader:
    """Follows the alternatives of a task while its steps are read in the order of the file."""

    def __init__(self, compiler: Compiler, state: Callable[[], InHand], restore: Callable[[InHand], None]) -> None:
        """Take what tells what is in hand, and what puts it back."""
        self._compiler, self._state, self._restore = compiler, state, restore
        self._option: tuple[int, ...] | None = None
        self._begin: InHand | None = None
        self._ended: list[InHand] = []

    def at(self, place: Place, option: Sequence[int] | None) -> None:
        """Come to a step of an alternative, or of none; alternatives that end otherwise than others are reported."""
        before, self._option = self._option, None if option is None else tuple(option)
        if before == self._option:
            return
        anew = self._option is None or before is None or self._option[0] != before[0]
        if before is not None:
            self._ended.append(self._state())
        if before is not None and anew:
            if any(end.hand != self._ended[0].hand for end in self._ended):
                expected = "alternatives that end with the same objects and tool in hand, and with the arm at rest"
                self._compiler.report(place, "alternatives before this step that end otherwise", expected)
            moved = set[str]().union(*(end.moved for end in self._ended))
            self._restore(replace(self._ended[-1], moved=moved))  # what some alternative moved is not where it was
            self._ended = []
        if self._option is None:
            return
        self._begin = self._state() if anew or self._begin is None else self._begin
        self._restore(self._begin)

    def check(self, steps: Sequence[TaskStep]) -> None:
        """Report alternatives that make too many tasks, or that stand beside other arms."""
        count = prod(len(own) for own in choices_of(steps).values())
        if count > MOST:
            self._compiler.report(("task",), f"alternatives that make {count} tasks", f"at most {MOST}")
        if count > 1 and any(step.arm for step in steps):
            self._compiler.report(("task",), "alternatives beside other arms", "steps of one arm")
