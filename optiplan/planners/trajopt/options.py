"""Options of the main planner."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TrajOptOptions:
    """Options of `trajopt`; the defaults are measured on MotionBenchMaker (benchmarks/README.md).

    Attributes:
        spans: polynomial pieces of the spline.
        bunching: 0 for equal pieces, towards 1 for shorter ones at both ends.
        samples: instants at which contacts are linearised to begin with.
        refinements: times that samples are added where bodies touch between them.
        iterations: steps of an attempt, at most.
        margin: clearance aimed at, m; less near a start or a goal that is closer to a body than that.
        straight_goals: goal configurations tried along a straight line, at most.
        seeds: sampled paths tried, at most.
        good_enough: duration / lower bound at which no further seed is tried.
        solver: of the quadratic programs, any that qpsolvers knows and finds installed.
    """

    spans: int = 22
    bunching: float = 0.6
    samples: int = 64
    refinements: int = 10
    iterations: int = 80
    margin: float = 0.005
    straight_goals: int = 3
    seeds: int = 4
    good_enough: float = 1.05
    solver: str = "piqp"
