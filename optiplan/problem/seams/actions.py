"""Actions of a path of the tool: the whole, and the parts of which its motion consists."""

from itertools import pairwise

import numpy as np

from optiplan.problem.seams.curve import SeamCurve
from optiplan.records import dataclass


@dataclass(frozen=True)
class PathEvent:
    """What happens as the tool passes a place on its path, without a stop.

    Attributes:
        at: length of the path there, m.
        name: of what happens.
    """

    at: float
    name: str


@dataclass(frozen=True, eq=False)
class SeamPath:
    """Some joints lead the tool along a path at a constant speed; the others stand still.

    Attributes:
        joints: names of the joints that move, in the robot's order.
        frame: a link or fixed frame of the robot, the tool.
        curve: of the tool's origin, and the direction of its axes.
        speed: of the origin, m/s.
        within: share by which the speed may be off.
        ramp: m: so far from its ends and corners the tool may be slower; 0: nowhere.
        cone: rad, by which the tool's z axis may be tilted from its direction.
        position: m, by which the origin may be off its place on the curve.
        orientation: rad, by which the axis may be off besides; and the turn about it, where that is given.
        events: in the order of the path.
    """

    joints: tuple[str, ...]
    frame: str
    curve: SeamCurve
    speed: float
    within: float
    ramp: float
    cone: float
    position: float
    orientation: float
    events: tuple[PathEvent, ...] = ()

    @property
    def count(self) -> int:
        """Number of segments of a motion along the path."""
        return len(self.parts()) + len(self.events) + 3

    def parts(self) -> list[tuple[float, float]]:
        """Return the parts between the events, from one length to another, m."""
        edges = [0.0, *(event.at for event in self.events), self.curve.length]
        return list(pairwise(edges))

    def slow_parts(self) -> list[tuple[float, float]]:
        """Return where the tool may be slower, from one length to another, m."""
        if not self.ramp:
            return []
        stops = np.array([0.0, *self.curve.corners, self.curve.length])
        return [(float(at - self.ramp), float(at + self.ramp)) for at in stops]


@dataclass(frozen=True)
class Transit:
    """Some joints move, anywhere and in any way: to a path and away from it."""

    joints: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SeamPart:
    """A part of a path, from one event to the next.

    Attributes:
        path: the whole.
        low, high: lengths at which it begins and ends, m.
    """

    path: SeamPath
    low: float
    high: float

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move."""
        return self.path.joints


@dataclass(frozen=True, eq=False)
class Passing:
    """The tool passes the place of an event; takes no time.

    Attributes:
        path: the whole.
        at: length of the path there, m.
    """

    path: SeamPath
    at: float
