"""How far the measured robot is from its set-points."""

from collections.abc import Sequence

import numpy as np

from optiplan.execution.arguments import numbers, told
from optiplan.execution.path_laws import SetPoint
from optiplan.trajectory.state import State


class TrackingMonitor:
    """Compare measured positions with set-points.

    Args:
        most: how far a joint may be from its set-point, rad or m; None: anything.

    Attributes:
        deviation: the largest so far, rad or m; None without measurements.
    """

    def __init__(self, most: float | None) -> None:
        self._most = most
        self.deviation: float | None = None

    def compare(self, measured: object, point: SetPoint, joint_names: Sequence[str]) -> str:
        """Return why the robot must stop, or nothing."""
        q = numbers(measured.q if isinstance(measured, State) else measured)
        if q.shape != point.q.shape or not np.isfinite(q).all():
            return f"measured: found {told(measured)}; expected {len(point.q)} finite positions"
        off = np.abs(q - point.q)
        self.deviation = max(self.deviation or 0.0, float(off.max()))
        if self._most is not None and off.max() > self._most:
            joint = joint_names[int(off.argmax())]
            return f"{joint} is {off.max():.4g} from its set-point, farther than {self._most:g}"
        return ""
