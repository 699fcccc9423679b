"""Options of the main planner."""

from dataclasses import replace

from optiplan.planners.option_schema import OptionError, PlannerOptions, option
from optiplan.records import dataclass

AUTO = "auto"
"""The native core as solver, where it is built."""


@dataclass(frozen=True)
class TrajOptOptions(PlannerOptions):
    """Options of `trajopt`; the defaults are measured on MotionBenchMaker (benchmarks/README.md)."""

    spans: int = option(
        22, "polynomial pieces of the spline; more where a sampled path has many corners.", least=4, most=1000
    )
    bunching: float = option(0.6, "0 for equal pieces, towards 1 for shorter ones at both ends.", least=0, most=0.99)
    samples: int = option(
        64,
        "instants at which contacts are linearised to begin with, at least; more in long motions.",
        least=2,
        most=10_000,
    )
    refinements: int = option(10, "times that samples are added where bodies touch between them.", least=0, most=1000)
    iterations: int = option(120, "steps of an attempt, at most.", least=1, most=100_000)
    margin: float = option(
        0.005,
        "clearance aimed at, m: a wish. Pairs that are closer at the start or the goal may stay as close, and where "
        "it holds up the best motion, that is optimised once more with two fifths and in the end a fifth of it.",
        least=0,
        most=1,
    )
    straight_goals: int = option(
        3, "goal configurations tried along a straight line first, at most.", least=0, most=1000
    )
    seeds: int = option(
        1000,
        "rounds of further attempts (lines and curves with a bump, sampled paths), at most; patience mostly ends them "
        "before that.",
        least=1,
        most=1000,
    )
    good_enough: float = option(
        1.002, "cost / bound at which no further attempt is made, whatever the budget.", least=1, most=1e9
    )
    workers: int = option(
        1,
        "attempts run side by side, in threads of the native core; the motion is the same for any number, unless the "
        "clock cut it. Worth its processors where a search takes long; vias, moving starts and obstacles and path "
        "constraints take one.",
        least=1,
        most=64,
    )
    solver: str = option(
        AUTO,
        f"of the quadratic programs: {AUTO} for the native core (piqp where that is not built), or any that qpsolvers "
        "knows and finds installed.",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_solver()

    def coarse(self, spans: int, samples: int) -> "TrajOptOptions":
        """Return the options of short descents that estimate the motion along a path."""
        return replace(self, spans=spans, samples=samples)

    def _check_solver(self) -> None:
        """Raise an `OptionError` for a solver that there is not."""
        if self.solver not in (AUTO, "piqp"):  # always installed; listing all solvers takes a quarter of a second
            import qpsolvers

            if self.solver not in qpsolvers.available_solvers:
                raise OptionError(
                    "solver", f"'{self.solver}'", f"{AUTO} or one of {', '.join(qpsolvers.available_solvers)}"
                )
