"""Motions that a planner finds, proved before the planner goes on."""

import time
from typing import NamedTuple

from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate, Progress, announce
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report
from optiplan.verify.verify import verify

SHARE = 0.1
"""Of the time since the first proof, that further ones may take on the way."""


class Verdict(NamedTuple):
    """The report on a motion.

    Attributes:
        motion: that was held against the problem.
        report: on it.
        seconds: of planning and proving, after which it was there, s.
        proof: seconds that the proof alone took.
    """

    motion: Trajectory
    report: Report
    seconds: float
    proof: float


class ProofsOnTheWay:
    """The progress of a run, which has the first motion proved as soon as it is found.

    Somebody who waits for a motion can have a verified one while the planner looks for a better one. Proofs take the
    planner's time, so that those of motions in quick succession are left for the end of the run.

    Args:
        problem: that is planned.
        progress: is told of stages; of every better motion, if it has a method `found(motion, bound)`; and of every
            verified one, if it has a method `proved(motion, seconds)`.
        within: the planner's budget, which leaves as much time at its end as the last proof took; None: it does not.

    Attributes:
        seconds: that the proofs took, s.
        processor: the same by the processor's clock, s.
    """

    def __init__(self, problem: Problem, progress: Progress, within: Budget | None = None) -> None:
        self._problem, self._progress, self._within = problem, progress, within
        self._began = self._free = clock()
        self._verdicts: list[Verdict] = []
        self._last = 0.0
        self.seconds = self.processor = 0.0

    def __call__(self, stage: str, fraction: float) -> None:
        """Tell of a stage."""
        self._progress(stage, fraction)

    def found(self, motion: Trajectory, bound: float) -> None:
        """Tell of a better motion, and prove it unless the last proof was a moment ago."""
        announce(self._progress, motion, bound)
        began, spent = clock(), time.process_time()
        if began < self._free:
            return
        report = verify(self._problem, motion)
        end = clock()
        self._free = end + (end - began) / SHARE
        self.seconds += end - began
        if self._within is not None:
            self._within.leave(end - began)
        self.processor += time.process_time() - spent
        self._verdicts.append(Verdict(motion, report, end - self._began, end - began))
        if report.verified:
            self.proved(motion, end - self._began)

    @property
    def verified(self) -> list[Candidate]:
        """The motions that were proved on the way and hold, in order."""
        return [Candidate(one.motion, one.seconds - one.proof) for one in self._verdicts if one.report.verified]

    def verdict(self, motion: Trajectory) -> Verdict | None:
        """The verdict on a motion; None for one that was not proved on the way."""
        return next((one for one in self._verdicts if one.motion is motion), None)

    def proved(self, motion: Trajectory, seconds: float) -> None:
        """Tell of a verified motion, unless somebody was told of a later one."""
        tell = getattr(self._progress, "proved", None)
        if tell is not None and seconds > self._last:
            self._last = seconds
            tell(motion, seconds)
