"""Options of the main planner."""

from dataclasses import dataclass

RANGES = {
    "spans": (4, 1000),
    "bunching": (0.0, 0.99),
    "samples": (2, 10_000),
    "refinements": (0, 1000),
    "iterations": (1, 100_000),
    "margin": (0.0, 1.0),
    "straight_goals": (0, 1000),
    "seeds": (1, 1000),
    "good_enough": (1.0, 1e9),
}
"""Smallest and largest value of each number; beyond them nothing is planned, or memory ends."""


@dataclass(frozen=True)
class TrajOptOptions:
    """Options of `trajopt`; the defaults are measured on MotionBenchMaker (benchmarks/README.md).

    Attributes:
        spans: polynomial pieces of the spline.
        bunching: 0 for equal pieces, towards 1 for shorter ones at both ends.
        samples: instants at which contacts are linearised to begin with, at least; more in long motions.
        refinements: times that samples are added where bodies touch between them.
        iterations: steps of an attempt, at most.
        margin: clearance aimed at, m: a wish. Pairs that are closer at the start or the goal may stay as close, and
            where it holds up the best motion so far, that is optimised once more with a fifth of it.
        straight_goals: goal configurations tried along a straight line first, at most.
        seeds: rounds of further attempts (lines and curves with a bump, sampled paths), at most; patience mostly ends
            them before that.
        good_enough: cost / bound at which no further attempt is made, whatever the budget.
        solver: of the quadratic programs, any that qpsolvers knows and finds installed.

    Raises:
        ValueError: a value out of range, or a solver that is not there.
    """

    spans: int = 22
    bunching: float = 0.6
    samples: int = 64
    refinements: int = 10
    iterations: int = 120
    margin: float = 0.005
    straight_goals: int = 3
    seeds: int = 1000
    good_enough: float = 1.002
    solver: str = "piqp"

    def __post_init__(self) -> None:
        for name, (low, high) in RANGES.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} = {getattr(self, name)} is not within {low} to {high}")
        if self.solver != "piqp":  # the default is there: looking up all takes a quarter of a second
            import qpsolvers

            if self.solver not in qpsolvers.available_solvers:
                raise ValueError(f"solver = '{self.solver}' is not one of {', '.join(qpsolvers.available_solvers)}")
