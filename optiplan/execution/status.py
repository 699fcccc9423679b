"""What an executor hands out: the set-point of a tick, what it is doing, and its stops."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from optiplan.arrays import Array
from optiplan.trajectory.segments import Segment

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
        speed: rate of the planned motion, 1 as planned; negative backwards.
        override: the speed that is wanted.
        reason: why it stopped by itself; empty where it did not.
        deviation: (n,) distance of the measured joints from their set-points at most so far, rad or m; None without
            measurements.
        separation: from people, where `Executor` was given what to keep and somebody is near.
        off_path: whether the robot left the path at `place` to stop, and is not back.
    """

    phase: Phase
    place: float
    progress: float
    speed: float
    override: float
    reason: str = ""
    deviation: float | None = None
    separation: KeptSeparation | None = None
    off_path: bool = False


@dataclass(frozen=True, eq=False)
class Tick:
    """What the robot is to do at the end of a tick.

    Attributes:
        t: time since the first tick, s.
        q, v, a: (n,), rad or m and s.
        torque: (n,), feed-forward of the rigid bodies, N·m or N.
        events: what is due in this tick: steps of a task that take, release or grip.
        status: what the executor is doing.
    """

    t: float
    q: Array
    v: Array
    a: Array
    torque: Array
    events: tuple[Segment, ...]
    status: Status


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
