"""Sequential quadratic programming with an l1 exact penalty, a trust region and a watchdog."""

from collections.abc import Callable, Sequence
from dataclasses import field
from math import inf
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from optiplan.arrays import Array
from optiplan.planners.trajopt.program.iteration_log import Ending, IterationLog
from optiplan.planners.trajopt.program.qp import Penalty, Step
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import CENTIMETRE
from optiplan.planners.trajopt.terms.term import Cost, SoftRows, Term
from optiplan.records import dataclass

FIRST_RADIUS, LEAST_RADIUS = 0.1, 3e-5
"""Trust region on every control point, as a share of what its joint can travel at full speed in that duration."""

SHRINK = 0.35

MAX_VIOLATION = 0.05
"""Clearance violation summed over the samples, m, above which a curve is given up."""

STUCK = 0.01
"""Clearance violation summed over the samples, m, above which a curve without progress is given up."""

STALLED, HALVED = 5, 0.5
"""Number of steps within which the clearance violation of a stuck curve must fall to this share."""

SETTLED, LITTLE, VAIN = 2, 2e-3, 2e-4
"""So many accepted steps in a row that gain so small a share end a descent, one may be bad luck; or such a promise."""

ACCEPTED, REPAIRED, REFUSED = 1.0, 0.5, 0.0
"""Values in the log: an accepted step, one repaired by a second step, a refused one."""

SLOW, WORSE = 30, 1.5
"""Number of steps after which a curve's merit must be within this factor of the best motion."""

GROWN = 2.0
"""Multiple of its first duration beyond which a curve is given up then: curves that wind around bodies stay long."""

GoOn = Callable[[Array, float], bool]
"""(control (K, n), duration) of the first curve that holds all rows -> whether to descend from it.

Called once, and only if the initial curve violates a row.
"""


class DescentOptions(NamedTuple):
    """Limits that end a descent before it converges.

    Attributes:
        iterations: most steps.
        stop: called before every step.
        best: cost of the best motion, s; after `slow` steps, a curve with more than 1.5 times this cost is given up.
        longest: s; a curve that takes longer after as many steps is given up.
        go_on: may end it at the first curve on which all rows hold.
        slow: steps after which a curve has to be good.
        radius: of the first trust region, see `FIRST_RADIUS`.
        enough: a step that promises or gains less than this share of the duration ends the descent where the clearance
            violation is at most `STUCK`; 0: only where it converges.
    """

    iterations: int
    stop: Callable[[], bool]
    best: float = inf
    longest: float = inf
    go_on: GoOn | None = None
    slow: int = SLOW
    radius: float = FIRST_RADIUS
    enough: float = 0.0


class Discretised(Protocol):
    """A transcription that can be descended: of one move, or of several parts, with curves of its own type."""

    @property
    def terms(self) -> tuple[Any, ...]:
        """Return the terms of such curves; see `terms.term.Term`."""

    @property
    def costs(self) -> tuple[Cost, ...]:
        """Return the costs beside the duration."""

    def shortest_duration(self, control: Array) -> float:
        """Return the least duration of a shape within the limits of the joints, s."""

    def curve(self, control: Array, duration: float) -> Any:
        """Return the curve of a shape at a duration."""

    def cost(self, curve: Any) -> float:
        """Return its cost, s."""


class Stepper(Protocol):
    """Builds and solves the program of a step; see `qp.Subproblem`."""

    @property
    def transcription(self) -> Discretised:
        """Return the transcription."""

    def solve(
        self, control: Array, duration: float, soft: Sequence[Penalty], radius: float, span: float
    ) -> Step | None:
        """Return one step from (control, duration); None when the solver fails."""


class SampledStepper(Stepper, Protocol):
    """One whose terms hold at samples."""

    @property
    def transcription(self) -> Transcription:
        """Return the transcription."""


class Merit(Protocol):
    """A curve of a descent with its merit; `Point` is the implementation in Python."""

    @property
    def control(self) -> Array:
        """Return the variables."""

    @property
    def duration(self) -> float:
        """Return the duration, s."""

    @property
    def merit(self) -> float:
        """Return the cost plus penalties, s."""

    @property
    def missing(self) -> float:
        """Return the clearance violation summed over the samples, m."""

    @property
    def nearest(self) -> float:
        """Return the least clearance beyond its margin, m."""

    @property
    def feasible(self) -> bool:
        """Return whether the violations are negligible."""


class Promise(Protocol):
    """A proposed step."""

    @property
    def promise(self) -> float:
        """Return the decrease of the merit predicted by the model, s."""


PointT = TypeVar("PointT", bound=Merit)
StepT = TypeVar("StepT", bound=Promise)


class DescentProgram(Protocol[PointT, StepT]):
    """Curves and steps of a descent, in Python (`PythonProgram`) or in the native core (`core.Sqp`)."""

    def begin(self, control: Array) -> PointT:
        """Return the curve of control points (K, n) at its least duration."""

    def step(self, point: PointT, radius: float) -> StepT | None:
        """Return the step from a curve inside a trust region; None when the solver fails."""

    def follow(self, point: PointT, step: StepT) -> PointT:
        """Return the curve at the end of a step."""

    def watch(self, point: PointT, trial: PointT) -> None:
        """Give a curve the rows that a rejected step from it showed to matter."""


class Descended(NamedTuple):
    """Result of a descent.

    Attributes:
        control: (K, n), rad or m.
        duration: s.
        missing: clearance violation summed over the samples, m.
        nearest: least clearance of a near pair beyond its margin, m; infinite where none is near.
        steps: taken.
        log: of the iterations.
    """

    control: Array
    duration: float
    missing: float
    nearest: float
    steps: int
    log: IterationLog


class Descender(Protocol):
    """Descends from curves of one transcription."""

    def set_samples(self, u: Array) -> None:
        """Set the instants, as shares of the duration, at which contacts and torques are evaluated."""

    def optimise(self, control: Array, options: DescentOptions) -> Descended:
        """Descend from control points (K, n); see `descend`."""


class PythonProgram:
    """The program of a descent, with rows and merits computed in Python."""

    def __init__(self, subproblem: Stepper) -> None:
        self.subproblem = subproblem

    def begin(self, control: Array) -> "Point":
        """Return the curve of control points (K, n) at its least duration."""
        return evaluate(self.subproblem.transcription, control, 0.0)

    def step(self, point: "Point", radius: float) -> Step | None:
        """Return the step from a curve inside a trust region; None when the solver fails."""
        return self.subproblem.solve(point.control, point.duration, point.soft, radius, point.span)

    def follow(self, point: "Point", step: Step) -> "Point":
        """Return the curve at the end of a step: where nothing else asks for time, at its least duration."""
        made = self.subproblem.transcription
        timed = any(rows.by_duration.any() for rows in point.rows) or any(cost.timed for cost in made.costs)
        return evaluate(made, step.control, step.duration if timed else 0.0, point.span)

    def watch(self, point: "Point", trial: "Point") -> None:
        """Give a curve the rows that a rejected step from it showed to matter."""
        new = [term.watch(rows) for term, rows in zip(point.terms, trial.rows, strict=True)]
        if any(new):
            curve = self.subproblem.transcription.curve(point.control, point.duration)
            fresh = zip(point.terms, point.rows, new, strict=True)
            point.rows = tuple(term.rows(curve) if again else rows for term, rows, again in fresh)


class Sqp(PythonProgram):
    """Descends with one solver of programs, without the native core's rows."""

    def __init__(self, subproblem: SampledStepper) -> None:
        super().__init__(subproblem)
        self._transcription = subproblem.transcription

    def set_samples(self, u: Array) -> None:
        """Set the instants, as shares of the duration, at which contacts and torques are evaluated."""
        self._transcription.set_samples(u)

    def optimise(self, control: Array, options: DescentOptions) -> Descended:
        """Descend from control points (K, n); see `descend`."""
        return descend(self, control, options)


@dataclass(eq=False)
class Point:
    """A curve with its linearised inequalities and its merit: its cost plus penalties.

    Attributes:
        control: (K, n), rad or m.
        duration: s.
        terms: of the transcription.
        rows: of each of them.
        span: s, scale of prices and trust region: the duration of the initial curve.
    """

    control: Array
    duration: float
    terms: tuple[Term, ...]
    rows: tuple[SoftRows, ...]
    merit: float
    span: float

    @property
    def soft(self) -> list[Penalty]:
        """Return the rows with the penalty of each term."""
        return penalties(self.terms, self.rows, self.span)

    @property
    def feasible(self) -> bool:
        """Return whether the violations of all terms are negligible."""
        return all(rows.violation() < term.negligible for term, rows in zip(self.terms, self.rows, strict=True))

    @property
    def missing(self) -> float:
        """Violation summed over the samples of the terms that decide whether to go on; as much clearance, m."""
        return CENTIMETRE * sum(rows.violation() / term.unit for term, rows in self._deciding())

    @property
    def nearest(self) -> float:
        """Least value of a row of these terms; as much clearance, m."""
        return min((CENTIMETRE / term.unit * float(rows.value.min(initial=inf)) for term, rows in self._deciding()))

    def _deciding(self) -> list[tuple[Term, SoftRows]]:
        return [(term, rows) for term, rows in zip(self.terms, self.rows, strict=True) if term.decides]


def penalties(terms: Sequence[Term], rows: Sequence[SoftRows], span: float) -> list[Penalty]:
    """Return the penalties of violations, in s, in a motion of about `span` s."""
    return [Penalty(found, term.price * span, term.unit) for term, found in zip(terms, rows, strict=True)]


def evaluate(transcription: Discretised, control: Array, duration: float, span: float | None = None) -> Point:
    """Evaluate the curve at a duration that its derivative control points allow; `span` is that by default."""
    duration = max(duration, transcription.shortest_duration(control))
    span = span or duration
    curve, terms = transcription.curve(control, duration), transcription.terms
    rows = tuple(term.rows(curve) for term in terms)
    merit = transcription.cost(curve) + sum(part.cost() for part in penalties(terms, rows, span))
    return Point(control, duration, terms, rows, merit, span)


def descend(program: DescentProgram[PointT, StepT], control: Array, options: DescentOptions) -> Descended:
    """Descend from control points (K, n) until two steps in a row gain less than 0.2 %.

    A step is accepted when the merit falls by a tenth of the decrease predicted by the model; the trust region doubles
    where it fell by more than 70 %. A second step follows from the end of a rejected one (the watchdog of Chamberlain
    et al., Mathematical Programming Study 16, 1982): curved constraints make good steps look bad, and the second step
    often repairs them. Otherwise both are undone and the trust region shrinks to 35 %. A curve is given up if its
    clearance violation hardly decreases in several steps; the options name what else ends a descent.
    """
    begin = program.begin(control)
    descent = _Descent(program, options, begin, options.radius, None if begin.feasible else options.go_on)
    ended: Ending | None = None
    while ended is None:
        ended = descent.exhausted() or descent.step()
    last, log = descent.point, IterationLog.of(descent.log, ended)
    return Descended(last.control, last.duration, last.missing, last.nearest, descent.taken, log)


@dataclass(eq=False)
class _Descent(Generic[PointT, StepT]):
    """A descent on its way.

    Attributes:
        program: gives steps and curves.
        options: limits.
        point: the curve of the last accepted step.
        radius: of the trust region, see `FIRST_RADIUS`.
        go_on: of the options, until it was called.
        taken: number of steps, each second one counted.
        settled: number of accepted steps in a row with little gain.
        missing: clearance violation, m, before each step.
        log: a row for each step, see `IterationLog`.
    """

    program: DescentProgram[PointT, StepT]
    options: DescentOptions
    point: PointT
    radius: float
    go_on: GoOn | None
    taken: int = 0
    settled: int = 0
    missing: list[float] = field(default_factory=list)
    log: list[tuple[float, ...]] = field(default_factory=list)

    def exhausted(self) -> Ending | None:
        """Return why no further step is to be taken; None: one is."""
        options = self.options
        if self.taken >= options.iterations:
            return "step limit"
        stopped = options.stop()
        if self.radius < LEAST_RADIUS:
            return "trust region"
        if _stalled(self.missing):
            return "penetration"
        if stopped:
            return "stopped"
        if self.taken < options.slow:
            return None
        return "too slow" if self.point.merit > WORSE * options.best or self.point.duration > options.longest else None

    def step(self) -> Ending | None:
        """Try a step, and a second one from its end where it gains too little; return why the descent ends, if so."""
        point, radius = self.point, self.radius
        self.missing.append(point.missing)
        before = point.duration, point.merit, self.missing[-1], radius
        step = self.program.step(point, radius)
        self.taken += 1
        if step is None:
            self.log.append((*before, REFUSED))
            self.radius *= SHRINK
            return None
        if step.promise < VAIN * point.duration or self._enough(point, step.promise):
            return "converged"
        trial, accepted = self.program.follow(point, step), ACCEPTED
        if point.merit - trial.merit <= 0.1 * step.promise and not self.options.stop():
            trial, accepted = _second(self.program, trial, radius), REPAIRED
            self.taken += 1
        gain = point.merit - trial.merit
        self.log.append((*before, accepted if gain > 0.1 * step.promise else REFUSED))
        if gain <= 0.1 * step.promise:
            self.radius *= SHRINK
            self.program.watch(point, trial)
            return None
        return self._accept(trial, gain, good=gain > 0.7 * step.promise)

    def _accept(self, trial: PointT, gain: float, good: bool) -> Ending | None:
        """Go to the end of a step; `good` ones widen the trust region. Return why the descent ends, if so."""
        held_back = good and self.radius < self.options.radius  # by a trust region that is about to grow
        little = gain < LITTLE * self.point.duration and trial.feasible and not held_back
        self.settled = self.settled + 1 if little else 0
        self.point = trial
        if good:
            self.radius *= 2.0
        if self.settled == SETTLED or self._enough(trial, gain):
            return "converged"
        if self.go_on is not None and trial.feasible:
            if not self.go_on(trial.control, trial.duration):
                return "contact between samples"
            self.go_on = None
        return None

    def _enough(self, point: PointT, gain: float) -> bool:
        """Return whether a curve near the end of a step with this gain, s, is as good as was asked for."""
        return gain < self.options.enough * point.duration and point.missing <= STUCK


def _stalled(missing: list[float]) -> bool:
    """Return whether the clearance violation, m, one value per step, has stopped decreasing."""
    return len(missing) > STALLED and missing[-1] > max(STUCK, HALVED * missing[-1 - STALLED])


def _second(program: DescentProgram[PointT, StepT], trial: PointT, radius: float) -> PointT:
    """Return the better of a trial point and the point one step from it."""
    step = program.step(trial, radius)
    again = trial if step is None else program.follow(trial, step)
    return again if again.merit < trial.merit else trial
