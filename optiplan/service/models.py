"""What goes over the network, as OpenAPI tells it."""

import json
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

Text = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]+$")]
"""A name: one line."""

Hash = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
"""SHA-256, in hex."""

RunId = Annotated[str, Field(pattern="^[0-9a-f]{32}$")]
"""Of a queued run the digest of problem, planner, options, seed, budget, deadline and version; else of its own."""


class StorableInput(BaseModel):
    """An input that can be kept: text that is text, numbers that are numbers."""

    model_config = ConfigDict(extra="forbid")

    @model_validator(mode="after")
    def _storable(self) -> Self:
        try:
            text = json.dumps(self.model_dump(), allow_nan=False, ensure_ascii=False)
            text.encode()
        except (ValueError, RecursionError) as error:
            raise ValueError("found NaN, infinity, half a character or too many levels; expected JSON text") from error
        if "\\u0000" in text:
            raise ValueError("found the character NUL; expected text")
        return self


class ProblemInput(StorableInput):
    """A problem: the text of a YAML file, the same as JSON, or the hash of a stored one."""

    problem: str | dict[str, Any] = Field(
        description="Text of a problem file (YAML), its content as JSON, or the hash of a stored problem",
        examples=["version: 1\nrobot: panda\nstart: {configuration: ready}\ngoal: {joints: [0, 0, 0, -2, 0, 2, 0]}\n"],
    )
    name: Text | None = Field(None, description="Name of the problem where it states none")
    start: dict[str, Any] | None = Field(None, description="In place of the problem's `start`")
    goal: dict[str, Any] | None = Field(None, description="In place of the problem's `goal`")


class PlanningChoices(StorableInput):
    """How to plan."""

    planner: Text | None = Field(None, description="Instead of the problem's; see GET /api/planners")
    options: dict[str, Any] | None = Field(None, description="Options of the planner, by name")
    seed: int | None = Field(None, ge=0, lt=2**63, strict=True, description="Instead of the problem's")
    budget: float = Field(20.0, gt=0, description="Seconds for planning and proof; servers have a limit of their own")
    warm_start: RunId | None = Field(
        None, description="Id of an earlier run of a problem not far from this one: planning begins at its motion"
    )
    deadline: float | None = Field(
        None, gt=0, le=1e6, description="Seconds from now after which no answer is wanted; the run is killed then"
    )


class Submission(ProblemInput, PlanningChoices):
    """A problem and how to plan it."""


class QueuedSubmission(Submission):
    """A submission to the queue."""

    submission: RunId | None = Field(
        None, description="Name of this submission, for cancelling it; made up where none is given"
    )


class PlanRequest(Submission):
    """A submission whose answer is waited for."""

    rate: float | None = Field(
        None,
        ge=0,
        le=2000,
        description="Samples a second in the answer's trajectory, 200 unless given; 0: its pieces alone, which are the "
        "motion, and quicker to send and to read where a motion is long",
    )


class IssueAnswer(BaseModel):
    """One thing that is wrong with an input."""

    file: str
    line: int | None
    field: str
    found: str
    expected: str


class ErrorAnswer(BaseModel):
    """Why a request is refused."""

    error: str
    issues: list[IssueAnswer] = []


class FailureAnswer(BaseModel):
    """Why a run has no motion."""

    kind: str
    detail: str
    witness: dict[str, Any] = {}


class RunAnswer(BaseModel):
    """A run: `done` has a trajectory, `failed` has a failure; only the verifier says `verified`."""

    id: RunId
    status: Literal["queued", "running", "done", "failed", "cancelled"]
    verified: bool | None = None
    failure: FailureAnswer | None = None
    timings: dict[str, Any] | None = None
    name: str
    problem: Hash
    robot: str
    planner: str
    seed: int
    budget: float
    deadline: float | None = None
    duration: float | None = None
    ratio: float | None = None
    submitted: float
    started: float | None = None
    finished: float | None = None
    page: bool = Field(False, description="Whether it left a record, which `runs/ID` shows")


class SubmittedRun(RunAnswer):
    """A run as it was submitted."""

    submission: RunId = Field(description="For cancelling: the run ends once all its submissions are taken back")


class RunList(BaseModel):
    """Runs, the last submitted first."""

    runs: list[RunAnswer]
    counts: dict[str, int]


class PlanAnswer(RunAnswer):
    """A run that was waited for, with its motion."""

    trajectory: dict[str, Any] | None = Field(
        None, description="As trajectory.json: joint_names, pieces (the motion), samples t, q, v, a"
    )


class CheckAnswer(BaseModel):
    """What a problem is, or everything that is wrong with it."""

    valid: bool
    issues: list[IssueAnswer] = []
    hash: Hash | None = None
    name: str | None = None
    robot: str | None = None


class ProblemAnswer(BaseModel):
    """A stored problem."""

    hash: Hash
    name: str
    robot: str
    created: float


class UploadAnswer(BaseModel):
    """An uploaded file."""

    file: str = Field(description="The path by which problems name it")
    bytes: int
    used: float = Field(description="When it was uploaded or used last, to some hours, s since 1970")


class UploadList(BaseModel):
    """The uploaded files, by path."""

    uploads: list[UploadAnswer]
    bytes: int = Field(description="Of all together")


class RobotAnswer(BaseModel):
    """A bundled robot."""

    name: str
    about: str


class PlannerAnswer(BaseModel):
    """A planner."""

    name: str
    about: str


class LiveRequest(ProblemInput):
    """A problem, whose start, scene and limits a controller has to keep to."""

    engine: Literal["own", "ideal"] | None = Field(
        None, description="What moves: a rigid-body plant that takes torques, or one that does as it is told"
    )


class LiveTarget(BaseModel):
    """Where the tool is wanted."""

    model_config = ConfigDict(extra="forbid")

    pose: list[Annotated[float, Field(allow_inf_nan=False, ge=-1e3, le=1e3)]] = Field(
        min_length=7, max_length=7, description="x, y, z (m) and quaternion x, y, z, w, in the world"
    )

    @model_validator(mode="after")
    def _a_pose(self) -> Self:
        if sum(x * x for x in self.pose[3:]) < 1e-12:
            raise ValueError("found a quaternion of zeros; expected one of length 1")
        return self


class LiveAnswer(BaseModel):
    """A controller that runs."""

    id: str
    engine: Literal["own", "ideal"]
    period: float = Field(description="Of the controller, s")
    joint_names: list[str]
    frame: str = Field(description="The frame that follows the target")
    velocity_limits: list[float | None] = Field(description="Of the joints, rad/s or m/s; null: none")
    clearance: float | None = Field(description="Distance that is kept, m")
    target: list[float] = Field(description="The first one, the tool's pose at the start: x, y, z, qx, qy, qz, qw")


class LiveView(LiveAnswer):
    """A controller that runs, and the problem that it was started with."""

    problem: str | dict[str, Any]


def _named(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


class BenchPlannerInput(BaseModel):
    """A planner of a bench: its name, options, and a label where the name alone is not unique."""

    model_config = ConfigDict(extra="forbid")

    name: Text
    label: Text | None = None
    options: dict[str, Any] | None = None

    @property
    def shown(self) -> str:
        """Name in the tables."""
        return self.label or self.name


class BenchRequest(StorableInput):
    """Every problem with every planner and every seed."""

    name: Text = "bench"
    problems: list[str | dict[str, Any]] = Field(
        min_length=1,
        max_length=100,
        description="Texts of problem files, their content as JSON, or hashes of stored ones",
    )
    planners: list[Annotated[BenchPlannerInput, BeforeValidator(_named)]] = Field(
        min_length=1, max_length=50, description="Names, or {name, label, options}"
    )
    seeds: list[Annotated[int, Field(ge=0, lt=2**63, strict=True)]] = Field([0], min_length=1, max_length=100)
    budget: float = Field(10.0, gt=0, description="Seconds for planning and proof of each run")


class BenchFigures(BaseModel):
    """Figures of some runs; medians and the best are of the verified ones."""

    kept: int = Field(description="Those that were not deleted")
    ended: int
    verified: int
    plan_time: float | None = Field(description="Median, s")
    ratio: float | None = Field(description="Median of duration / lower bound")
    duration: float | None = Field(description="Shortest, s")


class BenchPlannerAnswer(BenchFigures):
    """A planner of a bench."""

    planner: str


class BenchCell(BenchFigures):
    """A planner of a bench on one of its problems."""

    problem: str
    planner: str
    runs: list[str] = Field(description="Ids, by seed")
    pages: list[str] = Field(description="Those of them that left a record, which `runs/ID` shows")


class BenchProblemAnswer(BaseModel):
    """A problem of a bench."""

    name: str
    hash: Hash


class BenchAnswer(BaseModel):
    """A bench: `done` when each of its runs has ended."""

    id: str
    name: str
    created: float
    status: Literal["running", "done"]
    counts: dict[str, int] = Field(
        description="Runs by status; `deleted`, and `not queued` where queueing was cancelled or refused on the way"
    )
    budget: float
    seeds: list[int]
    problems: list[BenchProblemAnswer]
    planners: list[BenchPlannerAnswer]
    cells: list[BenchCell]
