"""From the options of `cubic`, `quintic` and `septic` to a profile: one law from rest to rest, or two states joined."""

from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.planners.point_to_point import Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.trajectory.hermite import Hermite
from optiplan.trajectory.profiles import PolynomialLaw
from optiplan.trajectory.rest_to_rest import RestToRest

_MOST = 1e7  # of an end velocity, acceleration or jerk


@dataclass(frozen=True)
class Family:
    """A planner's name, its law from rest to rest, and the derivatives that its options give at both ends."""

    name: str
    law: PolynomialLaw
    rates: tuple[str, ...]


def polynomial_profile(family: Family, options: ProfileOptions, problem: Problem, goal: Array) -> Profile:
    """From the problem's start to a goal (n,), with the options' `start_velocity`, `end_velocity` … where given.

    Raises:
        InputError: other than a number for each joint, or joints that move at an end but are not synchronised.
    """
    names = problem.robot.joint_names
    start = np.array([problem.start, *(_rate(family, options, problem, f"start_{rate}") for rate in family.rates)])
    end = np.array([goal, *(_rate(family, options, problem, f"end_{rate}") for rate in family.rates)])
    if not (start[1:].any() or end[1:].any()):
        return RestToRest(problem.start, goal, problem.limits, names, lambda _: family.law, options.motion)
    if options.motion != "synchronised":
        raise _issue(family, "motion", options.motion, "synchronised, where the ends are not at rest")
    return Hermite(start, end, problem.limits, names)


def _rate(family: Family, options: ProfileOptions, problem: Problem, name: str) -> Array:
    value = getattr(options, name)
    if value is None:
        return np.zeros(problem.robot.n)
    if len(value) != problem.robot.n or not (np.abs(value) <= _MOST).all():
        raise _issue(family, name, f"{list(value)}", f"{problem.robot.n} numbers up to {_MOST:g}, one for each joint")
    return np.array(value)


def _issue(family: Family, field: str, found: str, expected: str) -> InputError:
    return InputError([Issue(f"planner '{family.name}'", None, field, found, expected)])
