"""`cubic` and `septic`, and what they share with `quintic`: one polynomial a joint, between two states.

From rest to rest, with s = t / T and D = q_goal - q_start:

    cubic   q(t) = q_start + D (3 s^2 - 2 s^3): peaks 1.5 |D| / T in velocity and 6 |D| / T^2 in acceleration.
    septic  q(t) = q_start + D (35 s^4 - 84 s^5 + 70 s^6 - 20 s^7): peak 2.1875 |D| / T in velocity.

The cubic's acceleration jumps at both ends: only a problem with `limits: {jerk: none}` can have it verified. The
septic's jerk starts and ends at 0 as well, at the price of higher peaks.
"""

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.option_schema import option, option_error
from optiplan.planners.point_to_point.base import PointToPoint, Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.paths.hermite import Hermite
from optiplan.trajectory.profiles.laws import CUBIC, SEPTIC, PolynomialLaw
from optiplan.trajectory.profiles.synchronisation import RestToRest
from optiplan.trajectory.state import State

_MOST = 1e7  # of an end velocity, acceleration or jerk


@dataclass(frozen=True)
class EndOptions(ProfileOptions):
    """Also velocities at the ends, which repeat those of the problem."""

    start_velocity: tuple[float, ...] | None = option(
        None, "rad/s or m/s, one a joint; None is what the problem states, and only that can be verified."
    )
    end_velocity: tuple[float, ...] | None = option(None, "the same at the goal.")


@dataclass(frozen=True)
class AccelerationOptions(EndOptions):
    """Also accelerations at the ends."""

    start_acceleration: tuple[float, ...] | None = option(None, "rad/s² or m/s², one a joint; None is none.")
    end_acceleration: tuple[float, ...] | None = option(None, "the same at the goal.")


@dataclass(frozen=True)
class JerkOptions(AccelerationOptions):
    """Also jerks at the ends."""

    start_jerk: tuple[float, ...] | None = option(None, "rad/s³ or m/s³, one a joint; None is none.")
    end_jerk: tuple[float, ...] | None = option(None, "the same at the goal.")


@dataclass(frozen=True)
class Family:
    """A planner's name, its law from rest to rest, and the derivatives that its options give at both ends."""

    name: str
    law: PolynomialLaw
    rates: tuple[str, ...]


def polynomial_profile(family: Family, options: ProfileOptions, problem: Problem, goal: Array) -> Profile:
    """Return the profile from the problem's start to a goal (n,), with the problem's states of motion at both.

    Accelerations and jerks at the ends are those of the options, where given.

    Raises:
        InputError: a rate is not one number for each joint. It differs from the problem's, unless it is an
            acceleration and jerk is not limited. Joints move at an end and are not synchronised.
    """
    names = problem.robot.joint_names
    start = _state(family, options, problem, "start", problem.start_state)
    end = _state(family, options, problem, "end", problem.end_states(goal)[0])
    if not (start[1:].any() or end[1:].any()):
        return RestToRest(problem.start, goal, problem.limits, names, lambda _: family.law, options.motion)
    if options.motion != "synchronised":
        raise option_error(family.name, "motion", options.motion, "synchronised, where the ends are not at rest")
    return Hermite(start, end, problem.limits, names)


def _state(family: Family, options: ProfileOptions, problem: Problem, end: str, stated: State) -> Array:
    """Position and rates (order, n) at one end, if the verifier can accept them.

    Raises:
        InputError: see `polynomial_profile`.
    """
    rows = [stated.q]
    for name in family.rates:
        asked = _rate(family, options, problem, f"{end}_{name}")
        rate = {"velocity": stated.v, "acceleration": stated.a, "jerk": np.zeros(stated.n)}[name]
        rows.append(rate if asked is None else asked)
        held = {"velocity": stated.v == stated.v, "jerk": stated.v != stated.v}.get(
            name, np.isfinite(problem.limits.jerk) | (stated.a != 0.0)
        )
        if (rows[-1] != rate)[held].any():
            place = "start" if end == "start" else "goal"
            expected = f"those of the problem, {rate.tolist()}: say `{place}: {{joints: …, {name}: …}}` there"
            if name == "acceleration":
                expected += ", or `limits: {jerk: none}`, with which accelerations may jump"
            raise option_error(family.name, f"{end}_{name}", f"{rows[-1].tolist()}", expected)
    return np.array(rows)


def _rate(family: Family, options: ProfileOptions, problem: Problem, name: str) -> Array | None:
    value = getattr(options, name)
    if value is None:
        return None
    if len(value) != problem.robot.n or not (np.abs(value) <= _MOST).all():
        raise option_error(
            family.name, name, f"{list(value)}", f"{problem.robot.n} numbers up to {_MOST:g}, one for each joint"
        )
    return np.array(value)


class Cubic(PointToPoint[EndOptions]):
    """Planner of polynomials of degree three, with any velocities at the ends."""

    Options = EndOptions

    end_derivatives = 1

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The cubic from the start to a goal (n,)."""
        return polynomial_profile(Family("cubic", CUBIC, ("velocity",)), self.options, problem, goal)


class Septic(PointToPoint[JerkOptions]):
    """Planner of polynomials of degree seven, with any velocities, accelerations and jerks at the ends."""

    Options = JerkOptions

    end_derivatives = 2

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The polynomial of degree seven from the start to a goal (n,)."""
        family = Family("septic", SEPTIC, ("velocity", "acceleration", "jerk"))
        return polynomial_profile(family, self.options, problem, goal)
