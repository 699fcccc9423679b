"""What goes over the network of motions that are executed, as OpenAPI tells it."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from optiplan.service.models import PlanningChoices, RunId, StorableInput, Text

Metres = Annotated[float, Field(allow_inf_nan=False, ge=-1e3, le=1e3)]
Share = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1)]
SHORTEST_LEASE, LONGEST_LEASE = 0.2, 60.0
"""s."""


class MotionInput(StorableInput):
    """A verified motion: a run of this server, a problem and its motion, or that of an execution."""

    run: RunId | None = Field(None, description="Id of a verified run of this server")
    execution: RunId | None = Field(None, description="Instead of `run`: id of an execution, whose first motion it is")
    problem: str | dict[str, Any] | None = Field(
        None, description="Instead of `run`: text of a problem file, its content as JSON, or the hash of a stored one"
    )
    name: Text | None = Field(None, description="Name of the problem where it states none")
    trajectory: dict[str, Any] | None = Field(
        None, description="Motion of that problem, as trajectory.json; it is verified here"
    )

    @model_validator(mode="after")
    def _one_motion(self) -> Self:
        given = [name for name in ("run", "problem", "execution") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "no motion"
            raise ValueError(f"found {found}; expected either run, problem or execution")
        if self.trajectory is not None and self.problem is None:
            raise ValueError("found a trajectory alone; expected a problem beside the trajectory, or a run")
        return self


class ExecutionRequest(MotionInput, PlanningChoices):
    """What is to be executed, and by what; a problem without a motion is planned first."""

    driver: Text = Field("sim", description="A driver of this server; see GET /api/executions")
    override: Share = Field(1.0, description="Speed at the start, 1 as planned")
    clearance: float = Field(
        0.0, ge=0, le=10, allow_inf_nan=False, description="Distance to keep from obstacles that move, m"
    )
    deviation: float | None = Field(
        0.05,
        gt=0,
        le=1e3,
        allow_inf_nan=False,
        description="Distance of a measured joint from the path that stops the robot, rad or m; null: none does",
    )
    paused: bool = Field(False, description="Whether it stands until `resume`")
    rate: float | None = Field(
        None, gt=0, le=2000, allow_inf_nan=False, description="Set-points a second; null: the driver's"
    )
    patience: float | None = Field(
        None,
        gt=0,
        le=0.1,
        allow_inf_nan=False,
        description="Seconds that a set-point may be late before the robot stops; null: the server's for this driver",
    )
    lease: float | None = Field(
        None,
        ge=SHORTEST_LEASE,
        le=LONGEST_LEASE,
        description="Seconds without a POST to …/alive after which the robot stops; null: it goes on without clients",
    )


class SpliceInput(MotionInput):
    """The motion that takes over, from a state that POST …/state gave."""

    @model_validator(mode="after")
    def _planned(self) -> Self:
        if self.problem is not None and self.trajectory is None:
            raise ValueError("found a problem alone; expected a trajectory beside the problem, or a run")
        return self


class SpeedInput(BaseModel):
    """A speed."""

    model_config = ConfigDict(extra="forbid")

    speed: Share = Field(description="1 as planned")


class StopInput(StorableInput):
    """Why the robot is to stop."""

    reason: Text = "asked to stop"


class LatencyInput(BaseModel):
    """How far ahead."""

    model_config = ConfigDict(extra="forbid")

    latency: float = Field(ge=0, le=60, allow_inf_nan=False, description="Seconds from now")


class ObstaclesInput(BaseModel):
    """Where obstacles of the scene are."""

    model_config = ConfigDict(extra="forbid")

    poses: dict[Text, Annotated[list[Metres], Field(min_length=7, max_length=7)]] = Field(
        min_length=1, max_length=2000, description="By name: x, y, z (m) and quaternion x, y, z, w, of its frame"
    )
    velocities: dict[Text, Annotated[list[Metres], Field(min_length=3, max_length=3)]] = Field(
        {}, description="By name, m/s; the others stand still"
    )
    spread: float = Field(
        0.0, ge=0, le=1e3, allow_inf_nan=False, description="How fast they may depart from that course, m/s"
    )

    @model_validator(mode="after")
    def _poses(self) -> Self:
        for name, pose in self.poses.items():
            if sum(x * x for x in pose[3:]) < 1e-12:
                raise ValueError(f"found a quaternion of zeros for '{name}'; expected one of length 1")
        if lost := sorted(self.velocities.keys() - self.poses.keys()):
            raise ValueError(f"found a velocity of '{lost[0]}' without a pose; expected both")
        return self


Phase = Literal["running", "changing", "paused", "waiting", "stopping", "stopped", "done"]


class ExecutionState(BaseModel):
    """What a robot does."""

    model_config = ConfigDict(extra="allow")

    t: float = Field(description="Since the first set-point, s")
    phase: Phase
    reason: str = Field(description="Why it stopped; empty where it did not")
    place: float = Field(description="On the path: time of the planned motion, s")
    progress: float = Field(description="Share of the planned motion that is done")
    speed: float = Field(description="1 as planned; negative backwards")
    override: float = Field(description="The speed that is wanted")
    deviation: float | None = Field(description="Largest so far of a measured joint, rad or m")
    q: list[float] = Field(description="Set-point, rad or m")
    v: list[float] | None = Field(description="Its velocity, rad/s or m/s; null before the first")
    blocked_by: list[str] | None = Field(description="The two bodies for which it waits or was stopped")


class ExecutionAnswer(BaseModel):
    """A motion that is executed, or that was."""

    id: str
    run: str | None = Field(description="Id of the run that it began with, where this server has it")
    name: str
    robot: str
    driver: str
    duration: float = Field(description="Of the planned motion, s")
    rate: float = Field(description="Set-points a second")
    joint_names: list[str]
    velocity_limits: list[float | None] = Field(description="Of the joints, rad/s or m/s; null: none")
    lease: float | None
    ended: str | None = Field(description="Why it has ended; null: it runs")
    clean: bool | None = Field(description="Whether it ended with the robot at rest, as was asked; null: it runs")


class ExecutionView(ExecutionAnswer):
    """An execution and its state."""

    state: ExecutionState | None = Field(description="The last one that arrived")


class ExecutionList(BaseModel):
    """Executions, those that run first, and what this server can drive."""

    executions: list[ExecutionAnswer]
    drivers: list[str]


class SpliceAnswer(BaseModel):
    """Whether a motion takes over."""

    taken: bool
    reason: str = Field(description="Why not; the robot stops then")


class PredictedState(BaseModel):
    """A state in which a new motion can take over."""

    joints: list[float]
    velocity: list[float]
    acceleration: list[float]
