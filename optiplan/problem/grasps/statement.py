"""`Grasps` for construction in Python, checked by the schema of problem files."""

from typing import Any

from optiplan.config.document import plain
from optiplan.geometry.pose import checked
from optiplan.problem.schema.task import GraspsSpec
from optiplan.records import dataclass


@dataclass(frozen=True)
class Grasps:
    """Every grasp of a box or cylinder by two parallel fingers: ends of an approach, see `Task.approach`.

    Attributes:
        object: name of an obstacle that is where the scene puts it.
        opening: greatest distance between the fingers, m.
        closing: axis of the frame along which the fingers close: `x`, `y` or `z`.
        depth: of the frame's origin below the surface, m; None: to the middle of the object, at most 30 mm.
        turns: directions that are tried about the axis of a cylinder.
        frame: whose origin is between the fingertips; None: the tool frame.

    Raises:
        InputError: a value that does not fit.

    Example:
        >>> import optiplan as op
        >>> op.Task().approach(op.Grasps("can", opening=0.08), 0.1).attach("can", "panda_hand")
        Task: approach, attach can
    """

    object: str
    opening: float
    closing: str = "y"
    depth: float | None = None
    turns: int = 8
    frame: str | None = None

    def __post_init__(self) -> None:
        checked(GraspsSpec, self.to_data(), "Grasps", {})

    def to_data(self) -> dict[str, Any]:
        """As a problem file says it."""
        return {key: plain(value) for key, value in vars(self).items() if value is not None}
