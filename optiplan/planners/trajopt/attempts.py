"""Attempts of `trajopt`: optimise an initial guess, keep the result, refine the best curve."""

from dataclasses import field, replace
from typing import Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.continuous_collision import Touch
from optiplan.planners.path_constraints.motion_check import Broken, broken_constraint
from optiplan.planners.trajopt.curve_incumbent import CurveIncumbent
from optiplan.planners.trajopt.optimizer import Attempt, AttemptOptions, Optimiser, attempt_record, finer_basis
from optiplan.planners.trajopt.speculative_attempts import SpeculativeAttempts
from optiplan.planners.trajopt.stopping_rule import Patience
from optiplan.problem.problem import JointGoal
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

_CLOSE, _CLOSEST = 0.4, 0.2
"""Shares of the option's margin: for refining the best curve, and for refining the best motion in the end.

The smaller the margin, the more often bodies touch between the samples, and the more samples are added.
"""

_WORTH_CLOSE = 0.01
"""Gap to the bound, as a share of the cost, below which the best curve is refined in the end only."""

_FAR = 1.1
"""Cost / bound beyond which the first curve is not refined before another attempt: that may find a better way."""

_CLOSE_STEPS = 60
"""Steps for which the budget reserves time to refine the waiting curve."""

_END_STEPS = 80
"""Largest number of steps with a free end; with half as many, a contact often remains."""

_FITTED = 300
"""Instants of the best curve at which one with more spans is fitted to it."""

Kind = Literal["straight", "line", "sampled", "relaxed", "bump", "close", "finer", "goal", "end"]


@dataclass(eq=False)
class Attempts:
    """Optimises initial guesses of one problem and offers what is free.

    Attributes:
        optimiser: of the problem.
        budget: of the run.
        incumbent: takes free motions; its record lists the attempts.
        patience: counts steps and outcomes.
        watch: of the run.
        patient: whether a curve may take any time, see `AttemptOptions`.
        ahead: attempts that other threads make.
        waiting: the best curve, if it is still to be refined.
        refined: the best refined motion.
    """

    optimiser: Optimiser
    budget: Budget
    incumbent: CurveIncumbent
    patience: Patience
    watch: Stopwatch
    patient: bool = False
    ahead: SpeculativeAttempts = field(init=False)
    waiting: Attempt | None = None
    refined: Attempt | None = None
    _finer: Optimiser | None = None
    _touching: tuple[Touch, Trajectory] | None = None
    _breaking: tuple[Broken, Trajectory] | None = None

    def __post_init__(self) -> None:
        self.ahead = SpeculativeAttempts(self.optimiser, self.budget)

    def attempt(self, kind: Kind, control: Array, budget: Budget) -> Attempt | None:
        """Optimise from control points (K, n), and keep a free result."""
        attempt = self.optimised(kind, control, budget)
        self.keep(attempt)
        return attempt

    def keep(self, attempt: Attempt | None) -> None:
        """Keep the result of an attempt, None without one, and refine the best curve.

        A first curve far above the bound waits for another attempt: it follows a single path.
        """
        incumbent, alone = self.incumbent, not self.patience.costs
        better = attempt is not None and incumbent.offer_curve(attempt)
        if better:
            worth = incumbent.bound < (1.0 - _WORTH_CLOSE) * incumbent.cost
            self.waiting = attempt if worth else None
        self.patience.record(None if attempt is None else incumbent.cost_of(attempt.trajectory))
        if not (better and alone) or incumbent.within(_FAR):
            self.refine()

    def refine(self) -> None:
        """Refine the waiting curve: twice the spans and, where the margin is active, less margin."""
        waiting, self.waiting = self.waiting, None
        if waiting is not None and not self.budget.over:
            refined = self._refined("close", waiting, _CLOSE)
            if refined is not None and self.incumbent.is_best(refined):
                self.refined = refined

    @property
    def before_refining(self) -> Budget:
        """Return the budget, less the time to refine the waiting curve."""
        steps = self.optimiser.steps if self.waiting is not None else 0
        each = self.watch.seconds.get("optimisation", 0.0) / max(steps, 1)
        return self.budget.leaving(_CLOSE_STEPS * each) if steps else self.budget

    @property
    def over(self) -> bool:
        """Whether no more than the time to refine the waiting curve is left."""
        return self.before_refining.over

    def free_end(self) -> None:
        """Optimise the best curve once more with its end free in the goal that it is in, where that may gain."""
        curve = self.incumbent.curve
        if curve is not None and not self.incumbent.within(self.optimiser.options.good_enough):
            self.freed(curve)

    def freed(self, curve: Attempt) -> None:
        """Optimise a curve once more with its end free in the goal that it is in; keep it where it is the best."""
        problem, options = self.optimiser.problem, self.optimiser.options
        poses = [goal for goal in problem.goal if not isinstance(goal, JointGoal)]
        if self.budget.over or not poses:
            return
        from optiplan.planners.trajopt.terms.free_end import FreeEnd

        ends = [end for end in (FreeEnd(problem, goal) for goal in poses) if end.holds(curve.control[-1])]
        if ends:
            few = replace(options, iterations=min(_END_STEPS, options.iterations))
            freeing = Optimiser(problem, self.optimiser.model, few, ends[0])
            margin = self._less(curve, _CLOSE)
            attempt = self.optimised("end", curve.control, self.budget, optimiser=freeing, margin=margin)
            if attempt is not None and self.incumbent.offer_curve(attempt):
                self.waiting = attempt

    def finest(self) -> None:
        """Refine the best motion with the least margin, if it is an optimised curve above its bound."""
        incumbent, curve = self.incumbent, self.incumbent.curve
        refined = self.refined is not None and incumbent.is_best(self.refined)
        best = self.refined if refined else curve
        if best is None or not incumbent.is_best(best) or self.budget.over:
            return
        if incumbent.within(self.optimiser.options.good_enough) or (refined and not best.close):
            return
        self._refined("finer", best, _CLOSEST)

    def _refined(self, kind: Kind, curve: Attempt, share: float) -> Attempt | None:
        """Optimise a curve with twice the spans and, where the margin is active, this share of it; offer it."""
        rough, few = self.optimiser, self.optimiser.options
        if self._finer is None:
            self._finer = Optimiser(rough.problem, rough.model, few, basis=finer_basis(few))
        control = curve.control
        if len(control) == rough.basis.size:
            instants = np.linspace(0.0, 1.0, _FITTED)
            control = self._finer.basis.fit(instants, rough.basis.at(instants) @ control)
        attempt = self.optimised(kind, control, self.budget, optimiser=self._finer, margin=self._less(curve, share))
        if attempt is not None:
            self.incumbent.offer(attempt.trajectory, holds=True)
        return attempt

    def _less(self, curve: Attempt, share: float) -> float | None:
        """Return a share of the margin, m, where it is active; None (all of it) elsewhere."""
        return share * self.optimiser.options.margin if curve.close else None

    def optimised(
        self,
        kind: Kind,
        control: Array,
        budget: Budget,
        *,
        optimiser: Optimiser | None = None,
        margin: float | None = None,
    ) -> Attempt | None:
        """Return the optimised motion of an initial guess (K, n), if it is free; see `Optimiser.run`."""
        incumbent, optimiser = self.incumbent, optimiser or self.optimiser
        incumbent.progress("optimisation", 1.0 - self.budget.remaining / self.budget.seconds)
        with self.watch.stage("optimisation"):
            known = None
            if kind in ("straight", "line", "bump"):
                known = self.ahead.take(control, budget, incumbent.cost, self.patient)
            if known is not None:
                if known.first is not None:
                    incumbent.offer_first(known.first)
                attempt, steps, log = known.attempt, known.steps, known.log
            else:
                options = AttemptOptions(margin, incumbent.cost, self.patient, incumbent.offer_first)
                attempt = optimiser.run(control, budget, options)
                steps, log = optimiser.taken, optimiser.log
        self.patience.work(steps=steps)
        incumbent.info["cut_short"] |= budget.over
        incumbent.info["attempts"].append(attempt_record(kind, attempt, steps, log))
        if attempt is not None and attempt.touches:
            self._touching = attempt.touches[0], attempt.trajectory
        if attempt is not None and attempt.broken:
            self._breaking = attempt.broken[0], attempt.trajectory
        return attempt if attempt is not None and attempt.free else None

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
