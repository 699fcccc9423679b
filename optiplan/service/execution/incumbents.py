"""Motions that a planner finds on the way, proved before anybody is told of them."""

import time
from collections.abc import Iterable
from typing import Any

from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify

SHARE = 0.1
"""Of the planner's time, that proofs on the way may take at most; the first motion is proved whatever that costs."""


class ProvedIncumbents:
    """The progress of a run: stages as they come, and `best` only for motions that the verifier accepts.

    A proof on the way costs the planner some of its budget, so that incumbents in quick succession go unproved here;
    `rest` tells of those that the pipeline proved in the end.

    Args:
        problem: that is planned.
        progress: told of stages, and of motions by its method `best(seconds, duration)`.
    """

    def __init__(self, problem: Problem, progress: Any) -> None:
        self._problem, self._progress = problem, progress
        self._began = self._free = time.perf_counter()
        self._last = 0.0
        self._told: set[float] = set()

    def __call__(self, stage: str, fraction: float) -> None:
        """Tell of a stage."""
        self._progress(stage, fraction)

    def found(self, trajectory: Trajectory, _bound: float) -> None:
        """Prove an incumbent, and tell of it."""
        began = time.perf_counter()
        if began < self._free:
            return
        verified = verify(self._problem, trajectory).verified
        end = time.perf_counter()
        self._free = end + (end - began) / SHARE
        if verified:
            self._tell(end - self._began, trajectory.duration)

    def rest(self, improvements: Iterable[tuple[float, float]]) -> None:
        """Tell of the verified improvements, (seconds, duration in s), that came after those told on the way."""
        for seconds, duration in improvements:
            if seconds > self._last and duration not in self._told:
                self._tell(seconds, duration)

    def _tell(self, seconds: float, duration: float) -> None:
        self._last = seconds
        self._told.add(duration)
        self._progress.best(seconds, duration)
