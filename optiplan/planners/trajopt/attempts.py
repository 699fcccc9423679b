"""Attempts of `trajopt`: an initial guess optimised, what comes of it kept, the best curve refined."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.continuous_collision import Touch
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.path_constraints.motion_check import Broken, broken_constraint
from optiplan.planners.trajopt.incumbent import Incumbent
from optiplan.planners.trajopt.optimizer import Attempt, Optimiser, attempt_record
from optiplan.planners.trajopt.program.iteration_log import IterationLog
from optiplan.planners.trajopt.speculative_attempts import AttemptOutcome, SpeculativeAttempts
from optiplan.planners.trajopt.stopping_rule import Patience
from optiplan.planners.trajopt.terms.free_end import FreeEnd
from optiplan.problem.problem import JointGoal
from optiplan.trajectory.trajectory import Trajectory

_CLOSE = 0.2
"""Share of the option's margin that the best motion is optimised with once more: the margin is a wish."""

_WORTH_CLOSE = 0.01
"""Share of the cost to the bound below which no margin is in the way."""

_FAR = 1.1
"""Factor to the bound beyond which the margin waits for another attempt: its way may be better."""

_CLOSE_STEPS = 60
"""Steps that the budget is to leave for it."""

_END_STEPS = 40
"""Steps of the attempt with a free end, at most: it begins at a curve that is optimised already."""

_FITTED = 300
"""Instants of the best curve at which one with more spans is fitted to it."""

Kind = Literal["straight", "line", "sampled", "relaxed", "bump", "close", "finer", "end"]


@dataclass(eq=False)
class Attempts:
    """Optimises initial guesses of one problem and offers what is free.

    Attributes:
        optimiser: of the problem.
        budget: of the run.
        incumbent: takes free motions; its record lists the attempts.
        patience: counts steps and outcomes.
        watch: of the run.
        patient: whether a curve may take any time, see `Optimiser.run`.
        ahead: attempts that other threads make.
        waiting: the best attempt, if it is to be optimised again with a smaller margin.
    """

    optimiser: Optimiser
    budget: Budget
    incumbent: Incumbent
    patience: Patience
    watch: Stopwatch
    patient: bool = False
    ahead: SpeculativeAttempts = field(init=False)
    waiting: Attempt | None = None
    _touching: tuple[Touch, Trajectory] | None = None
    _breaking: tuple[Broken, Trajectory] | None = None

    def __post_init__(self) -> None:
        self.ahead = SpeculativeAttempts(self.optimiser.problem, self.optimiser.options, self.budget)

    def attempt(
        self, kind: Kind, control: Array, budget: Budget, late: Callable[[], None] | None = None
    ) -> Attempt | None:
        """Optimise from control points (K, n), and keep what is free; `late` as in `Optimiser.run`."""
        attempt = self.optimised(kind, control, budget, late=late)
        self.keep(attempt)
        return attempt

    def keep(self, attempt: Attempt | None) -> None:
        """Keep the result of an attempt; if it is the best so far, optimise it again with a smaller margin.

        Where the bound is far below it, that waits for another attempt, which may find a better way.
        """
        incumbent = self.incumbent
        if attempt is not None:
            incumbent.offer(attempt.trajectory, attempt)
            if incumbent.is_best(attempt):
                held_up = attempt.close and incumbent.bound < (1.0 - _WORTH_CLOSE) * incumbent.cost
                incumbent.curve, self.waiting = attempt, attempt if held_up else None
        if attempt is None or incumbent.curve is not attempt or incumbent.within(_FAR):
            self.closer()
        self.patience.record(None if attempt is None else incumbent.cost_of(attempt.trajectory))

    def closer(self) -> None:
        """Optimise the attempt that waits for it again with a smaller margin."""
        waiting, self.waiting = self.waiting, None
        if waiting is not None and not self.budget.over:
            margin = _CLOSE * self.optimiser.options.margin
            self._offer(self.optimised("close", waiting.control, self.budget, margin=margin))

    @property
    def before_closer(self) -> Budget:
        """Return the budget, less what the attempt that waits will take."""
        steps = self.optimiser.steps if self.waiting is not None else 0
        each = self.watch.seconds.get("optimisation", 0.0) / max(steps, 1)
        return self.budget.leaving(_CLOSE_STEPS * each) if steps else self.budget

    def free_end(self) -> None:
        """Optimise the best curve once more with its end free in the goal that it is in, where that may gain."""
        curve, problem, options = self.incumbent.curve, self.optimiser.problem, self.optimiser.options
        if curve is None or self.budget.over or self.incumbent.within(options.good_enough):
            return
        poses = [goal for goal in problem.goal if not isinstance(goal, JointGoal)]
        ends = [end for end in (FreeEnd(problem, goal) for goal in poses) if end.holds(curve.control[-1])]
        if ends:
            few = replace(options, iterations=min(_END_STEPS, options.iterations))
            freeing = Optimiser(problem, self.optimiser.model, few, ends[0])
            self._refine("end", freeing, curve.control, curve)

    def finer(self) -> None:
        """Optimise the best curve once more with twice the spans, where it is the best motion and not at its bound."""
        curve, optimiser = self.incumbent.curve, self.optimiser
        if curve is None or not self.incumbent.is_best(curve) or self.budget.over:
            return
        if self.incumbent.within(optimiser.options.good_enough):
            return
        instants = np.linspace(0.0, 1.0, _FITTED)
        points = optimiser.basis.at(instants) @ curve.control
        more = replace(optimiser.options, spans=2 * optimiser.options.spans)
        finer = Optimiser(optimiser.problem, optimiser.model, more)
        self._refine("finer", finer, finer.basis.fit(instants, points), curve)

    def _refine(self, kind: Kind, optimiser: Optimiser, control: Array, curve: Attempt) -> None:
        margin = _CLOSE * optimiser.options.margin if curve.close else None
        self._offer(self.optimised(kind, control, self.budget, optimiser=optimiser, margin=margin))

    def _offer(self, attempt: Attempt | None) -> None:
        if attempt is not None:
            self.incumbent.offer(attempt.trajectory, attempt)

    def optimised(  # noqa: PLR0913
        self,
        kind: Kind,
        control: Array,
        budget: Budget,
        *,
        optimiser: Optimiser | None = None,
        margin: float | None = None,
        late: Callable[[], None] | None = None,
    ) -> Attempt | None:
        """Return the optimised motion of an initial guess (K, n), if it is free; arguments as of `Optimiser.run`."""
        incumbent, optimiser = self.incumbent, optimiser or self.optimiser
        incumbent.progress("optimisation", 1.0 - self.budget.remaining / self.budget.seconds)
        with self.watch.stage("optimisation"):
            known = None
            if kind in ("straight", "line", "bump"):
                known = self.ahead.take(control, budget, incumbent.cost, self.patient)
            if known is not None:
                attempt, steps, log = self._made(known, late)
            else:
                first, before = incumbent.offer_first, optimiser.steps
                attempt = optimiser.run(
                    control, budget, margin, incumbent.cost, patient=self.patient, first=first, late=late
                )
                steps, log = optimiser.steps - before, optimiser.log
        self.patience.work(steps=steps)
        incumbent.info["cut_short"] |= budget.over
        incumbent.info["attempts"].append(attempt_record(kind, attempt, steps, log))
        if attempt is not None and attempt.touches:
            self._touching = attempt.touches[0], attempt.trajectory
        if attempt is not None and attempt.broken:
            self._breaking = attempt.broken[0], attempt.trajectory
        return attempt if attempt is not None and attempt.free else None

    def _made(
        self, outcome: AttemptOutcome, late: Callable[[], None] | None
    ) -> tuple[Attempt | None, int, IterationLog]:
        """Return an attempt that another thread has made, its steps and their log."""
        if outcome.late and late is not None:
            late()
        if outcome.first is not None:
            self.incumbent.offer_first(outcome.first)
        return outcome.attempt, outcome.steps, outcome.log

    def why_not(self) -> Failure:
        """Return why no attempt has led to a free motion."""
        detail = f"no free trajectory within {self.budget.seconds:.3g} s"
        if self._breaking is not None:
            return broken_constraint(*self._breaking, detail)
        if self._touching is None:
            return Failure("budget", detail)
        touch, motion = self._touching
        pair = touch.contact.pair
        detail += f"; the best attempt touches: '{pair.name_a}' and '{pair.name_b}' at t = {touch.t:.3f} s"
        return Failure("collision", detail, touch.witness(motion))
