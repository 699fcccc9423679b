"""The schema of tools in a problem file."""

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from optiplan.config.document import Strict
from optiplan.config.values import Length, Name, Vector
from optiplan.geometry.pose import PoseSpec
from optiplan.geometry.shapes import ShapeSpec
from optiplan.problem.schema.scene import LARGEST_MASS, bounded, check_weight

LONGEST = 3.0
"""m from the link to the TCP; a longer tool was meant in mm."""


class ToolShapeSpec(Strict):
    """A body of a tool, at `pose` in the frame of its link; named like the tool, and numbered, without a `name`."""

    name: Name | None = None
    shape: Annotated[ShapeSpec, AfterValidator(bounded)]
    pose: PoseSpec = PoseSpec.model_construct()


def _near(pose: PoseSpec) -> PoseSpec:
    far = max(map(abs, pose.position))
    if far > LONGEST:
        raise ValueError(f"found a TCP {far:g} m from the link; expected metres, at most {LONGEST:g}")
    return pose


class ToolSpec(Strict):
    """A tool on `link`: its TCP, its bodies and its mass, all in the frame of the link.

    `tcp` is the pose of its TCP, a frame of the tool's name. The bodies may touch the links of `touch`, and `link`.
    `mass` in kg, with its `centre` (m) and `inertia` about that ([ixx, iyy, izz], kg m²) along the axes of the link;
    without these the bodies are filled evenly. `parked` is the pose of the link in the world at which the tool is taken
    and left; without one it is nowhere while it is not mounted.
    """

    link: Name
    tcp: Annotated[PoseSpec, AfterValidator(_near)] = PoseSpec.model_construct()
    shapes: tuple[ToolShapeSpec, ...] = ()
    touch: tuple[Name, ...] = ()
    mass: Annotated[Length, Field(le=LARGEST_MASS)] | None = None
    centre: Vector | None = None
    inertia: Vector | None = None
    parked: PoseSpec | None = None

    def bodies_of(self, name: str) -> list[str]:
        """Return the names of the bodies of a tool of this name."""
        return [one.name or (name if k == 0 else f"{name}_{k + 1}") for k, one in enumerate(self.shapes)]

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_weight(self.mass, self.centre, self.inertia)
        if self.mass is not None and not self.shapes:
            raise ValueError(
                "found a mass of a tool without bodies; expected `shapes` too: what is heavy is in the way"
            )
        return self


class FirstToolSpec(ToolSpec):
    """The tool that is mounted at the start, where no other is needed; `name` of its own, `tool` without one."""

    name: Name = "tool"


Tools = Annotated[dict[Name, ToolSpec], Field(min_length=1)]
"""Tools by name."""
