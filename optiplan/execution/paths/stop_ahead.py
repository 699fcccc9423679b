"""The stop along the path that a driver keeps, in case that no further set-point comes."""

from typing import TYPE_CHECKING

import numpy as np

from optiplan.arrays import Array
from optiplan.execution.paths.path_laws import PathLaws, PathPlace
from optiplan.execution.status import Ahead

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

SPACING = 8e-3
"""s between two samples; quintic polynomials of q, v and a between them are 3e-6 rad off with the jerk of a Panda."""

NEAR_END = 0.25
"""s: a motion that ends so soon after the lead goes on to its end, about as soon as a stop would end."""

MOST_SAMPLES = 256

LATER = 4e-3
"""s: where limits leave no room for a stop, it is tried this much later, and then after twice as long each time."""


def way_ahead(laws: PathLaws, law: "TimeLaw", now: float, lead: float) -> Ahead:
    """Return the way of a law for `lead` s from now on, and from there the stop along the path.

    The stop begins later where limits leave no room for it. A law that ends at rest, or at the end of the motion soon,
    is a stop itself.

    Holds at: all times, for the limits of joints; between samples up to their interpolation.
    """
    turn, later = now + lead, LATER
    ends = law.target == 0.0 or law.at(turn + NEAR_END)[0] >= laws.length
    stop = law if ends else None
    while stop is None and law.at(turn)[0] < laws.length:
        found = laws.change(PathPlace(*law.at(turn)), turn, 0.0)
        if found is not None and found.target == 0.0:
            stop = found
        else:
            turn, later = turn + later, 2.0 * later
    stop = law if stop is None else stop  # which ends at rest with the motion
    end = max(turn, stop.settled, now + SPACING) if stop.target == 0.0 else turn + NEAR_END
    count = int(np.clip(np.ceil((end - now) / SPACING), 2, MOST_SAMPLES))
    t: Array = np.linspace(now, end, count + 1)
    points = [laws.set_point(law if one < turn else stop, one) for one in t]
    q, v, a = (np.array([getattr(point, name) for point in points]) for name in ("q", "v", "a"))
    return Ahead(t, q, v, a, turn, law, stop)
