"""Steps of a task, as planners and the verifier read them."""

from typing import TypeAlias

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.goals_and_vias import Goal, PoseGoal, Via
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.seams.actions import Passing, SeamPart, SeamPath, Transit
from optiplan.problem.task.rides import Mover, Ride, WaitUntil
from optiplan.problem.tools.tool import MountedTool
from optiplan.records import dataclass


@dataclass(frozen=True, eq=False)
class Move:
    """Some joints go to one of these ends, the others stand still.

    Attributes:
        joints: names of the k joints that move, in the robot's order.
        goal: ends; configurations are (k,).
        vias: passed in this order; configurations are (k,).
        rests: whether the robot stands still at the end.
        carried_by: link of the robot in whose frame regions of the goal are, where it is at the end; empty: the world.
    """

    joints: tuple[str, ...]
    goal: Goal
    vias: tuple[Via, ...] = ()
    rests: bool = False
    carried_by: str = ""


@dataclass(frozen=True, eq=False)
class StraightLine(ReadOnlyPoses):
    """A frame goes straight to a pose, turning evenly about one axis, or by a vector, not turning.

    Attributes:
        joints: names of the joints that move.
        frame: a link or fixed frame of the robot.
        ends: poses of that frame; empty where `by` is given. Of several, an approach ends at the one before which it
            began.
        by: (3,) m, in the axes of the world, or of the frame where `in_tool`; None where there are `ends`.
        in_tool: see `by`.
        speed: of the frame's origin at most, m/s; infinite: any.
        blend: m; within this distance of its end the line may be left for the next one, so that the arm need not stop
            in the corner; 0: it is exact.
        X_GB: where an approach begins, in the frame at its end G; None for other lines.
        region: in which the ends are, where an approach leads into one.
    """

    joints: tuple[str, ...]
    frame: str
    ends: tuple[PoseGoal, ...] = ()
    by: Array | None = None
    in_tool: bool = False
    speed: float = np.inf
    blend: float = 0.0
    X_GB: pin.SE3 | None = None
    region: RegionGoal | None = None


@dataclass(frozen=True, eq=False)
class Attach:
    """A link takes an obstacle where it stands; the rest is as of `geometry.scene.Attachment`."""

    body: str
    link: str
    touch: frozenset[str] = frozenset()
    mass: float | None = None
    centre: tuple[float, ...] | None = None
    inertia: tuple[float, ...] | None = None
    framed: bool = False


@dataclass(frozen=True)
class Detach:
    """What a link holds becomes an obstacle where it is, and moves along with `mover` from then on, if there is one."""

    body: str
    mover: Mover | None = None


@dataclass(frozen=True, eq=False)
class ChangeTool:
    """A link gets another tool: one that it leaves, in its rack if it has one, and one that it takes; None: no tool."""

    leaves: MountedTool | None
    takes: MountedTool | None

    @property
    def body(self) -> str:
        """The name of the tool that is taken; that of the one left where none is."""
        tool = self.takes or self.leaves
        return "" if tool is None else tool.name

    @property
    def link(self) -> str:
        """The link of that tool."""
        tool = self.takes or self.leaves
        return "" if tool is None else tool.link

    @property
    def racks(self) -> tuple[tuple[MountedTool, pin.SE3], ...]:
        """The tools of the change that have a rack, with the pose X_WP at which their link has to be."""
        tools = [tool for tool in (self.leaves, self.takes) if tool is not None]
        return tuple((tool, tool.X_WP) for tool in tools if tool.X_WP is not None)


PARKED = 2e-3, 1e-2
"""m and rad: how far a link may be from where a tool is parked as it takes or leaves it; the coupling centres it."""

Event: TypeAlias = Attach | Detach | ChangeTool
"""What takes no time: what the robot carries changes."""


@dataclass(frozen=True)
class Dwell:
    """The robot stands still for so many seconds at least."""

    seconds: float


@dataclass(frozen=True, eq=False)
class Target:
    """A place of a tour.

    Attributes:
        name: unlike those of the others.
        goal: poses of the tool there.
        after: names of targets that are visited before.
        cluster: targets of one cluster are visited in one go; empty: it has none.
        window: earliest and latest arrival, s from the start of the tour.
    """

    name: str
    goal: RegionGoal
    after: tuple[str, ...] = ()
    cluster: str = ""
    window: tuple[float, float] = (0.0, np.inf)


@dataclass(frozen=True)
class Process:
    """What is done at every target: the robot rests for `seconds`; `name` of an event, empty where it only dwells."""

    seconds: float
    name: str = ""


@dataclass(frozen=True, eq=False)
class TargetTour:
    """Some joints take the tool to every target, where it rests; the others stand still.

    Attributes:
        joints: names of the joints that move, in the robot's order.
        targets: the targets, as listed.
        free: whether the order is free; else it is that of the list.
        first, last: names of the targets that are visited first and last; empty: any.
        closed: whether the tour ends in the configuration in which it began.
        at_each: what is done at every target, in this order.
        carried_by: link of the robot in whose frame the targets are, of a positioner say; empty: the world.
    """

    joints: tuple[str, ...]
    targets: tuple[Target, ...]
    free: bool = True
    first: str = ""
    last: str = ""
    closed: bool = False
    at_each: tuple[Process, ...] = ()
    carried_by: str = ""

    @property
    def dwelling(self) -> float:
        """Time that the robot rests at each target, s."""
        return sum(process.seconds for process in self.at_each)

    @property
    def count(self) -> int:
        """Number of segments of a motion that visits all targets."""
        return len(self.targets) * (1 + len(self.at_each)) + self.closed


Action: TypeAlias = (
    Move
    | StraightLine
    | Attach
    | Detach
    | ChangeTool
    | Dwell
    | WaitUntil
    | TargetTour
    | SeamPath
    | Transit
    | SeamPart
    | Passing
)


@dataclass(frozen=True, eq=False)
class TaskStep:
    """A step of a task; an approach is two of them.

    Attributes:
        number: in the problem file, from 1.
        kind: its key there: `move`, `line`, `approach`, `retreat`, `attach`, `detach`, `gripper`, `dwell`, `tour`,
            `tool`, `path`, `wait_until`; or `process`: what is done at the targets of a tour; `passing`: an event on a
            path.
        name: its own, or its kind and what it is about.
        action: what is done.
        allowed: pairs of names that may touch during the step, besides those of the scene.
        constraints: what holds during the step; their `during` is a part of it.
        arm: that does the step, beside what other arms do; empty: steps follow each other.
        waits: numbers of steps of other arms that are done before this one begins.
        ride: what moves, with which the step is done; None: it is done in the world.
        option: the choice that the step is part of, from 0, and which of its alternatives; None: of none.
    """

    number: int
    kind: str
    name: str
    action: Action
    allowed: frozenset[frozenset[str]] = frozenset()
    constraints: tuple[PathConstraint, ...] = ()
    arm: str = ""
    waits: tuple[int, ...] = ()
    ride: Ride | None = None
    option: tuple[int, int] | None = None

    @property
    def timed(self) -> bool:
        """Whether it goes with what moves, or waits for it."""
        return self.ride is not None or isinstance(self.action, WaitUntil)

    @property
    def words(self) -> str:
        """The step as messages name it."""
        return f"step {self.number} ({self.name})"

    @property
    def event(self) -> bool:
        """Whether it takes no time: what is held changes, or something happens on a path."""
        return isinstance(self.action, Event | Passing)
