"""Policies: what a robot does where obstacles block its path."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from optiplan.arrays import is_finite
from optiplan.errors import described, wrong_argument
from optiplan.execution.path_laws import PathLaws, PathPlace

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

Reaction = Literal["wait", "stop", "slow", "replan"]
"""What is done: see `Policy`."""

SPEEDS = (1.0, 0.7, 0.45, 0.25, 0.12, 0.05)
"""Shares of the wanted speed at which a robot slows down."""


@dataclass(frozen=True)
class Policy:
    """What an executor does where obstacles that were seen block the path, with the times that it may take.

    Whatever it is, the robot follows a law that is clear until it stands still; where there is none, it stops at once.

    Attributes:
        reaction: `wait`: stop along the path, go on when an update leaves it clear. `stop`: stop, go on at `resume`.
            `slow`: the largest speed from which a stop after `period` is clear, and `wait` where there is none.
            `replan`: go on as far as a stop after `latency` is clear, while another motion to the goal is planned; it
            takes over without a stop if it comes in time, else from rest.
        period: s, between two updates of the scene at most.
        latency: s, from a blocked path to the motion that replaces it.
        linger: s, for which obstacles must not strike the robot where it stands still, if they keep their velocity.

    Raises:
        InputError: another reaction, or times that are not above 0 (`linger`: not at least 0).

    Example:
        >>> import optiplan as op
        >>> op.Policy("replan", latency=0.08)
        Policy(reaction='replan', period=0.05, latency=0.08, linger=2.0)
    """

    reaction: Reaction
    period: float = 0.05
    latency: float = 0.05
    linger: float = 2.0

    def __post_init__(self) -> None:
        if self.reaction not in get_args(Reaction):
            choices = ", ".join(get_args(Reaction))
            raise wrong_argument("Policy", "reaction", described(self.reaction), f"one of: {choices}")
        for name in ("period", "latency"):
            value = getattr(self, name)
            if not (is_finite(value) and value > 0.0):
                raise wrong_argument("Policy", name, described(value), "seconds > 0")
        if not (is_finite(self.linger) and self.linger >= 0.0):
            raise wrong_argument("Policy", "linger", described(self.linger), "seconds >= 0")

    @classmethod
    def of(cls, policy: Any) -> "Policy":
        """Return a policy, or that of a name.

        Raises:
            InputError: it is neither.
        """
        if isinstance(policy, Policy):
            return policy
        if isinstance(policy, str) and policy == "wait":
            return WAIT
        for reaction in get_args(Reaction):
            if isinstance(policy, str) and policy == reaction:
                return cls(reaction)
        choices = ", ".join(get_args(Reaction))
        raise wrong_argument("Executor", "policy", described(policy), f"an op.Policy, or one of: {choices}")

    def law(
        self, laws: PathLaws, law: "TimeLaw", now: float, wanted: float, blocked: Callable[["TimeLaw"], bool]
    ) -> "TimeLaw | None":
        """Return the law of a robot whose path is blocked, clear until it stands still; None: it is to stop now.

        Args:
            laws: along the path.
            law: the present one.
            now: s.
            wanted: the speed that is wanted.
            blocked: whether anything blocks the way of a law.
        """
        if self.reaction == "replan":
            later = laws.then_stop(law, now + self.latency)
            return None if blocked(later) else later
        for share in SPEEDS if self.reaction == "slow" else ():
            slower = laws.change(PathPlace(*law.at(now)), now, share * wanted)
            if slower is not None and not blocked(later := laws.then_stop(slower, now + self.period)):
                return later
        return None


WAIT = Policy("wait", linger=0.0)
"""What an executor does without a policy."""
