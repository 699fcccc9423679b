"""Policies: what a robot does where obstacles block its path."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, get_args

from optiplan.arrays import number_argument
from optiplan.errors import choice_argument, described, wrong_argument
from optiplan.execution.paths.path_laws import PathLaws, PathPlace, rests
from optiplan.execution.scene.separation import Separation
from optiplan.problem.problem import Problem
from optiplan.records import dataclass

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

Reaction = Literal["wait", "stop", "slow", "replan"]
"""What is done: see `Policy`."""

SPARE = 5e-3
"""m, to spare where a law is chosen: it is checked again later, in cells that begin at other places."""

SPEEDS = (1.0, 0.8, 0.6, 0.4, 0.25, 0.1, 0.05)
"""Shares of the wanted speed to which a robot slows down."""


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
        choice_argument("Policy", "reaction", self.reaction, get_args(Reaction))
        for name in ("period", "latency"):
            number_argument("Policy", name, getattr(self, name), "seconds > 0", above=0.0)
        number_argument("Policy", "linger", self.linger, "seconds >= 0", 0.0)

    @classmethod
    def of(cls, policy: Any, separation: Any = None) -> "Policy":
        """Return a policy, or that of a name, which goes with a `Separation`, where there is one.

        Raises:
            InputError: it is neither, or does not.
        """
        choices: tuple[Reaction, ...] = get_args(Reaction)
        named = [one for one in choices if isinstance(policy, str) and one == policy]
        found = policy if isinstance(policy, Policy) else WAIT if named == ["wait"] else None
        if found is None and not named:
            raise wrong_argument(
                "Executor", "policy", described(policy), f"an op.Policy, or one of: {', '.join(choices)}"
            )
        found = cls(named[0]) if found is None else found
        if separation is not None and not isinstance(separation, Separation):
            raise wrong_argument("Executor", "separation", described(separation), "an op.Separation(…), or None")
        if separation is not None and found.goes_on:
            raise wrong_argument("Executor", "policy", f"'{found.reaction}' beside people", "wait or stop")
        return found

    def refused(self, problem: Problem) -> str:
        """Return what keeps the policy from another motion to the goal of a problem; nothing where it plans none."""
        if self.reaction != "replan":
            return ""
        hand = "" if problem.source else "a problem that was put together by hand"
        return "a task" if problem.task else "vias" if problem.vias else hand

    @property
    def goes_on(self) -> bool:
        """Whether the robot goes on where its path is blocked, as far as that is clear."""
        return self.reaction in ("slow", "replan")

    @property
    def spare(self) -> float:
        """What a law must leave when it is chosen, m, beyond what it must keep."""
        return SPARE if self.goes_on else 0.0

    def law(
        self, laws: PathLaws, law: "TimeLaw", now: float, wanted: float, blocked: Callable[["TimeLaw"], object]
    ) -> "TimeLaw | None":
        """Return the law of a robot that goes on where its path is blocked, clear until it stands still, or the stop.

        None where neither can begin now, or the robot stands still.

        Args:
            laws: along the path.
            law: the present one.
            now: s.
            wanted: the speed that is wanted.
            blocked: what blocks the way of a law; None: nothing.
        """
        place = PathPlace(*law.at(now))
        if self.reaction == "replan" and blocked(later := laws.then_stop(law, now + self.latency)) is None:
            return later
        found, first, last = None, 0, len(SPEEDS) - 1 if self.reaction == "slow" else -1
        while first <= last:  # by halves: each costs a millisecond
            middle = (first + last) // 2
            slower = laws.change(place, now, SPEEDS[middle] * wanted)
            if slower is not None and blocked(later := laws.then_stop(slower, now + self.period)) is None:
                found, last = later, middle - 1
            else:
                first = middle + 1
        if found is not None:
            return found
        return None if rests(law, now) else laws.change(place, now, 0.0)


WAIT = Policy("wait", linger=0.0)
"""What an executor does without a policy."""
