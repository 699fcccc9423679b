"""Path constraints on speeds, joints and distances: what stands under each key, and what it states."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from optiplan.config.document import Number, Strict
from optiplan.config.values import Length, Name, NamePair
from optiplan.problem.constraints.base import WHOLE, ConstraintSpec, During, Mention, Part, Statement


@dataclass(frozen=True, eq=False)
class _ToolRate:
    """A bound on how a frame moves and turns."""

    frame: str
    linear: float = np.inf
    angular: float = np.inf
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, *_rates(data), during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {name: getattr(self, name) for name in ("linear", "angular") if np.isfinite(getattr(self, name))}


class ToolSpeedSpec(ConstraintSpec):
    """The frame moves no faster than `linear`, m/s, and turns no faster than `angular`, rad/s."""

    linear: Length | None = None
    angular: Length | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.linear is None and self.angular is None:
            raise ValueError("found neither; expected linear, angular, or both")
        return self


@dataclass(frozen=True, eq=False)
class ToolSpeed(_ToolRate, Statement):
    """A frame moves and turns no faster than this.

    Attributes:
        frame: a link or fixed frame of the robot.
        linear: of its origin, m/s; infinite: any.
        angular: rad/s; infinite: any.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "tool_speed"


class ToolAccelerationSpec(ToolSpeedSpec):
    """The frame's acceleration is at most `linear`, m/s², its angular acceleration at most `angular`, rad/s²."""


@dataclass(frozen=True, eq=False)
class ToolAcceleration(_ToolRate, Statement):
    """A frame is accelerated no more than this.

    Attributes:
        frame: a link or fixed frame of the robot.
        linear: of its origin, m/s²; infinite: any.
        angular: rad/s²; infinite: any.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "tool_acceleration"


class PairClearanceSpec(Strict):
    """Pairs of bodies stay farther apart than `at_least`, m."""

    pairs: Annotated[tuple[NamePair, ...], Field(min_length=1)]
    at_least: Length
    during: Part | None = None


@dataclass(frozen=True, eq=False)
class PairClearance(Statement):
    """Pairs of bodies, by name, stay farther apart than this.

    Attributes:
        pairs: of links, obstacles and attached objects.
        at_least: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "clearance"

    pairs: tuple[tuple[str, str], ...]
    at_least: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(tuple((a, b) for a, b in data["pairs"]), data["at_least"], during)

    def mentioned(self) -> list[Mention]:
        """Return the bodies."""
        return [Mention(("pairs", i), "body", name) for i, pair in enumerate(self.pairs) for name in pair]


class ManipulabilitySpec(ConstraintSpec):
    """Yoshikawa's measure of the frame's Jacobian is at least this."""

    at_least: Length


@dataclass(frozen=True, eq=False)
class ManipulabilityAbove(Statement):
    """Yoshikawa's measure of a frame's Jacobian, sqrt(det(J J^T)), stays above a value: away from singularities.

    Attributes:
        frame: a link or fixed frame of the robot.
        at_least: of m and rad, as J has them.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "manipulability"

    frame: str
    at_least: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, data["at_least"], during)


class JointCouplingSpec(Strict):
    """A sum of joint positions: |sum of coefficient · q - equals| <= within."""

    joints: Annotated[dict[Name, Number], Field(min_length=1)]
    equals: Number = 0.0
    within: Length
    during: Part | None = None


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

    joints: Mapping[str, float]
    equals: float
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(dict(data["joints"]), data["equals"], data["within"], during)

    def mentioned(self) -> list[Mention]:
        """Return the joints."""
        return [Mention(("joints", name), "joint", name) for name in self.joints]


class WheelSpeedSpec(Strict):
    """No mecanum wheel of the robot turns faster than `at_most`, rad/s."""

    at_most: Length
    during: Part | None = None


@dataclass(frozen=True, eq=False)
class WheelSpeed(Statement):
    """The mecanum wheels of the robot turn no faster than this.

    Attributes:
        at_most: rad/s.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "wheel_speed"

    at_most: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(data["at_most"], during)


def _rates(data: Mapping[str, Any]) -> tuple[float, float]:
    linear, angular = (np.inf if data.get(name) is None else float(data[name]) for name in ("linear", "angular"))
    return linear, angular
