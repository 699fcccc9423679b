"""Sequential quadratic programming with an l1 exact penalty and a trust region."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from optiplan.arrays import Array
from optiplan.planners.trajopt.subproblem import Subproblem
from optiplan.planners.trajopt.transcription import SoftRows, Transcription

CONTACT_PENALTY = 300.0
"""Cost of a missing metre of clearance at one sample, s/m."""

TORQUE_PENALTY = 3.0
"""Cost of a torque that exceeds its limit by the limit itself at one sample, s."""

FIRST_RADIUS, LEAST_RADIUS = 0.3, 1e-4
"""Trust region on every control point, rad or m."""


@dataclass(frozen=True, eq=False)
class Point:
    """A curve with its linearised inequalities and its merit: weighted time and jerk plus penalties."""

    control: Array
    duration: float
    contacts: SoftRows
    torques: SoftRows
    merit: float

    @property
    def soft(self) -> list[tuple[SoftRows, float]]:
        """Rows with the penalty of each kind."""
        return [(self.contacts, CONTACT_PENALTY), (self.torques, TORQUE_PENALTY)]


def evaluate(transcription: Transcription, control: Array, duration: float) -> Point:
    """The curve at a duration not shorter than its derivative control points allow."""
    least = transcription.basis.shortest_duration(control, transcription.bounds)
    duration = max(duration, least)
    contacts, torques = transcription.contacts(control), transcription.torques(control, duration)
    jerk_cost = transcription.jerk_cost(control, duration).cost
    merit = transcription.objective.time * duration + jerk_cost
    merit += CONTACT_PENALTY * contacts.violation() + TORQUE_PENALTY * torques.violation()
    return Point(control, duration, contacts, torques, merit)


def optimise(subproblem: Subproblem, control: Array, iterations: int, stop: Callable[[], bool]) -> tuple[Point, int]:
    """Descend from control points (K, n) until a step gains less than 0.2 % of the duration: the point, steps taken.

    A step is accepted when the merit falls by a tenth of what the linear model promised; the trust region doubles
    where it fell by more than 70 % and shrinks to 35 % when a step is refused.
    """
    transcription = subproblem.transcription
    point, radius = evaluate(transcription, control, 0.0), FIRST_RADIUS
    for iteration in range(iterations):
        if stop() or radius < LEAST_RADIUS:
            return point, iteration
        step = subproblem.solve(point.control, point.duration, point.soft, radius)
        if step is None:
            radius *= 0.35
            continue
        if step.promise < 2e-4 * point.duration:
            return point, iteration
        # Where no torque binds, the derivative control points alone say how short T may be.
        duration = step.duration if len(point.torques.value) else 0.0
        trial = evaluate(transcription, step.control, duration)
        gain = point.merit - trial.merit
        if gain <= 0.1 * step.promise:
            radius *= 0.35
            point = _with_watched_torques(transcription, point)
            continue
        small = gain < 0.002 * point.duration
        settled = small and trial.contacts.violation() < 1e-4 and trial.torques.violation() < 0.01
        point = trial
        if gain > 0.7 * step.promise:
            radius *= 2.0
        if settled:
            return point, iteration + 1
    return point, iterations


def _with_watched_torques(transcription: Transcription, point: Point) -> Point:
    """The same point with rows for the torques that the refused trial, evaluated last, exceeded."""
    transcription.watch_exceeded()
    return replace(point, torques=transcription.torques(point.control, point.duration))
