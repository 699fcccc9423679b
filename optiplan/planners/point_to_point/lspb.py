"""`lspb`: constant acceleration, constant velocity, constant deceleration (linear segment with parabolic blends).

Over a distance D in the time T, with blend time t_b:  V = D / (T - t_b),  a = V / t_b.  One of the three may be given:
D / T < V <= 2 D / T,  0 < t_b <= T / 2,  a >= 4 D / T^2. With a duration alone t_b is as near to T / 3 as the limits
allow; with nothing the motion is the fastest of its kind. The acceleration jumps, so that only a problem with
`limits: {jerk: none}` can have it verified.
"""

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.planners.common.limit_violations import rounded_up
from optiplan.planners.option_schema import OptionError, option
from optiplan.planners.point_to_point.base import SIZE, PointToPoint, Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.limits import ORDERS
from optiplan.robot.robot import Robot
from optiplan.trajectory.profiles.laws import Law, Trapezoid
from optiplan.trajectory.profiles.synchronisation import JointMove, RestToRest

_ABOVE = 1.0 + 1e-9  # a bound and its rounding


@dataclass(frozen=True)
class LspbOptions(ProfileOptions):
    """Also at most one of three, of the joint that moves farthest, or of every joint when they share no law.

    Without a duration, the motion is the fastest that has it.
    """

    velocity: float | None = option(
        None, "V, rad/s or m/s, as a speed; or with a minus where the joint moves the negative way."
    )
    blend_time: float | None = option(None, "t_b, s.", **SIZE)
    acceleration: float | None = option(None, "a, rad/s² or m/s².", **SIZE)

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [name for name, value in self.shape().items() if value is not None]
        if len(given) > 1:
            raise OptionError(given[0], f"{' and '.join(given)} together", "only one of them")
        if self.velocity is not None and not SIZE["least"] <= abs(self.velocity) <= SIZE["most"]:
            raise OptionError("velocity", str(self.velocity), f"a speed of {SIZE['least']:g} to {SIZE['most']:g}")

    def shape(self) -> dict[str, float | None]:
        """Return the three options; at most one of them is set."""
        return {"velocity": self.velocity, "blend_time": self.blend_time, "acceleration": self.acceleration}


class Lspb(PointToPoint[LspbOptions]):
    """Planner of linear segments with parabolic blends."""

    Options = LspbOptions

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The motion from the start to a goal (n,).

        Raises:
            InputError: the velocity, blend time or acceleration does not go with the distance and the duration.
        """
        o = self.options
        shaped = any(value is not None for value in o.shape().values())
        profile = RestToRest(
            problem.start,
            goal,
            problem.limits,
            problem.robot.joint_names,
            self._law,
            o.motion,
            share_by_distance=o.velocity is not None and o.duration is not None,
            stretchable=not shaped,
        )
        robot = problem.robot
        issues = [issue for part in profile.parts(o.duration) if (issue := self._issue(part, robot)) is not None]
        if issues:
            raise InputError(issues)
        return profile

    def _law(self, distance: float) -> Law:
        """The trapezoid of a joint that moves so far, in its units of s."""
        o = self.options
        return Trapezoid(
            None if o.velocity is None else abs(o.velocity) / distance,
            o.blend_time,
            None if o.acceleration is None else o.acceleration / distance,
        )

    def _issue(self, part: JointMove, robot: Robot) -> Issue | None:
        """Return the option that conflicts with the move's distance, duration or direction."""
        o, D, T = self.options, part.distance, part.duration
        length, speed, rate = (robot.unit(quantity, part.joint) for quantity in ORDERS[:3])
        speeds = f"more than {D / T:.3g} and at most {2.0 * D / T:.3g} {speed} (D/T < |V| <= 2 D/T)"
        if o.velocity is not None and o.velocity < 0.0 < part.step[part.joint]:
            field, unit, expected = "velocity", speed, f"a positive one, as the motion: {speeds}"
        elif o.duration is None:  # the shortest duration fits the option
            return None
        elif o.velocity is not None and not D / T * _ABOVE < abs(o.velocity) <= 2.0 * D / T * _ABOVE:
            field, unit, expected = "velocity", speed, speeds
        elif o.blend_time is not None and o.blend_time > 0.5 * T * _ABOVE:
            field, unit, expected = "blend_time", "s", f"more than 0 and at most {0.5 * T:.3g} s (T/2)"
        elif o.acceleration is not None and o.acceleration * _ABOVE < 4.0 * D / T**2:
            field, unit, expected = "acceleration", rate, f"at least {rounded_up(4.0 * D / T**2)} {rate} (4 D/T²)"
        else:
            return None
        who = f"for joint '{robot.joint_names[part.joint]}', which moves {D:.4g} {length} in {T:.4g} s"
        return Issue.of_option("lspb", field, f"{o.shape()[field]:.6g} {unit} {who}", expected)
