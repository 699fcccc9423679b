"""What an executor hands out: the set-point of a tick, what it is doing, and its stops."""

from typing import TYPE_CHECKING, Literal, NamedTuple

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.trajectory.segments import Segment

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

Phase = Literal["running", "changing", "paused", "waiting", "stopping", "stopped", "done"]

Held = Literal["", "paused", "waiting", "stopped"]
"""What keeps a robot from going on; empty where nothing does."""


class KeptSeparation(NamedTuple):
    """The separation from people at the last data about them, of those that are within 10 m.

    `separation` is the distance of the pair, m, and `distance` what the law asks that is commanded: the protective
    distance, 0 where the robot stands still. `allowed` is the speed that it leads to, 0 to 1.
    `pair` names the person and the part of the robot.
    """

    separation: float
    distance: float
    pair: tuple[str, str]
    allowed: float


@dataclass(frozen=True)
class Status:
    """What an executor is doing.

    Attributes:
        phase: `running` at a steady speed, `changing` it, `paused`, `waiting` for an obstacle to leave the path,
            `stopping`, `stopped`, or `done` at the end.
        place: on the path: time of the planned motion, s.
        progress: share of the planned motion that is done, 0 to 1.
        speed: rate of the planned motion, 1 as planned; negative backwards; 0 off the path, where `phase` says more.
        override: the speed that is wanted.
        reason: why it stopped by itself; empty where it did not.
        deviation: distance of a measured joint from the path at most so far, rad or m; None without measurements.
        lag: how far the robot was behind its set-point when it was last measured, s of the planned motion; below 0
            ahead of it.
        clearance: what was left then of the proved clearance, m; None where `TrackingPolicy` does not ask for it.
        separation: from people, where `Executor` was given what to keep and somebody is near.
        off_path: whether the robot left the path at `place` to stop, and is not back.
        blocked_by: the two bodies that would meet on the path, for which the robot waits or was stopped.
    """

    phase: Phase
    place: float
    progress: float
    speed: float
    override: float
    reason: str = ""
    deviation: float | None = None
    lag: float | None = None
    clearance: float | None = None
    separation: KeptSeparation | None = None
    off_path: bool = False
    blocked_by: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False)
class Ahead:
    """What a robot is to do without further set-points: go on for a while, then stop along the path.

    Attributes:
        t: (K,) rising times of the executor, s: from now until the robot stands still.
        q, v, a: (K, n), rad or m and s.
        turn: time at which the stop begins, s.
        along: the law up to there; `law`: that of the stop.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    turn: float
    along: "TimeLaw"
    law: "TimeLaw"


@dataclass(frozen=True, eq=False)
class Tick:
    """What the robot is to do at the end of a tick.

    Attributes:
        t: time since the first tick, s.
        q, v, a: (n,), rad or m and s.
        torque: (n,), feed-forward of the rigid bodies, N·m or N.
        events: what is due in this tick: steps of a task that take, release or grip.
        status: what the executor is doing.
        ahead: the way of a robot that gets no further set-point; None where the last one still holds, or none is kept.
    """

    t: float
    q: Array
    v: Array
    a: Array
    torque: Array
    events: tuple[Segment, ...]
    status: Status
    ahead: Ahead | None = None


class Stopping(NamedTuple):
    """The stop along the path from full speed, for K places of a motion: (K,) each.

    `place` where it begins, s; `time` until the robot stands still, s; `travel` along the path, s.
    """

    place: Array
    time: Array
    travel: Array


def phase_of(held: Held, resting: bool, changes: bool) -> Phase:
    """Return the phase of a robot that is not at its end, which stands still or not, and changes its speed or not."""
    if held == "stopped":
        return "stopped" if resting else "stopping"
    if held and resting:
        return held
    if changes:
        return "changing"
    return "paused" if resting else "running"
