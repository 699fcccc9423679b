"""Motions that a planner finds are proved while it goes on, and nobody is told that one is verified which is not."""

import time
from dataclasses import dataclass, field

import pytest

import optiplan as op
from optiplan.planners.base import Budget, announce, stages_of
from optiplan.runs import selection
from optiplan.runs.proofs_on_the_way import ProofsOnTheWay
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report
from optiplan.verify.verify import verify


@pytest.fixture(scope="module")
def problem() -> op.Problem:
    return op.load_problem("01_reach")


@pytest.fixture(scope="module")
def motion(problem: op.Problem) -> Trajectory:
    found = op.plan(problem, "rrtconnect").trajectory
    assert found is not None
    return found


@dataclass
class Heard:
    """What a progress was told."""

    found_: list[float] = field(default_factory=list)
    proved_: list[tuple[float, float]] = field(default_factory=list)
    stages: list[str] = field(default_factory=list)

    def __call__(self, stage: str, fraction: float) -> None:
        self.stages.append(stage)

    def found(self, motion: Trajectory, bound: float) -> None:
        self.found_.append(motion.duration)

    def proved(self, motion: Trajectory, seconds: float) -> None:
        self.proved_.append((seconds, motion.duration))


def test_a_motion_that_the_verifier_refuses_is_found_and_not_proved(problem: op.Problem, motion: Trajectory) -> None:
    heard = Heard()
    proofs = ProofsOnTheWay(problem, heard)
    fast = motion.scaled(0.1 * motion.duration)
    proofs.found(fast, 0.0)
    assert heard.found_ == [fast.duration]
    assert heard.proved_ == []
    verdict = proofs.verdict(fast)
    assert verdict is not None
    assert not verdict.report.verified
    assert 0.0 < verdict.proof <= verdict.seconds


def test_the_first_motion_is_proved_at_once_and_one_right_after_it_is_left_for_the_end(
    problem: op.Problem, motion: Trajectory
) -> None:
    heard = Heard()
    proofs = ProofsOnTheWay(problem, heard)
    slow = motion.scaled(1.1 * motion.duration)
    proofs.found(slow, 0.0)
    proofs.found(motion, 0.0)
    assert heard.found_ == [slow.duration, motion.duration]
    assert [duration for _, duration in heard.proved_] == [slow.duration]
    assert proofs.verdict(motion) is None
    assert proofs.seconds > 0.0


def test_who_was_told_of_a_later_motion_is_not_told_of_an_earlier_one(problem: op.Problem, motion: Trajectory) -> None:
    heard = Heard()
    proofs = ProofsOnTheWay(problem, heard)
    for seconds in (1.0, 0.5, 1.0, 2.0):
        proofs.proved(motion, seconds)
    assert [seconds for seconds, _ in heard.proved_] == [1.0, 2.0]


def test_what_was_proved_on_the_way_is_not_proved_again(monkeypatch: pytest.MonkeyPatch) -> None:
    heard, again = Heard(), []
    problem = op.load_problem("02_shelf")

    def counted(problem: op.Problem, trajectory: Trajectory) -> op.Report:
        again.append(trajectory.duration)
        return verify(problem, trajectory)

    monkeypatch.setattr(selection, "verify", counted)
    run = op.plan(problem, budget=5.0, progress=heard)
    assert run.verified
    assert heard.proved_[0][1] == heard.found_[0]
    assert heard.found_[0] not in again
    assert len(heard.found_) > 1, "or this says nothing of those that are proved in the end"
    assert len(again) == len(set(again))
    assert tuple(heard.proved_) == tuple(one for one in run.improvements if one in heard.proved_)
    assert heard.proved_[-1] == run.improvements[-1] == (run.improvements[-1][0], run.duration)


def test_a_part_of_the_work_tells_stages_and_no_motions(motion: Trajectory) -> None:
    heard = Heard()
    part = stages_of(heard)
    part("going", 0.5)
    announce(part, motion)
    assert (heard.stages, heard.found_) == (["going"], [])


def test_the_planner_leaves_as_much_time_as_the_first_proof_took(
    problem: op.Problem, motion: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The proof is inside the budget: what one took is reserved for the next."""

    def slow(problem: op.Problem, motion: Trajectory) -> Report:
        time.sleep(0.2)
        return verify(problem, motion)

    monkeypatch.setattr("optiplan.runs.proofs_on_the_way.verify", slow)
    whole = Budget(60.0)
    within = whole.leaving(0.01)
    ProofsOnTheWay(problem, Heard(), within).found(motion, 0.0)
    assert whole.remaining - within.remaining >= 0.2


def test_what_proofs_cost_beyond_the_budget_is_among_the_timings(
    problem: op.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(problem: op.Problem, motion: Trajectory) -> Report:
        time.sleep(0.5)
        return verify(problem, motion)

    for module in ("selection", "proofs_on_the_way"):
        monkeypatch.setattr(f"optiplan.runs.{module}.verify", slow)
    timings = op.plan(problem, "quintic", budget=0.25).timings
    assert timings["beyond the budget"] >= 0.2
    assert timings["plan"] + timings["verify"] >= 0.25
