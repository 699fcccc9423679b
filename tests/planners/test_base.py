"""The budget: one clock, shares of it, one cancellation."""

import threading

import pytest

from optiplan.planners.base import Budget, Failure, PlanResult
from optiplan.runs import pipeline
from tests.planners import cases


def test_a_share_ends_sooner_and_is_cancelled_together(by_hand):
    cancel = threading.Event()
    whole = Budget(30.0, cancel)
    part = whole.share(0.25)
    assert part.remaining == pytest.approx(7.5)
    cancel.set()
    assert part.over
    assert whole.share(0.5).over


def test_a_budget_that_leaves_time_ends_that_much_sooner(by_hand):
    cancel = threading.Event()
    whole = Budget(30.0, cancel)
    less = whole.leaving(1.5)
    assert whole.remaining - less.remaining == pytest.approx(1.5)
    assert less.seconds == whole.seconds, "shares of it are told of the whole"
    assert less.leaving(40.0).over
    assert not less.over
    cancel.set()
    assert less.over


def test_the_planner_leaves_time_for_the_proof(monkeypatch, by_hand):
    """5 % of the budget, a quarter of a second at most; the clock starts with the planner, not before."""
    left = []

    class Asks:
        def plan(self, problem, budget, progress):
            left.append(budget.remaining)
            return PlanResult(None, Failure("no-path", "none"), {})

    monkeypatch.setattr(pipeline, "make_planner", lambda name, options: Asks())
    for seconds in (1.0, 20.0):
        pipeline.run(cases.planar(), "asks", {}, Budget(seconds), lambda stage, fraction: None)
    assert left == [pytest.approx(0.95), pytest.approx(19.75)]


def test_loading_a_planner_is_not_counted(monkeypatch, by_hand):
    made = pipeline.make_planner

    def slow(name, options):
        by_hand[0] += 3.0
        return made(name, options)

    monkeypatch.setattr(pipeline, "make_planner", slow)
    run = pipeline.run(cases.planar(), "quintic", {}, Budget(2.5), lambda stage, fraction: None)
    assert run.verified, run.failure


@pytest.mark.parametrize("name", ["rrtconnect", "trajopt"])
def test_a_result_that_the_clock_left_alone_says_so(name):
    free = pipeline.run(cases.planar(), name, {}, Budget(60.0), lambda stage, fraction: None)
    assert free.info["cut_short"] is False


def test_a_search_cut_by_the_clock_says_so():
    barred = pipeline.run(cases.barred(), "trajopt", {}, Budget(0.3), lambda stage, fraction: None)
    assert barred.failure is not None
    assert barred.info["cut_short"] is True


def test_what_is_left_for_a_proof_is_left_by_every_part_of_the_budget() -> None:
    whole = Budget(30.0)
    within = whole.leaving(1.0)
    early = within.share(0.9)
    within.leave(20.0)
    assert max(early.remaining, within.remaining) <= 10.0 < whole.remaining
    within.leave(5.0)  # less than what is left already
    assert within.remaining <= 10.0
    assert whole.overrun == 0.0
    assert Budget(0.0).overrun > 0.0
