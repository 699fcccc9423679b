"""Short descents of coarse curves, which tell what motions sampled paths lead to, before one is optimised."""

from dataclasses import dataclass, field, replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.sampling.sample_path import SampledPath
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.program.sqp import STUCK, WORSE, DescentOptions
from optiplan.planners.trajopt.stopping_rule import Patience

_SPANS, _SAMPLES, _SPACING = 14, 40, 0.05
"""Of a coarse curve: spans, least number of samples, and how far bodies may move between two of them, m."""

_STEPS = 50
"""Steps of its descent, at most: after some thirty of them it is known how long it gets."""

_SHARE = 0.5
"""Work of such a step, in steps of the curves that are answers."""

_HOPELESS = 1.2
"""Cost in that of the best motion known at which a coarse curve is given up after its first thirty steps."""

_FITTED = 200
"""Instants of a coarse curve at which one with all spans is fitted to it."""


@dataclass(frozen=True, eq=False)
class GuessPath:
    """A sampled path, and what a coarse curve along it became.

    Attributes:
        path: sampled.
        control: (K, n) of the curve to optimise, rad or m; None, without a coarse descent: one along the path.
        duration: of the coarse curve, s, touching what it may touch between its samples.
    """

    path: SampledPath
    control: Array | None = None
    duration: float = 0.0


@dataclass(eq=False)
class CoarseDescents:
    """Descends from paths with few spans and samples: each step takes half as long, and nothing is checked between.

    What a path costs tells little of the motion that it leads to; such a curve is within a tenth of it or so. The full
    descent begins where the coarse one ended, and takes fewer steps for it.

    Attributes:
        optimiser: of the problem, whose curves are the answers.
        budget: of the run.
        patience: counts the work.
        watch: of the run.
    """

    optimiser: Optimiser
    budget: Budget
    patience: Patience
    watch: Stopwatch
    _coarse: dict[CollisionModel, Optimiser] = field(default_factory=dict)

    def descend(self, model: CollisionModel, path: SampledPath, best: float) -> GuessPath | None:
        """Return the way of a path among the obstacles of a model; None where its curve stays in them.

        Args:
            model: of the robot, obstacles perhaps thinner.
            path: free there.
            best: cost of the best motion known, s.
        """
        velocity = self.optimiser.problem.limits.velocity
        found = self._descended(model, along_path(self._among(model).basis, path.waypoints, velocity), best)
        return None if found is None else GuessPath(path, *found)

    def from_curve(self, control: Array, best: float) -> tuple[Array, float] | None:
        """Return the control points (K, n) and the duration, s, of the coarse curve from one with all spans (K, n)."""
        coarse, full = self._among(self.optimiser.model), self.optimiser
        instants = np.linspace(0.0, 1.0, _FITTED)
        points = full.basis.at(instants) @ full.within_limits(control)
        return self._descended(full.model, coarse.basis.fit(instants, points), best)

    def _descended(self, model: CollisionModel, control: Array, best: float) -> tuple[Array, float] | None:
        """Return a curve with all spans and its duration, s, from a coarse one; None where that stays in obstacles."""
        with self.watch.stage("sampling"):
            coarse = self._among(model)
            control = coarse.within_limits(control)
            descender = coarse.descender(control)
            descender.set_samples(coarse.instants(control, _SPACING))
            hopeless = _HOPELESS / WORSE * best
            found = descender.optimise(control, DescentOptions(_STEPS, lambda: self.budget.over, hopeless))
            self.patience.work(steps=_SHARE * found.steps)
            if found.missing > STUCK:
                return None
            instants = np.linspace(0.0, 1.0, _FITTED)
            points = coarse.basis.at(instants) @ found.control
            return self.optimiser.basis.fit(instants, points), found.duration

    def _among(self, model: CollisionModel) -> Optimiser:
        if model not in self._coarse:
            options = self.optimiser.options
            few = replace(options, spans=min(_SPANS, options.spans), samples=min(_SAMPLES, options.samples))
            self._coarse[model] = Optimiser(self.optimiser.problem, model, few)
        return self._coarse[model]
