"""The keys of path constraints in a problem file."""

from optiplan.config.values import ExactlyOne
from optiplan.problem.constraints.motions import (
    JointCouplingSpec,
    ManipulabilitySpec,
    PairClearanceSpec,
    ToolAccelerationSpec,
    ToolSpeedSpec,
    WheelSpeedSpec,
)
from optiplan.problem.constraints.points import OnArcSpec, OnCircleSpec, OnLineSpec, OnPlaneSpec, PositionBoxSpec
from optiplan.problem.constraints.poses import (
    FixedOrientationSpec,
    LookAtSpec,
    OnScrewSpec,
    OrientationConeSpec,
    RelativePoseSpec,
)


class PathConstraintSpec(ExactlyOne):
    """One constraint on the path."""

    orientation: OrientationConeSpec | None = None
    position: PositionBoxSpec | None = None
    plane: OnPlaneSpec | None = None
    line: OnLineSpec | None = None
    tool_speed: ToolSpeedSpec | None = None
    clearance: PairClearanceSpec | None = None
    relative_pose: RelativePoseSpec | None = None
    fixed_orientation: FixedOrientationSpec | None = None
    look_at: LookAtSpec | None = None
    arc: OnArcSpec | None = None
    circle: OnCircleSpec | None = None
    screw: OnScrewSpec | None = None
    tool_acceleration: ToolAccelerationSpec | None = None
    manipulability: ManipulabilitySpec | None = None
    coupling: JointCouplingSpec | None = None
    wheel_speed: WheelSpeedSpec | None = None
