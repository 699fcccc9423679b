"""Path constraints on speeds, joints and distances."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from pydantic import Field

from optiplan.config.document import Number
from optiplan.config.values import Length, Name, NamePair
from optiplan.problem.constraints.base import WHOLE, Distance, During, Frame, Key, Mention, Statement
from optiplan.records import dataclass

Rate: TypeAlias = Annotated[
    float,
    Key(
        Length | None,
        lambda said: np.inf if said is None else said,
        lambda rate: rate if np.isfinite(rate) else None,
        default=None,
    ),
]
"""A number > 0; infinite, and left out in a file: any."""


@dataclass(frozen=True, eq=False)
class _ToolRate(Statement):
    """A bound on how a frame moves and turns."""

    frame: Frame
    linear: Rate = np.inf
    angular: Rate = np.inf
    during: During = WHOLE

    @classmethod
    def consistent(cls, stated: Any) -> Any:
        """Return what stands in a file, if it bounds something."""
        if stated.linear is None and stated.angular is None:
            raise ValueError("found neither; expected linear, angular, or both")
        return stated


@dataclass(frozen=True, eq=False)
class ToolSpeed(_ToolRate):
    """A frame moves and turns no faster than this.

    Attributes:
        frame: a link or fixed frame of the robot.
        linear: of its origin, m/s; infinite: any.
        angular: rad/s; infinite: any.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "tool_speed"


@dataclass(frozen=True, eq=False)
class ToolAcceleration(_ToolRate):
    """A frame is accelerated no more than this.

    Attributes:
        frame: a link or fixed frame of the robot.
        linear: of its origin, m/s²; infinite: any.
        angular: rad/s²; infinite: any.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "tool_acceleration"


@dataclass(frozen=True, eq=False)
class PairClearance(Statement):
    """Pairs of bodies, by name, stay farther apart than this.

    Attributes:
        pairs: of links, obstacles and attached objects.
        at_least: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "clearance"

    pairs: Annotated[tuple[tuple[str, str], ...], Key(Annotated[tuple[NamePair, ...], Field(min_length=1)])]
    at_least: Distance
    during: During = WHOLE

    def mentioned(self) -> list[Mention]:
        """Return the bodies."""
        return [Mention(("pairs", i), "body", name) for i, pair in enumerate(self.pairs) for name in pair]


@dataclass(frozen=True, eq=False)
class ManipulabilityAbove(Statement):
    """Yoshikawa's measure of a frame's Jacobian, sqrt(det(J J^T)), stays above a value: away from singularities.

    Attributes:
        frame: a link or fixed frame of the robot.
        at_least: of m and rad, as J has them.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "manipulability"

    frame: Frame
    at_least: Distance
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class JointCoupling(Statement):
    """A sum of joint positions keeps its value: |sum_j c_j q_j - equals| <= within.

    Attributes:
        joints: c_j by the name of the joint.
        equals: rad or m.
        within: rad or m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "coupling"

    joints: Annotated[Mapping[str, float], Key(Annotated[dict[Name, Number], Field(min_length=1)])]
    equals: Annotated[float, Key(Number, default=0.0)]
    within: Distance
    during: During = WHOLE

    def mentioned(self) -> list[Mention]:
        """Return the joints."""
        return [Mention(("joints", name), "joint", name) for name in self.joints]


@dataclass(frozen=True, eq=False)
class WheelSpeed(Statement):
    """The mecanum wheels of the robot turn no faster than this.

    Attributes:
        at_most: rad/s.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "wheel_speed"

    at_most: Distance
    during: During = WHOLE
