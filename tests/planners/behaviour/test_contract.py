"""What every planner of the registry owes its callers, on small problems; a new entry is held to it by being there."""

import json
import logging
import threading
import time
from dataclasses import dataclass
from functools import cache
from typing import get_args

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.planners.base import Budget, FailureKind
from optiplan.planners.registry import PLANNERS, make_planner
from optiplan.problem.problem import JointGoal
from optiplan.runs.pipeline import run
from optiplan.runs.run import Run
from tests.planners import cases

pytestmark = [pytest.mark.usefixtures("processor_clock"), pytest.mark.no_cover]
"""Tracing would slow planners down, all of which have tests of their own."""

KINDS = set(get_args(FailureKind)) - {"input", "bug"}
"""Those that planners give."""
BUDGET = 0.3  # s
WARM = 0.1  # s, for imports and caches
PATIENT = 20.0  # s, where a slow machine left a planner no time
LATE = 0.8  # s of the processor that a planner may be late, on a machine that does other things as well
STEPS = {"rest", "continuity", "jerk"}  # checks by which motions with steps of acceleration are refused


@dataclass(frozen=True, eq=False)
class Answer:
    run: Run | None
    refusal: InputError | None
    seconds: float
    left_alone: bool
    """Whether the problem's numbers are after it what they were before."""


def told(stage, fraction):
    assert isinstance(stage, str)
    assert 0.0 <= fraction <= 1.0


def plan(name, problem, seconds):
    return run(problem, name, cases.OPTIONS.get(name, {}), Budget(seconds), told)


@cache
def answer(name, case, seconds=BUDGET):
    """What the planner says to the problem, asked once for all tests."""
    problem = cases.CONTRACT[case].make()
    arrays = numbers(problem)
    before = [array.copy() for array in arrays]
    began = time.process_time()
    try:
        found, refusal = plan(name, problem, seconds), None
    except InputError as error:
        found, refusal = None, error
    took = time.process_time() - began if found is None else found.timings["plan"]
    return Answer(found, refusal, took, all(np.array_equal(a, b) for a, b in zip(arrays, before, strict=True)))


def numbers(problem):
    """The arrays of a problem that a planner may not change."""
    goals = [goal.q for goal in problem.goal if isinstance(goal, JointGoal)]
    return [problem.start, *goals, *vars(problem.limits).values(), problem.robot.model.lowerPositionLimit]


def result(name, problem, budget):
    """What `plan` itself returns; None when the planner refuses the problem."""
    try:
        return make_planner(name, cases.OPTIONS.get(name, {})).plan(problem, budget, told)
    except InputError:
        return None


@pytest.fixture(scope="module", params=sorted(PLANNERS))
def name(request):
    for case in ("free", "pose"):
        answer(request.param, case, WARM)  # imports and caches warm: the tests look at the clock
    return request.param


@pytest.fixture(scope="module", autouse=True)
def _no_log():
    """What is worked out once for a robot is logged, by nobody's planner."""
    logging.disable(logging.INFO)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.parametrize("case", sorted(cases.CONTRACT))
def test_trajectory_or_reason(name, case, capfd):
    found = answer(name, case)
    assert capfd.readouterr() == ("", "")
    assert found.seconds < BUDGET + LATE
    if found.run is None:
        assert all(issue.file == f"planner '{name}'" for issue in found.refusal.issues)
        assert PLANNERS[name].family == "Cartesian", "only paths of the tool need options"
        return
    assert (found.run.trajectory is None) != (found.run.failure is None)
    done = found.run
    if no_time(name, case, done):
        done = plan(name, cases.CONTRACT[case].make(), PATIENT)
    if done.failure is not None:
        check_failure(name, case, done)
    else:
        check_motion(name, case, done)


def no_time(name, case, found):
    """Whether more time may change the answer: the clock ended it, or a search where there is a motion to be found."""
    if found.failure is None:
        return False
    if PLANNERS[name].family in ("optimisation", "sampling"):
        return found.failure.kind == "no-path" and cases.CONTRACT[case].search is None
    return found.failure.kind == "budget" and PLANNERS[name].family != "Cartesian"


def check_failure(name, case, found):
    failure, expected = found.failure, cases.CONTRACT[case]
    assert failure.kind in KINDS
    assert len(failure.detail) > 20
    assert "\n" not in failure.detail
    json.dumps(dict(failure.witness), allow_nan=False)
    if PLANNERS[name].family == "Cartesian":
        return
    searches = PLANNERS[name].family in ("optimisation", "sampling")
    allowed = expected.search if searches else expected.simple
    assert failure.kind in (allowed or set()) | ({"budget"} if searches else set()), failure
    if failure.kind not in ("budget", "cancelled", "no-path"):
        assert np.isfinite(failure.witness["q"]).all()
    if case == "barred" and PLANNERS[name].family == "sampling":
        assert failure.kind == "no-path"
        assert failure.witness["pair"][1].startswith("bar")


def check_motion(name, case, found):
    assert cases.CONTRACT[case].search is None, "there is no motion"
    refused = {check.name for check in found.report.failures}
    assert refused <= (STEPS if PLANNERS[name].family in ("polynomial", "via points") else set()), found.report.failures
    if case == "unlimited-jerk":
        assert found.verified
    told, took = sum(found.stages.values()), found.timings["plan"]
    assert told < took + 0.01
    assert told > 0.5 * took - 0.2, "stages tell where the time went"
    json.dumps(found.to_dict()["info"], allow_nan=False)


def test_some_problem_is_solved(name):
    """Else the tests above would be content with a planner that gives up always."""
    assert any(found.run and found.run.verified for found in (answer(name, case) for case in cases.CONTRACT))


def unsure(name, case, found):
    """Whether there is no answer to compare, or the clock had a part in it."""
    if found is None or found.info.get("cut_short") or no_time(name, case, found):
        return True
    return found.failure is not None and found.failure.kind == "budget"


@pytest.mark.parametrize("case", ["one-box", "of-the-tool"])
def test_same_problem_same_answer(name, case):
    """The budget is part of the question: a planner may look longer for a better motion when it has more of it."""
    case = case.replace("of-the-tool", "round-trip" if name == "circle" else "pose")
    first = answer(name, case).run
    if unsure(name, case, first):
        pytest.skip("no answer, or one that the clock cut short")
    second = plan(name, cases.CONTRACT[case].make(), BUDGET)
    if unsure(name, case, second):
        pytest.skip("the clock cut the second answer short")
    assert first.failure == second.failure
    if first.trajectory is not None:
        assert np.array_equal(first.trajectory.breakpoints, second.trajectory.breakpoints)
        assert np.array_equal(first.trajectory.coefficients, second.trajectory.coefficients)


@pytest.mark.parametrize(("case", "after"), [("barred", 0.15), ("one-box", 0.05), ("pose", 0.1)])
def test_cancel_stops_it_at_once(name, case, after):
    cancel, done = threading.Event(), []
    worker = threading.Thread(
        target=lambda: done.append(result(name, cases.CONTRACT[case].make(), Budget(60.0, cancel)))
    )
    worker.start()
    worker.join(after)
    was_done = not worker.is_alive()
    cancel.set()
    began = time.process_time()
    worker.join(60.0)
    assert not worker.is_alive()
    assert time.process_time() - began < 0.2 + 0.3  # of this process, whatever others do
    if not was_done and done[0] is not None and done[0].trajectory is None:
        assert done[0].failure.kind in KINDS
    if case == "barred" and PLANNERS[name].family == "sampling":
        assert done[0].failure.kind == "cancelled"


def test_no_time_no_answer(name):
    found = result(name, cases.one_box(), Budget(0.0))
    if found is not None:
        assert found.trajectory is None
        assert found.failure.kind in KINDS


def test_the_problem_is_left_alone(name):
    assert [case for case in cases.CONTRACT if not answer(name, case).left_alone] == []
