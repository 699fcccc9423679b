"""The schema of a control file, `version: 1`; SI units and radians throughout.

These classes hold what the file says, after checks that need nothing but the file itself.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from optiplan.config.document import Number, Strict, Whole
from optiplan.config.messages import choices
from optiplan.config.values import ExactlyOne, FileName, FileVersion, Name, NotNegative, Vector
from optiplan.geometry.pose import PoseSpec
from optiplan.simulation.plants.imperfections import MOST_DELAY

Seconds = Annotated[float, Field(strict=True, gt=0.0, le=86_400.0, allow_inf_nan=False)]
Hertz = Annotated[float, Field(strict=True, gt=0.0, le=1e5, allow_inf_nan=False)]
PerJoint = NotNegative | tuple[NotNegative, ...]
"""One value for all planned joints, or one for each."""


class PlanSpec(Strict):
    """Follow what a planner finds for the problem; `planner` and `options` as in a problem file, `budget` in s."""

    planner: Name | None = None
    options: dict[str, Any] | None = None
    budget: Seconds = 20.0


class StepSpec(Strict):
    """At `at`, s, one joint (`joint`, `by`) or all (`to`) are wanted elsewhere at once; it lasts `lasting`, s."""

    joint: Name | None = None
    by: Number | None = None
    to: tuple[Number, ...] | dict[Name, Number] | None = None
    at: NotNegative = 0.1
    lasting: Seconds = 2.0

    @model_validator(mode="after")
    def _one(self) -> Self:
        one = self.joint is not None and self.by is not None and self.to is None
        if not one and not (self.to is not None and self.joint is None and self.by is None):
            raise ValueError("found neither; expected `joint` and `by`, or `to` with one value a joint")
        return self


class EndSpec(PoseSpec):
    """A pose in the world; without an orientation that of the start is kept."""

    position: Vector


class LineSpec(Strict):
    """A straight line `to` a pose, or `by` a displacement, m, along the world's axes, in `duration`, s."""

    to: EndSpec | None = None
    by: Vector | None = None
    duration: Seconds
    frame: Name | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.to is None) == (self.by is None):
            raise ValueError(f"found {'neither' if self.to is None else 'both'}; expected one of: to, by")
        return self


class ArcSpec(Strict):
    """An arc `through` a point `to` a pose."""

    through: Vector
    to: EndSpec
    duration: Seconds
    frame: Name | None = None


class CircleSpec(Strict):
    """Whole turns about the axis `normal` through `centre`, starting where the tool is."""

    centre: Vector
    normal: Vector
    turns: Whole = 1
    orientation: Literal["kept", "following"] = "kept"
    duration: Seconds
    frame: Name | None = None

    @model_validator(mode="after")
    def _turning(self) -> Self:
        if not any(self.normal):
            raise ValueError("found the normal [0, 0, 0]; expected a direction")
        if self.turns == 0:
            raise ValueError("found 0 turns; expected a whole number other than 0")
        return self


class ScrewSpec(Strict):
    """One screw `to` a pose; or turning by `angle`, rad, about `axis` through `point`, sliding by `slide`, m."""

    to: EndSpec | None = None
    axis: Vector | None = None
    point: Vector | None = None
    angle: Number = 0.0
    slide: Number = 0.0
    duration: Seconds
    frame: Name | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        about = self.axis is not None and self.point is not None and any(self.axis)
        if (self.to is None) != about:
            raise ValueError("found neither a pose nor an axis, or both; expected `to`, or `axis` and `point`")
        ignored = sorted({"axis", "point", "angle", "slide"} & self.model_fields_set)
        if self.to is not None and ignored:
            raise ValueError(f"found to and {', '.join(ignored)}; expected `to` alone, or `axis` and `point`")
        return self


class MovingSpec(Strict):
    """A target that swings by `amplitude`, m, at `frequency`, Hz, each along the world's axes, for `lasting`, s."""

    amplitude: Vector
    frequency: Vector
    phase: Vector = (0.0, 0.0, 0.0)
    lasting: Seconds
    frame: Name | None = None


class RecordedSpec(Strict):
    """Poses of a CSV file with the columns t, x, y, z, qx, qy, qz, qw (s, m, unit quaternion)."""

    file: FileName
    frame: Name | None = None


class ReferenceSpec(ExactlyOne):
    """What to follow: `plan`, `trajectory` (a run folder or file) and `step` move joints, the others the tool."""

    plan: PlanSpec | None = None
    trajectory: FileName | None = None
    step: StepSpec | None = None
    line: LineSpec | None = None
    arc: ArcSpec | None = None
    circle: CircleSpec | None = None
    screw: ScrewSpec | None = None
    moving: MovingSpec | None = None
    recorded: RecordedSpec | None = None


class PidSpec(Strict):
    """Gains of each joint: N·m/rad, N·m/(rad s), N·m·s/rad; `integral_limit` in N·m."""

    p: PerJoint
    i: PerJoint = 0.0
    d: PerJoint = 0.0
    integral_limit: PerJoint | None = None
    gravity_compensation: Annotated[bool, Field(strict=True)] = False


class ComputedTorqueSpec(Strict):
    """Errors die out at `frequency`, Hz, with the damping ratio `damping`."""

    frequency: Hertz = 10.0
    damping: NotNegative = 1.0


class DriveSpec(Strict):
    """Drives with loops of their own, which are given velocities or positions.

    `position`, 1/s, is the gain of the position error, `velocity`, N·m·s/rad, and `integral`, N·m/rad, those of the
    error of the velocity; `integral_limit` in N·m. Drives that take positions know no velocity of the reference.
    """

    takes: Literal["velocity", "position"]
    position: PerJoint
    velocity: PerJoint
    integral: PerJoint = 0.0
    integral_limit: PerJoint | None = None
    gravity_compensation: Annotated[bool, Field(strict=True)] = False


class VelocitySpec(Strict):
    """Gain of the position error, 1/s."""

    gain: NotNegative = 10.0


def _known_solver(name: str) -> str:
    from optiplan.control.qp.solvers import solver_names

    if name not in solver_names():
        raise ValueError(f"found '{name}'; expected {choices(name, solver_names())}")
    return name


SolverName = Annotated[Name, AfterValidator(_known_solver)]
"""A solver of quadratic programs that is installed."""


class TaskSpaceSpec(Strict):
    """The task-space controller of `optiplan.control` (op.Controller).

    `feedback` says what a step starts from: `commanded`, the state commanded before, which computed torque
    (`frequency`, `damping`) makes the robot follow; or `measured`, whose accelerations become torques as they are.
    `solver` is `native` (an active set that begins at the limits of the last step, ProxQP where that fails), or one
    that is asked in every step: `proxqp`, or another that qpsolvers finds.
    `gain`, 1/s, is that of the pose; null: as large as the robot's jerk limits allow.
    `clearance` is the least distance, m, kept from everything; null: not looked after. `response` is the time, s, with
    which velocities follow what the tasks ask for; null: what the robot's jerk limits allow.
    """

    form: Literal["velocity", "acceleration"] = "velocity"
    solver: SolverName = "native"
    feedback: Literal["commanded", "measured"] = "commanded"
    position_cost: NotNegative = 1.0
    orientation_cost: NotNegative = 1.0
    posture_cost: NotNegative = 1e-3
    gain: NotNegative | None = None
    clearance: NotNegative | None = 0.005
    response: NotNegative | None = None
    frequency: Hertz = 10.0
    damping: NotNegative = 1.0


class ControllerSpec(ExactlyOne):
    """One controller with its settings."""

    pid: PidSpec | None = None
    drive: DriveSpec | None = None
    computed_torque: ComputedTorqueSpec | None = None
    velocity: VelocitySpec | None = None
    task_space: TaskSpaceSpec | None = None


class FrictionSpec(Strict):
    """`viscous`, N·m·s/rad, and `coulomb`, N·m, of each joint."""

    viscous: PerJoint = 0.0
    coulomb: PerJoint = 0.0


class PayloadSpec(Strict):
    """`mass`, kg, at `centre`, m, in the tool frame; `assumed`: what the controller takes it for, else the mass."""

    mass: NotNegative
    assumed: NotNegative | None = None
    centre: Vector = (0.0, 0.0, 0.0)


class NoiseSpec(Strict):
    """Standard deviations of measured positions, rad or m, and velocities, a second."""

    position: NotNegative = 0.0
    velocity: NotNegative = 0.0


class PlantSpec(Strict):
    """What moves, and what is wrong with it."""

    engine: Literal["own", "mujoco", "ideal"] = "own"
    step: Seconds = 2.5e-4
    friction: FrictionSpec = FrictionSpec.model_construct()
    rotor_inertia: PerJoint = 0.0
    payload: PayloadSpec | None = None
    delay: Annotated[NotNegative, Field(le=MOST_DELAY)] = 0.0
    encoder: NotNegative = 0.0
    noise: NoiseSpec = NoiseSpec.model_construct()
    velocity_filter: Hertz = 100.0


class PushSpec(Strict):
    """A `force`, N, and a `torque`, N·m, on the tool from `at` for `lasting`, s, along the world's axes."""

    at: NotNegative
    lasting: Seconds
    force: Vector = (0.0, 0.0, 0.0)
    torque: Vector = (0.0, 0.0, 0.0)


OF_PROBLEM = ("robot", "robots", "group", "locked", "base", "gravity", "start", "scene", "limits")
"""Keys of a problem file that may stand in a control file, instead of `problem`."""


class ControlSpec(Strict):
    """A control file: robot and scene, as a `problem` or by its keys, a reference, a controller and a plant.

    `rate` is the controller's, Hz; the loop runs on for `settle`, s, after the end of the reference.
    """

    version: FileVersion
    name: Name | None = None
    problem: FileName | None = None
    robot: Any = None
    robots: Any = None
    group: Any = None
    locked: Any = None
    base: Any = None
    gravity: Any = None
    start: Any = None
    scene: Any = None
    limits: Any = None
    reference: ReferenceSpec
    controller: ControllerSpec
    plant: PlantSpec = PlantSpec.model_construct()
    rate: Hertz = 1000.0
    settle: NotNegative = 0.2
    disturbances: tuple[PushSpec, ...] = ()
    seed: Annotated[Whole, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _one_robot(self) -> Self:
        own = [key for key in OF_PROBLEM if key in self.model_fields_set]
        if self.problem is None and not ("start" in own and {"robot", "robots"} & set(own)):
            raise ValueError("found no problem; expected `problem`, or `robot` (or `robots`) and `start`")
        if self.problem is not None and own:
            raise ValueError(f"found problem and {own[0]}; expected the problem, or its keys")
        return self
