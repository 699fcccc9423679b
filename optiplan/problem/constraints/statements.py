"""Path constraints: what holds during the whole motion, or a part of it."""

from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import AfterValidator, create_model

from optiplan.config.values import ExactlyOne
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.constraints.base import Statement
from optiplan.problem.constraints.motions import (
    JointCoupling,
    ManipulabilityAbove,
    PairClearance,
    ToolAcceleration,
    ToolSpeed,
    WheelSpeed,
)
from optiplan.problem.constraints.points import OnArc, OnCircle, OnLine, OnPlane, PositionBox
from optiplan.problem.constraints.poses import FixedOrientation, LookAt, OnScrew, OrientationCone, RelativePose

PathConstraint: TypeAlias = Statement
"""Any statement of `KINDS`."""

KINDS: dict[str, type[Statement]] = {
    kind.KEY: kind
    for kind in (
        OrientationCone,
        PositionBox,
        OnPlane,
        OnLine,
        ToolSpeed,
        PairClearance,
        RelativePose,
        FixedOrientation,
        LookAt,
        OnArc,
        OnCircle,
        OnScrew,
        ToolAcceleration,
        ManipulabilityAbove,
        JointCoupling,
        WheelSpeed,
        TipOver,
    )
}
"""Classes of constraints by their key in a problem file."""

BY_SCENE = PairClearance, TipOver
"""Constraints whose meaning depends on what there is, and on what is held with which mass, at each time."""

_SPECS: dict[str, Any] = {
    key: (Annotated[kind.spec(), AfterValidator(kind.consistent)] | None, None) for key, kind in KINDS.items()
}

if TYPE_CHECKING:
    PathConstraintSpec: TypeAlias = ExactlyOne
else:
    PathConstraintSpec = create_model(
        "PathConstraintSpec", __base__=ExactlyOne, __doc__="One constraint on the path.", **_SPECS
    )


def frame_of(one: PathConstraint) -> str | None:
    """Return the frame that a constraint is about, if it is about one."""
    frame: str | None = getattr(one, "frame", None)
    return frame
