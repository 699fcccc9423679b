"""Options of `sclerp`."""

from dataclasses import dataclass
from typing import Literal

Scheme = Literal["corrected", "damped", "qp"]
JointLimits = Literal["reflect", "clip", "qp"]


@dataclass(frozen=True)
class SclerpOptions:
    """Options of `sclerp`.

    Attributes:
        scheme: `corrected` is the report's without its misprints, `damped` that with damped least squares instead of
            the pseudo-inverse. These two aim at the goal anew at every step. `qp` keeps to the screw between start and
            goal instead, and finds every step as a quadratic program.
        limits: what happens to a joint that a step carries past its limit: `reflect` (back by 110 % of the overshoot,
            the report's way), `clip` (to the limit), `qp` (it does not happen: the step is the best within position
            and velocity limits). By default `reflect`, and `qp` for the scheme of that name, which has no other.
        tau: share of the screw that a step aims at: of what is left of it, or for `qp` of all of it (it takes less
            where a joint would be too fast).
        beta: share of a step that is taken; `qp` takes all of it.
        tolerance: largest difference of an element of the pose matrix from the goal's, m or 1, to stop at; by default
            the 0.003 of the report's program. `qp` ends within 1e-9.
        iterations: steps, at most.
        damping: lambda of `damped`, m or 1.
        step: rad or m; how far the fastest joint may go in one step of a quadratic program, the others in proportion
            to their velocity limits.
        redundancy: what a redundant arm does with its freedom under `qp`: `local` moves the joints least, step by
            step; `goal` leads them to the goal configurations, in turn. A goal in joint space is always led to.
        goals: how many goal configurations to try.
    """

    scheme: Scheme = "qp"
    limits: JointLimits | None = None
    tau: float = 0.1
    beta: float = 0.1
    tolerance: float = 0.003
    iterations: int = 5000
    damping: float = 0.01
    step: float = 0.05
    redundancy: Literal["local", "goal"] = "local"
    goals: int = 8

    def __post_init__(self) -> None:
        """Raises ValueError: out of range, or limits other than its own for `qp`."""
        for name in ("tau", "beta", "step"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ValueError(f"{name} = {getattr(self, name)} is not in (0, 1]")
        for name in ("tolerance", "damping", "iterations", "goals"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} = {getattr(self, name)} is not positive")
        if self.scheme == "qp" and self.limits not in (None, "qp"):
            raise ValueError(f"limits = {self.limits} does not go with scheme = qp, which has limits = qp")

    @property
    def joint_limits(self) -> JointLimits:
        """`limits`, or the default that goes with the scheme."""
        return self.limits or ("qp" if self.scheme == "qp" else "reflect")
