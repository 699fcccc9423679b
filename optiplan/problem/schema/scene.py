"""The schema of a scene in a problem file: obstacles, attached objects, what may touch."""

from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from optiplan.config.built_later import BuiltLater
from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Direction, Length, Name, NamePair, NotNegative, Vector
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.pose import PoseSpec
from optiplan.geometry.shapes import SHAPES, ShapeSpec

LARGEST_MASS = 1e6
"""kg; nothing that an arm can hold."""

WORLD = "world"
TOOL = "tool"
OF_LINES = (WORLD, TOOL)
"""What the direction of a line is said in, unless that moves: no frame has these names, nor what moves."""

Polynomial = Annotated[tuple[Coordinate, ...], Field(min_length=1, max_length=10)]
"""Coefficients in ascending powers."""


class TurnSpec(Strict):
    """A turn about an `axis` of the world through `about`, m: the `angle` is a polynomial of time, rad/s^k.

    Without `about` the axis passes through the position of the pose.
    """

    axis: Direction
    angle: Polynomial
    about: Vector | None = None


class MotionSpec(Strict):
    """A displacement, added to the position of the pose: one polynomial of time for each of x, y and z of the world.

    `polynomial` has their coefficients in ascending powers, m/s^k; time counts from the start of the robot's motion.
    `turn` turns the pose before that. After `until`, s, the obstacle stands.
    """

    polynomial: Annotated[tuple[Polynomial, ...], Field(min_length=3, max_length=3)] | None = None
    turn: TurnSpec | None = None
    until: Length | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.polynomial is None and self.turn is None:
            raise ValueError("found neither polynomial nor turn; expected at least one of them")
        return self

    def about(self, position: Sequence[float]) -> ObstacleMotion:
        """Return the motion of what stands at a position, m."""
        turn = None if self.turn is None else {"about": position, **self.turn.model_dump(exclude_none=True)}
        return ObstacleMotion.of_data(self.polynomial, self.until, turn)


class MovingFrameSpec(PoseSpec):
    """A frame that moves: its pose in the world, and the motion of all that is in it."""

    motion: MotionSpec


class ObstacleSpec(Strict):
    """A shape that stands still at `pose` in the world, or moves from there as stated; it is a frame of its name."""

    name: Name
    shape: ShapeSpec
    pose: PoseSpec = PoseSpec.model_construct()
    motion: MotionSpec | None = None

    @model_validator(mode="after")
    def _own_name(self) -> Self:
        if self.name == WORLD or (self.motion is not None and self.name in OF_LINES):
            raise ValueError(f"found an obstacle called {self.name}; expected another name, since poses are `in` it")
        return self

    @model_validator(mode="after")
    def _bounded_motion(self) -> Self:
        if self.motion is not None and SHAPES[self.shape.kind].endless:
            raise ValueError(f"found a {self.shape.kind} that moves; expected a shape that ends somewhere")
        return self


def bounded(shape: ShapeSpec) -> ShapeSpec:
    """Require a shape that ends somewhere.

    Raises:
        ValueError: a half-space.
    """
    if SHAPES[shape.kind].endless:
        raise ValueError(f"found a {shape.kind}; expected a shape that ends somewhere: no robot can carry a half-space")
    return shape


def check_weight(mass: float | None, centre: Sequence[float] | None, inertia: Sequence[float] | None) -> None:
    """Require a mass where there is a centre or an inertia, and moments [ixx, iyy, izz] that a body can have.

    Raises:
        ValueError: what was found and expected.
    """
    if mass is None and (centre is not None or inertia is not None):
        raise ValueError("found a centre or an inertia of what has no mass; expected `mass` too")
    if inertia is not None:
        x, y, z = inertia
        if min(x, y, z) < 0.0 or max(x, y, z) > 0.5 * (x + y + z) * (1.0 + 1e-9):
            expected = "moments, none larger than the other two together"
            raise ValueError(f"found inertia {list(inertia)}; expected {expected}")


class AttachedSpec(Strict):
    """A shape held by `link`; `pose` in the link's frame; it may touch the links of `touch`, and `link`.

    `mass` in kg, none without; its `centre` (m) and `inertia` about that ([ixx, iyy, izz], kg m²) in the frame of the
    shape are those of the shape filled evenly, where they are not given.
    """

    name: Name
    shape: Annotated[ShapeSpec, AfterValidator(bounded)]
    link: Name
    pose: PoseSpec = PoseSpec.model_construct()
    touch: tuple[Name, ...] = ()
    mass: Annotated[NotNegative, Field(le=LARGEST_MASS)] | None = None
    centre: Vector | None = None
    inertia: Vector | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_weight(self.mass, self.centre, self.inertia)
        return self


class SceneSpec(Strict):
    """Obstacles, attached objects, and the pairs of bodies that may touch."""

    obstacles: Annotated[tuple[ObstacleSpec, ...], BuiltLater()] = ()
    attached: Annotated[tuple[AttachedSpec, ...], BuiltLater()] = ()
    allowed_collisions: tuple[NamePair, ...] = ()
