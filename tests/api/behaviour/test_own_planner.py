"""`op.plan` takes a planner itself, and holds what it answers to the protocol."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

import optiplan as op
from optiplan.planners.registry import make_planner


@dataclass(frozen=True)
class SlowOptions:
    slower: float = 1.0
    note: object = None


class Slow(op.Planner):
    """The motion of `quintic`, slowed down."""

    Options = SlowOptions

    def plan(self, problem, budget, progress):
        run = op.plan(problem, "quintic")
        slow = run.trajectory.scaled(self.options.slower * run.duration)
        return op.PlanResult(slow, info={"seen": {1, 2}})


class Plain:
    """A class that is derived from nothing."""

    def __init__(self, answer):
        self.answer = answer

    def plan(self, problem, budget, progress):
        return self.answer


class WithoutConstructor(op.Planner):
    def __init__(self):
        """Nothing."""

    def plan(self, problem, budget, progress):
        return op.PlanResult(failure=op.Failure("no-path", "none"))


def test_an_object_is_a_planner_and_the_run_says_its_class(problem, run, tmp_path):
    slow = op.plan(problem, Slow(SlowOptions(slower=2.0)), budget=5)
    assert slow.verified
    assert slow.duration == pytest.approx(2.0 * run.duration)
    assert (slow.planner, slow.options) == ("Slow", {"slower": 2.0})
    slow.save(tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    assert (record["planner"], record["options"], record["info"]) == ("Slow", {"slower": 2.0}, {"seen": "{1, 2}"})
    assert op.load_run(tmp_path).verified


def test_an_object_of_a_planner_that_comes_along_answers_as_its_name_does(problem, run):
    same = op.plan(problem, make_planner("quintic"))
    assert np.array_equal(same.trajectory.coefficients, run.trajectory.coefficients)


def test_a_class_need_not_be_derived_and_may_have_no_options(problem, run):
    same = op.plan(problem, Plain(op.PlanResult(run.trajectory)))
    assert same.verified
    assert (same.planner, same.options) == ("Plain", {})
    assert op.plan(problem, WithoutConstructor()).failure.kind == "no-path"


def test_past_vias_it_is_asked_leg_by_leg(problem):
    past = op.plan(problem.with_vias([0.3, 0.3]), Slow(), budget=5)
    assert past.verified
    assert len(past.info["legs"]) == 2


@pytest.mark.parametrize("answer", [None, 3, op.PlanResult(), op.PlanResult([[0, 0]]), op.Failure("no-path", "x")])
def test_what_is_no_answer_is_named(problem, answer):
    with pytest.raises(op.InputError, match=r"planner Plain: plan: returned .*; expected a PlanResult"):
        op.plan(problem, Plain(answer))


def test_options_belong_to_the_object(problem):
    with pytest.raises(op.InputError, match=r"op\.plan: options: .*made with its options"):
        op.plan(problem, Slow(), {"slower": 2.0})
    with pytest.raises(op.InputError, match=r"op\.plan: planner: .*an object with plan"):
        op.plan(problem, Slow)
