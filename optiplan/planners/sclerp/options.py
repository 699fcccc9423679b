"""Options of `sclerp`."""

from typing import Literal

from optiplan.planners.option_schema import OptionError, PlannerOptions, option
from optiplan.records import dataclass

Scheme = Literal["corrected", "damped", "qp"]
JointLimits = Literal["reflect", "clip", "qp"]


@dataclass(frozen=True)
class SclerpOptions(PlannerOptions):
    """Options of `sclerp`."""

    scheme: Scheme = option(
        "qp",
        "`corrected` is the report's without its misprints, `damped` that with damped least squares instead of the "
        "pseudo-inverse. These two aim at the goal anew at every step. `qp` keeps to the screw between start and goal "
        "instead, and finds every step as a quadratic program.",
    )
    limits: JointLimits | None = option(
        None,
        "what happens to a joint that a step carries past its limit: `reflect` (back by 110 % of the overshoot, the "
        "report's way), `clip` (to the limit), `qp` (it does not happen: the step is the best within position and "
        "velocity limits). By default `reflect`, and `qp` for the scheme of that name, which has no other.",
    )
    tau: float = option(
        0.1,
        "share of the screw that a step aims at: of what is left of it, or for `qp` of all of it (it takes less where "
        "a joint would be too fast).",
        above=0,
        most=1,
    )
    beta: float = option(0.1, "share of a step that is taken; `qp` takes all of it.", above=0, most=1)
    tolerance: float = option(
        0.003,
        "largest difference of an element of the pose matrix from the goal's, m or 1, to stop at; by default the "
        "0.003 of the report's program. `qp` ends within 1e-9.",
        above=0,
    )
    iterations: int = option(5000, "steps, at most.", above=0)
    damping: float = option(0.01, "lambda of `damped`, m or 1.", above=0)
    step: float = option(
        0.05,
        "rad or m; how far the fastest joint may go in one step of a quadratic program, the others in proportion to "
        "their velocity limits.",
        above=0,
        most=1,
    )
    redundancy: Literal["best", "local", "goal"] = option(
        "best",
        "what a redundant arm does with its freedom under `qp`: `local` moves the joints least, step by step; `goal` "
        "leads them to the goal configurations, in turn, and takes the first that is reached; `best` tries all of "
        "these and takes the shortest motion. A goal in joint space is always led to.",
    )
    goals: int = option(8, "how many goal configurations to try.", above=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scheme == "qp" and self.limits not in (None, "qp"):
            raise OptionError("limits", f"{self.limits} with scheme = qp", "limits = qp, or another scheme")

    @property
    def joint_limits(self) -> JointLimits:
        """`limits`, or the default that goes with the scheme."""
        return self.limits or ("qp" if self.scheme == "qp" else "reflect")
