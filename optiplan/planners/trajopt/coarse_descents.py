"""Short descents of coarse curves: estimate the motion along a sampled path before it is optimised."""

from dataclasses import field
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.sampling.sample_path import SampledPath
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.program.native_sqp import NativeSqp
from optiplan.planners.trajopt.program.sqp import STUCK, WORSE, DescentOptions
from optiplan.planners.trajopt.stopping_rule import Patience
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

_SPANS, _SAMPLES, _SPACING = 14, 40, 0.05
"""Spans of a coarse curve, its least number of samples, and the largest motion of a body between two of them, m."""

_LEGS, _EACH, _MOST = 11, 3, 100
"""Legs of a path that such curves can follow, spans for each leg of a longer path, and the most spans of all of it."""

_STEPS = 50
"""Largest number of steps of a coarse descent: after about thirty, its duration is known."""

_FIRST_STEPS = 12, 5, 5, 5, 5
"""Largest number of steps of a curve that is to be a first motion soon, and of it with more samples each time."""

_ENOUGH = 0.02
"""Share of its duration that a step has to gain: later ones mostly gain less, and a proof waits for them."""

_FIRST_RADIUS = 0.02
"""Trust region that such a curve begins with: large first steps from a path with corners are mostly refused."""

_SHARE = 0.5
"""Work of a coarse step, in steps of a full curve."""

_HOPELESS = 1.2
"""Cost / cost of the best motion above which a coarse curve is given up after thirty steps."""

_FITTED = 200
"""Instants of a coarse curve at which one with all spans is fitted to it."""


class CoarseCurve(NamedTuple):
    """The result of a coarse descent.

    Attributes:
        control: (K, n) of the curve with all spans that is to be optimised, rad or m.
        duration: of the coarse curve, s; it may collide between its samples.
    """

    control: Array
    duration: float


class GuessPath(NamedTuple):
    """A sampled path, and the coarse curve optimised from it; None without a coarse descent."""

    path: SampledPath
    curve: CoarseCurve | None = None


@dataclass(eq=False)
class CoarseDescents:
    """Descends from paths with few spans and samples: a step takes half as long, collisions between are not checked.

    The cost of a path is a poor estimate of the motion along it; the coarse curve is within about a tenth. The full
    descent begins where the coarse one ended, and takes fewer steps.

    Attributes:
        optimiser: of the problem, for the full curves.
        budget: of the run.
        patience: counts the work.
        watch: of the run.
        spans: of coarse curves.
    """

    optimiser: Optimiser
    budget: Budget
    patience: Patience
    watch: Stopwatch
    spans: int = _SPANS
    _coarse: dict[tuple[CollisionModel, int], Optimiser] = field(default_factory=dict)

    def follow(self, waypoints: Array) -> bool:
        """Give all further curves, full ones too, more spans where a path (k, n) has more legs than they can follow.

        No curve may be kept yet: one that begins where another ended has as many spans. Return whether they get more.
        """
        legs = len(waypoints) - 1
        spans = min(_EACH * legs, _MOST)
        if legs <= _LEGS or spans <= self.spans:
            return False
        self.spans = spans
        if spans > self.optimiser.options.spans:
            self.optimiser.spread(spans)
        return True

    def descend(self, model: CollisionModel, path: SampledPath, best: float) -> CoarseCurve | None:
        """Return the curve from a path among the obstacles of a model; None where it stays in them.

        Args:
            model: of the robot, obstacles perhaps thinner.
            path: free there.
            best: cost of the best motion known, s.
        """
        return self._descended(model, self._among(model).along(path.waypoints), best)

    def at_once(self, waypoints: Array) -> Trajectory | None:
        """Return the motion of a curve from a path (k, n) after a few steps in the core; None where there is none.

        Where bodies touch between its samples, it gets more of them and a few more steps, up to four times. Its steps
        are not counted as work: they are no attempt.

        Args:
            waypoints: free among the real obstacles.
        """
        coarse = self._among(self.optimiser.model)
        control = coarse.within_limits(coarse.along(waypoints))
        descender = coarse.descender(control)
        if not isinstance(descender, NativeSqp):
            return None
        u = coarse.instants(control, _SPACING)
        for steps in _FIRST_STEPS:
            descender.set_samples(u)
            limits = DescentOptions(steps, lambda: self.budget.over, radius=_FIRST_RADIUS, enough=_ENOUGH)
            found = descender.optimise(control, limits)
            control = found.control
            if found.missing > STUCK or self.budget.over:
                return None
            attempt = coarse.checked(control, coarse.timed(control, found.duration), self.budget)
            if attempt is None or attempt.free:
                return None if attempt is None else attempt.trajectory
            u = coarse.more_instants(u, attempt)
        return None

    def from_curve(self, control: Array, best: float) -> CoarseCurve | None:
        """Return the coarse curve from control points (K, n) of one with all spans; None where it stays in obstacles.

        `best` as of `descend`.
        """
        coarse, full = self._among(self.optimiser.model), self.optimiser
        instants = np.linspace(0.0, 1.0, _FITTED)
        points = full.basis.at(instants) @ full.within_limits(control)
        return self._descended(full.model, coarse.basis.fit(instants, points), best)

    def _descended(self, model: CollisionModel, control: Array, best: float) -> CoarseCurve | None:
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
            return CoarseCurve(self.optimiser.basis.fit(instants, points), found.duration)

    def _among(self, model: CollisionModel) -> Optimiser:
        if (model, self.spans) not in self._coarse:
            options = self.optimiser.options
            few = options.coarse(min(self.spans, options.spans), min(_SAMPLES, options.samples))
            self._coarse[model, self.spans] = Optimiser(self.optimiser.problem, model, few)
        return self._coarse[model, self.spans]
