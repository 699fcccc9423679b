"""`arc` (moveC): the tool moves along a circle to the goal's position, through a point or about a centre."""

from functools import partial

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.planners.cartesian.base import ToolMotion, ToolMotionOptions
from optiplan.planners.cartesian.tool_path import ToolPath, angle_about, arc, circle_through
from optiplan.planners.option_schema import OptionError, option, option_error
from optiplan.records import dataclass

_OFF = 1e-3  # m or rad: largest deviation of a given centre, normal or angle from one that fits exactly
_SHORTEST = 1e-6  # m: ends of an arc that are nearer are one point

_error = partial(option_error, "arc")


@dataclass(frozen=True)
class ArcOptions(ToolMotionOptions):
    """Also the arc between the start's and the goal's position: `through` a point, or about a `centre`."""

    through: tuple[float, ...] | None = option(None, "(3,) m, a point on the way.", size=3)
    centre: tuple[float, ...] | None = option(None, "(3,) m; as far from the start as from the goal.", size=3)
    angle: float | None = option(
        None, "rad; without it, the short way. With it the long way, or more turns; it must lead to the goal."
    )
    normal: tuple[float, ...] | None = option(
        None, "(3,) of any length: what it turns about; needed where start, centre and goal are in line.", size=3
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.through is None) == (self.centre is None):
            found = "neither through nor centre" if self.centre is None else "both through and centre"
            raise OptionError("through", found, "one of them")
        if self.centre is None and not (self.angle is None and self.normal is None):
            raise OptionError("normal" if self.angle is None else "angle", "given without a centre", "a centre as well")
        if self.normal is not None and not np.any(self.normal):
            raise OptionError("normal", "[0, 0, 0]", "a direction")


class Arc(ToolMotion[ArcOptions]):
    """Planner of one circular arc of the tool."""

    Options = ArcOptions

    def path(self, start: pin.SE3, goal: pin.SE3, tolerance: tuple[float, float]) -> ToolPath:
        """Round to the goal; the orientation turns evenly from the one to the other along the shortest way.

        Raises:
            InputError: no such arc ends at the goal.
        """
        a, b = start.translation, goal.translation
        if np.linalg.norm(b - a) < _SHORTEST:
            raise _error(
                "goal", "the start's position", "another position; the planner 'circle' goes all the way round"
            )
        if self.options.through is None:
            return arc(start, goal, *self._about(a, b))
        point = np.array(self.options.through)
        if min(np.linalg.norm(point - a), np.linalg.norm(point - b)) < _SHORTEST:
            raise _error("through", f"{point.tolist()}, an end of the arc", "a point between start and goal")
        found = circle_through(a, point, b)
        if found is None:
            raise _error("through", f"{point.tolist()}, in line with start and goal", "a point beside that line")
        return arc(start, goal, *found)

    def _about(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Centre (3,), moved to where it fits exactly, and rotation vector (3,), rad, from point a to b."""
        given, chord = np.array(self.options.centre), (b - a) / np.linalg.norm(b - a)
        normal = self._normal(a - given, b - given, chord)
        centre = given - normal * (normal @ (given - a)) - chord * (chord @ (given - 0.5 * (a + b)))
        if np.linalg.norm(centre - given) > _OFF:
            found = (
                f"{np.linalg.norm(given - a):.6g} m from the start and {np.linalg.norm(given - b):.6g} m from the goal"
            )
            raise _error("centre", found, f"a point as far from both, such as {np.round(centre, 6).tolist()}")
        return centre, normal * self._angle(angle_about(normal, a - centre, b - centre))

    def _normal(self, to_a: Array, to_b: Array, chord: Array) -> Array:
        """Unit vector perpendicular to the chord: the one given, or that of the short way."""
        if self.options.normal is None:
            normal = np.cross(to_a, to_b)
            if np.linalg.norm(normal) <= _OFF * np.linalg.norm(to_a) * np.linalg.norm(to_b):
                raise _error("normal", "nothing, with start, centre and goal in line", "the direction to turn about")
            return np.asarray(normal / np.linalg.norm(normal))
        normal = np.array(self.options.normal) / np.linalg.norm(self.options.normal)
        across = normal - chord * (normal @ chord)
        if abs(normal @ chord) > _OFF:
            other = np.cross(chord, np.eye(3)[np.abs(chord).argmin()])
            fits = np.round(across if np.linalg.norm(across) > 0.1 else other, 6) + 0.0
            expected = f"one across the way to the goal, such as {fits.tolist()}"
            raise _error("normal", f"{list(self.options.normal)}", expected)
        return np.asarray(across / np.linalg.norm(across))

    def _angle(self, short: float) -> float:
        """The angle given, made exact, else `short`, in (-pi, pi], about the normal."""
        if self.options.angle is None:
            return short
        turns = round((self.options.angle - short) / (2.0 * np.pi))
        exact = short + 2.0 * np.pi * turns
        if abs(exact - self.options.angle) > _OFF:
            fits = sorted(short + 2.0 * np.pi * k for k in (-1, 0, 1))
            words = ", ".join(f"{angle:.6g}" for angle in fits)
            raise _error("angle", f"{self.options.angle:.6g} rad, which does not lead to the goal", f"one of {words}")
        return exact
