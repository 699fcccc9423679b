"""Select the best candidate of a planner that the verifier accepts."""

from collections.abc import Iterator
from dataclasses import replace

from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.runs.proofs_on_the_way import ProofsOnTheWay, Verdict
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, Report
from optiplan.verify.verify import verify

_CURED_BY_TIME = {"velocity", "acceleration", "jerk", "torque"}
_SLOWER = (1.002, 1.01, 1.03, 1.1)

_RATES_ASKED = {"tool speed constraint": 1.0, "wheel speed constraint": 1.0, "tool acceleration constraint": 0.5}
"""Checks of what a problem asks of a motion's pace, which planners need not know, and the power of (worst / limit) by
which a motion must be slower to satisfy them."""


@dataclass(frozen=True, eq=False)
class Selection:
    """The selected motion.

    Attributes:
        trajectory: the shortest motion that is verified; where none is, the planner's own choice.
        report: of its verification.
        proof: time that this took, s.
        slowed: factor on the planner's duration; above 1 where only that satisfied the limits.
        answers: (seconds of planning and proving, motion) of every verified answer on the way, in order of seconds and
            of durations; one whose proof would have ended after that of a better one is left out. The first one was
            proved when it was found (`ProofsOnTheWay`); one proved at the end is counted with its own proof alone.
    """

    trajectory: Trajectory
    report: Report
    proof: float
    slowed: float = 1.0
    answers: tuple[tuple[float, Trajectory], ...] = ()

    @property
    def improvements(self) -> tuple[tuple[float, float], ...]:
        """Return (seconds, duration in s) of the answers."""
        return tuple((seconds, motion.duration) for seconds, motion in self.answers)


def best_verified(problem: Problem, candidates: list[Candidate], budget: Budget, proofs: ProofsOnTheWay) -> Selection:
    """Verify candidates, the planner's own choice last, but for those proved on the way, and select the best.

    One refused for a rate or a torque alone is tried again slightly slower, unless another candidate is as fast
    as that. The planner's own choice is always verified, the others while the budget lasts. Beyond it one slower motion
    is, that of the largest step: a proof late is better than a motion that is none.

    Raises:
        ValueError: there are no candidates.
    """
    refused: Selection | None = None
    for place in reversed(range(len(candidates))):
        known = proofs.verdict(candidates[place].trajectory)
        if refused is not None and budget.over and not (known and known.report.verified):
            continue
        other = candidates[place - 1].trajectory.duration if place else float("inf")
        for tried, seconds in _slower_and_slower(problem, candidates[place], other, budget, proofs):
            if tried.report.verified:
                before = _verified(problem, candidates[:place], budget, proofs)
                return replace(tried, answers=_in_turn([*before, (seconds, tried.trajectory)]))
            refused = refused or tried
    if refused is None:
        raise ValueError("there are no candidates")
    return refused


def _slower_and_slower(
    problem: Problem, candidate: Candidate, other: float, budget: Budget, proofs: ProofsOnTheWay
) -> Iterator[tuple[Selection, float]]:
    """Yield the verdict on a candidate, then on slower ones shorter than `other`, s, while that may satisfy the checks.

    With each come the seconds of planning and proving. Where the problem limits the pace of the tool or the wheels, the
    first slower one is as slow as that asks for.
    """
    asked = 1.0
    for step in (1.0, *_SLOWER):
        if step > 1.0 and (budget.cancelled or (budget.over and step < _SLOWER[-1])):
            continue
        factor = step * asked
        trajectory = candidate.trajectory
        if factor > 1.0:
            trajectory = trajectory.scaled(trajectory.duration * factor)
            if trajectory.duration >= other:
                return
        found = _verdict(problem, Candidate(trajectory, candidate.seconds), proofs)
        yield Selection(trajectory, found.report, found.proof, factor), found.seconds
        if not {check.name for check in found.report.failures} <= _CURED_BY_TIME | set(_RATES_ASKED):
            return
        if step == 1.0:
            asked = max((_pace(check) for check in found.report.failures), default=1.0)


def _pace(check: Check) -> float:
    """Return the factor on the duration that a failed check asks for, as far as it says."""
    power = _RATES_ASKED.get(check.name)
    if power is None or not check.worst or not check.limit:
        return 1.0
    return float(max(1.0, check.worst / check.limit) ** power)


def _verdict(problem: Problem, candidate: Candidate, proofs: ProofsOnTheWay) -> Verdict:
    """Return the verdict on a candidate, proved now if it was not on the way."""
    known = proofs.verdict(candidate.trajectory)
    if known is not None:
        return known
    began = clock()
    report = verify(problem, candidate.trajectory)
    proof = clock() - began
    return Verdict(candidate.trajectory, report, candidate.seconds + proof, proof)


def _verified(
    problem: Problem, earlier: list[Candidate], budget: Budget, proofs: ProofsOnTheWay
) -> list[tuple[float, Trajectory]]:
    """Return seconds and motion of the earlier candidates that are verified; new proofs are made within the budget."""
    found = []
    for candidate in earlier:
        if not budget.over or proofs.verdict(candidate.trajectory):
            verdict = _verdict(problem, candidate, proofs)
            if verdict.report.verified:
                found.append((verdict.seconds, candidate.trajectory))
    return found


def _in_turn(answers: list[tuple[float, Trajectory]]) -> tuple[tuple[float, Trajectory], ...]:
    """Keep those that were not proved after a better one, in order."""
    kept: list[tuple[float, Trajectory]] = []
    for answer in reversed(answers):
        if not kept or answer[0] < kept[-1][0]:
            kept.append(answer)
    return tuple(reversed(kept))
