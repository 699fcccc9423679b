"""From the options of `cubic`, `quintic` and `septic` to a profile: one law from rest to rest, or two states joined."""

from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.planners.option_schema import OptionError, option
from optiplan.planners.point_to_point.base import Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.trajectory.paths.hermite import Hermite
from optiplan.trajectory.profiles.laws import PolynomialLaw
from optiplan.trajectory.profiles.synchronisation import RestToRest

_MOST = 1e7  # of an end velocity, acceleration or jerk


@dataclass(frozen=True)
class EndOptions(ProfileOptions):
    """Also velocities at the ends, which a problem cannot state yet: all are zero."""

    start_velocity: tuple[float, ...] | None = option(None, "rad/s or m/s, one a joint; zeros, or not given.")
    end_velocity: tuple[float, ...] | None = option(None, "the same at the goal.")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in {"start_velocity": self.start_velocity, "end_velocity": self.end_velocity}.items():
            if value is not None and any(v != 0.0 for v in value):
                expected = "zeros: problems start and end at rest, and only such motions can be verified"
                raise OptionError(name, str(list(value)), expected)


@dataclass(frozen=True)
class Family:
    """A planner's name, its law from rest to rest, and the derivatives that its options give at both ends."""

    name: str
    law: PolynomialLaw
    rates: tuple[str, ...]


def polynomial_profile(family: Family, options: ProfileOptions, problem: Problem, goal: Array) -> Profile:
    """From the problem's start to a goal (n,), with the options' `start_velocity`, `end_velocity` … where given.

    Raises:
        InputError: other than a number for each joint, accelerations that the jerk limit forbids, or joints that do not
            rest at an end and are not synchronised.
    """
    names = problem.robot.joint_names
    start = np.array([problem.start, *(_rate(family, options, problem, f"start_{rate}") for rate in family.rates)])
    end = np.array([goal, *(_rate(family, options, problem, f"end_{rate}") for rate in family.rates)])
    start, end = (_checked(family, problem, states, name) for states, name in ((start, "start"), (end, "end")))
    if not (start[1:].any() or end[1:].any()):
        return RestToRest(problem.start, goal, problem.limits, names, lambda _: family.law, options.motion)
    if options.motion != "synchronised":
        raise _issue(family, "motion", options.motion, "synchronised, where the ends are not at rest")
    return Hermite(start, end, problem.limits, names)


def _checked(family: Family, problem: Problem, states: Array, end: str) -> Array:
    """States (order, n) of one end, if the verifier can accept them: an acceleration there is a jump of it.

    Raises:
        InputError: a joint with a jerk limit has an acceleration.
    """
    if len(states) > 2 and (states[2][np.isfinite(problem.limits.jerk)] != 0.0).any():
        expected = "zeros for joints with a finite jerk limit; `limits: {jerk: none}` in the problem allows others"
        raise _issue(family, f"{end}_acceleration", f"{states[2].tolist()}", expected)
    return states


def _rate(family: Family, options: ProfileOptions, problem: Problem, name: str) -> Array:
    value = getattr(options, name)
    if value is None:
        return np.zeros(problem.robot.n)
    if len(value) != problem.robot.n or not (np.abs(value) <= _MOST).all():
        raise _issue(family, name, f"{list(value)}", f"{problem.robot.n} numbers up to {_MOST:g}, one for each joint")
    return np.array(value)


def _issue(family: Family, field: str, found: str, expected: str) -> InputError:
    return InputError([Issue.of_option(family.name, field, found, expected)])
