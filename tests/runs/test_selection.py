"""Of several answers the best one that the real verifier accepts, a little slower where only that helps."""

import threading
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.planners.base import Budget, Candidate, Failure, PlanResult
from optiplan.problem.problem import Problem, derived
from optiplan.runs import selection
from optiplan.runs.pipeline import run
from optiplan.runs.proofs_on_the_way import ProofsOnTheWay
from optiplan.runs.selection import Selection, best_verified
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify
from tests.planners import cases


@pytest.fixture(scope="module")
def problem() -> Problem:
    return cases.planar()


@pytest.fixture(scope="module")
def fastest(problem: Problem) -> Trajectory:
    """The straight line in the least time that its limits allow."""
    ends = np.array([problem.start, problem.goal[0].q])
    return stop_at_corners(ends, problem.limits, problem.robot.joint_names)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Durations of what the verifier was asked about, in order."""
    durations: list[float] = []

    def counted(problem: Problem, trajectory: Trajectory) -> object:
        durations.append(trajectory.duration)
        return verify(problem, trajectory)

    monkeypatch.setattr(selection, "verify", counted)
    return durations


def selected(problem: Problem, candidates: list[Candidate], budget: Budget) -> Selection:
    """The selection where nothing was proved on the way."""
    return best_verified(problem, candidates, budget, ProofsOnTheWay(problem, silent))


def silent(stage: str, fraction: float) -> None:
    """Progress that nobody wants to know."""


def answers(trajectory: Trajectory, *factors: float) -> list[Candidate]:
    """The same path in several durations, a tenth of a second apart."""
    scaled = [trajectory.scaled(factor * trajectory.duration) for factor in factors]
    return [Candidate(one, 0.1 * (place + 1)) for place, one in enumerate(scaled)]


def test_the_favourite_is_the_answer_where_it_is_verified(problem: Problem, fastest: Trajectory) -> None:
    candidates = answers(fastest, 2.0, 1.5, 1.1)
    chosen = selected(problem, candidates, Budget(60.0))
    assert chosen.trajectory is candidates[-1].trajectory
    assert chosen.report.verified
    assert chosen.slowed == 1.0
    durations = [duration for _, duration in chosen.improvements]
    assert durations == [candidate.trajectory.duration for candidate in candidates]


def test_an_earlier_answer_stands_in_for_one_that_is_refused(problem: Problem, fastest: Trajectory) -> None:
    """Twice too fast: a tenth slower does not mend it."""
    candidates = answers(fastest, 1.5, 1.2, 0.5)
    chosen = selected(problem, candidates, Budget(60.0))
    assert chosen.trajectory is candidates[1].trajectory
    assert chosen.report.verified
    assert chosen.slowed == 1.0
    assert [duration for _, duration in chosen.improvements] == [c.trajectory.duration for c in candidates[:2]]


@pytest.mark.parametrize(("share", "factor"), [(0.9985, 1.002), (0.995, 1.01), (0.98, 1.03), (0.92, 1.1)])
def test_what_is_a_little_too_fast_is_slowed_as_little_as_does(
    problem: Problem, fastest: Trajectory, share: float, factor: float
) -> None:
    chosen = selected(problem, answers(fastest, 2.0, share), Budget(60.0))
    assert chosen.report.verified
    assert chosen.slowed == factor
    assert chosen.trajectory.duration == pytest.approx(share * factor * fastest.duration)
    assert chosen.improvements[-1][1] == chosen.trajectory.duration


def test_slowing_stops_where_another_answer_is_as_fast(problem: Problem, fastest: Trajectory) -> None:
    candidates = answers(fastest, 1.001, 0.98)
    chosen = selected(problem, candidates, Budget(60.0))
    assert chosen.trajectory is candidates[0].trajectory
    assert chosen.slowed == 1.0


def test_too_much_torque_alone_is_slowed() -> None:
    free = cases.free()
    ends = np.array([free.start, free.goal[0].q])
    motion = stop_at_corners(ends, free.limits, free.robot.joint_names)
    peaks, slower = (_peaks(free, motion.scaled(factor * motion.duration)) for factor in (1.0, 1.1))
    joint = int(np.argmax(peaks - slower))
    limit = np.full(7, np.inf)
    limit[joint] = 0.5 * (peaks[joint] + slower[joint])
    weak = derived(free, limits=replace(free.limits, torque=limit))
    failed = {check.name for check in verify(weak, motion).checks if not check.passed}
    assert failed == {"torque"}
    chosen = selected(weak, [Candidate(motion, 0.1)], Budget(60.0))
    assert chosen.report.verified
    assert 1.0 < chosen.slowed <= 1.1


def _peaks(problem: Problem, trajectory: Trajectory) -> np.ndarray:
    """Largest |torque| of each joint at samples, N·m."""
    model = problem.robot.model
    data, t = model.createData(), np.linspace(0.0, trajectory.duration, 400)
    motion = [trajectory(t, order) for order in range(3)]
    return np.abs([pin.rnea(model, data, q, v, a) for q, v, a in zip(*motion, strict=True)]).max(axis=0)


def test_what_touches_is_not_slowed(asked: list[float]) -> None:
    wall = cases.wall()
    ends = np.array([wall.start, wall.goal[0].q])
    through = stop_at_corners(ends, wall.limits, wall.robot.joint_names)
    fast = through.scaled(0.999 * through.duration)  # too fast as well: time alone would not mend it
    chosen = selected(wall, [Candidate(through, 0.1), Candidate(fast, 0.2)], Budget(60.0))
    assert asked == [fast.duration, through.duration]
    assert not chosen.report.verified
    assert chosen.slowed == 1.0
    assert chosen.improvements == ()


def test_where_nothing_is_verified_the_favourite_and_its_report_are_the_answer(
    problem: Problem, fastest: Trajectory
) -> None:
    candidates = answers(fastest, 0.6, 0.5)
    chosen = selected(problem, candidates, Budget(60.0))
    assert chosen.trajectory is candidates[-1].trajectory
    assert not chosen.report.verified
    assert chosen.slowed == 1.0
    assert {check.name for check in chosen.report.checks if not check.passed} >= {"velocity"}


def test_without_time_only_the_favourite_is_looked_at_and_once_a_slower_one(
    problem: Problem, fastest: Trajectory, asked: list[float]
) -> None:
    for share, verified in ((0.5, False), (0.98, True)):
        asked.clear()
        chosen = selected(problem, answers(fastest, 1.2, share), Budget(0.0))
        assert asked == [pytest.approx(factor * share * fastest.duration) for factor in (1.0, 1.1)]
        assert chosen.report.verified == verified
        assert chosen.slowed == (1.1 if verified else 1.0)
    asked.clear()
    chosen = selected(problem, answers(fastest, 1.5, 1.2), Budget(0.0))
    assert asked == [pytest.approx(1.2 * fastest.duration)]
    assert [duration for _, duration in chosen.improvements] == asked


def test_without_time_a_motion_that_was_proved_before_is_the_answer(
    problem: Problem, fastest: Trajectory, asked: list[float]
) -> None:
    candidates, proofs = answers(fastest, 1.5, 1.2, 0.5), ProofsOnTheWay(problem, silent)
    proofs.found(candidates[0].trajectory, 0.0)
    chosen = best_verified(problem, candidates, Budget(0.0), proofs)
    assert chosen.trajectory is candidates[0].trajectory
    assert chosen.report.verified
    assert asked == [pytest.approx(factor * fastest.duration) for factor in (0.5, 0.55)]


def test_who_cancels_waits_for_no_slower_motion(problem: Problem, fastest: Trajectory, asked: list[float]) -> None:
    cancel = threading.Event()
    cancel.set()
    assert not selected(problem, answers(fastest, 0.98), Budget(60.0, cancel)).report.verified
    assert len(asked) == 1


def test_without_candidates_there_is_no_selection(problem: Problem) -> None:
    with pytest.raises(ValueError, match="no candidates"):
        selected(problem, [], Budget(1.0))


def test_improvements_come_later_and_later(problem: Problem, fastest: Trajectory) -> None:
    """Three answers at practically the same time: the proof of each takes longer than the next one was in coming."""
    scaled = [fastest.scaled(factor * fastest.duration) for factor in (2.0, 1.5, 1.1)]
    candidates = [Candidate(one, 0.1 + 1e-9 * place) for place, one in enumerate(scaled)]
    chosen = selected(problem, candidates, Budget(60.0))
    seconds = [when for when, _ in chosen.improvements]
    assert all(a < b for a, b in pairwise(seconds)), seconds
    assert chosen.improvements[-1][1] == candidates[-1].trajectory.duration


class Given:
    """A planner that returns what it was given."""

    def __init__(self, *candidates: Candidate) -> None:
        self.candidates = candidates

    def plan(self, problem: Problem, budget: Budget, progress: object) -> PlanResult:
        *earlier, last = self.candidates
        return PlanResult(last.trajectory, None, {}, {}, tuple(earlier), last.seconds)


def test_a_run_holds_what_was_chosen(problem: Problem, fastest: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    candidates = answers(fastest, 1.5, 1.2, 0.5)
    monkeypatch.setattr("optiplan.runs.pipeline.make_planner", lambda name, options: Given(*candidates))
    record = run(problem, "given", {}, Budget(60.0), lambda stage, fraction: None)
    assert record.verified
    assert record.duration == candidates[1].trajectory.duration
    assert "slowed" not in record.info
    kept = record.to_dict()["improvements"]
    assert [duration for _, duration in kept] == [c.trajectory.duration for c in candidates[:2]]
    assert kept[-1][1] == record.duration


def test_a_run_says_that_it_was_slowed(problem: Problem, fastest: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("optiplan.runs.pipeline.make_planner", lambda name, options: Given(*answers(fastest, 0.995)))
    record = run(problem, "given", {}, Budget(60.0), lambda stage, fraction: None)
    assert record.verified
    assert record.info["slowed"] == 1.01
    assert record.ratio == pytest.approx(record.duration / record.lower_bound)


def test_a_run_without_an_answer_has_no_improvements(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    class Nothing:
        def plan(self, problem: Problem, budget: Budget, progress: object) -> PlanResult:
            return PlanResult(None, Failure("no-path", "none"), {})

    monkeypatch.setattr("optiplan.runs.pipeline.make_planner", lambda name, options: Nothing())
    record = run(problem, "nothing", {}, Budget(1.0), lambda stage, fraction: None)
    assert record.to_dict()["improvements"] == []
    assert not record.verified


@pytest.mark.parametrize(
    ("key", "bound"), [("tool_speed", {"linear": 0.2}), ("tool_acceleration", {"linear": 1.0})], ids=["speed", "rate"]
)
def test_what_is_too_fast_for_the_tool_is_slowed_as_far_as_the_constraint_asks(
    key: str, bound: dict[str, float]
) -> None:
    reach = op.Problem("planar2r", start=[0.5, 1.0], goal=[-1.0, 0.3])
    slow = reach.with_constraints({key: bound})
    fastest = stop_at_corners(np.array([reach.start, [-1.0, 0.3]]), reach.limits, reach.robot.joint_names)
    assert not verify(slow, fastest).verified
    chosen = selected(slow, answers(fastest, 1.0), Budget(60.0))
    assert chosen.report.verified
    (check,) = [check for check in chosen.report.checks if check.name.endswith("constraint")]
    assert check.worst > 0.9 * check.limit
