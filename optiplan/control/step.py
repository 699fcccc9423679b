"""`ControlStep`: what a controller answers in each step, and why."""

from collections.abc import Mapping
from typing import Literal

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.trajectory.state import State

Status = Literal["tracking", "limited", "nearest", "recovering", "stopping", "stopped"]
"""What a step does.

* `tracking`: the tasks are followed, no limit holds them back.
* `limited`: a limit that is among `active` holds the tasks back.
* `nearest`: the robot stands as near to the target as it comes: it is out of reach, or behind a limit.
* `recovering`: a limit did not hold at the beginning of the step; the way back within it goes before the tasks.
* `stopping`: the tasks were left for braking within limits; `reason` says why.
* `stopped`: the same, and the robot stands.
"""


@dataclass(frozen=True, slots=True)
class NearestPair:
    """The two bodies that come nearest, and how near, m (negative is the depth of penetration)."""

    a: str
    b: str
    distance: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ControlStep:
    """One step of a controller.

    Attributes:
        state: positions, velocities and accelerations commanded for the end of the step; what the next step reads.
        status: see `Status`.
        reason: the status in words.
        active: names of the limits that hold the command back.
        slack: by how much limits were given up, by name, in their own units; empty where all hold.
        error: weighted norm of the errors of all tasks at the beginning of the step.
        manipulability: product of the singular values of the first frame task's Jacobian; None without such a task.
        nearest: the nearest pair of bodies; None where nothing is near, or without a clearance limit.
        solve_seconds: time in the solver; `seconds`: of the whole step.
        solver: what found the command: `unconstrained`, `active set`, the name of the solver, `motion` (that of
            `follow`), `way out` (away from what the robot stands too near to), or `braking`.
    """

    state: State
    status: Status
    reason: str
    active: tuple[str, ...]
    slack: Mapping[str, float]
    error: float
    manipulability: float | None
    nearest: NearestPair | None
    solve_seconds: float
    seconds: float
    solver: str

    @property
    def q(self) -> Array:
        """Positions (n,) at the end of the step, rad or m."""
        return self.state.q

    @property
    def v(self) -> Array:
        """Velocities (n,) at the end of the step, rad/s or m/s; a velocity-controlled robot takes these.

        In a step that brakes the mean velocity, (q' - q) / dt, takes it to where its stop leads.
        """
        return self.state.v

    @property
    def a(self) -> Array:
        """Accelerations (n,) in the step, of one that brakes at its end, rad/s² or m/s²."""
        return self.state.a

    def __repr__(self) -> str:
        """Status, reason and time."""
        return f"ControlStep: {self.status}: {self.reason}; {self.seconds * 1e3:.2f} ms"
