"""The schema of grasps in a problem file."""

from typing import Annotated, Literal

from pydantic import Field

from optiplan.config.document import Strict, Whole
from optiplan.config.values import Length, Name


class GraspsSpec(Strict):
    """Every grasp of an `object`, a box or a cylinder, by two parallel fingers that open to `opening`, m.

    The fingers close along the axis `closing` of `frame` (default: the tool frame), whose origin is between their tips.
    It goes `depth`, m, below the surface, to the middle of the object without it, at most 30 mm. `turns` directions are
    tried about the axis of a cylinder.
    """

    object: Name
    opening: Length
    closing: Literal["x", "y", "z"] = "y"
    depth: Length | None = None
    turns: Annotated[Whole, Field(ge=1, le=72)] = 8
    frame: Name | None = None
