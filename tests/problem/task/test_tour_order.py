"""What is wrong with an order, in words; precedence and circles."""

from time import process_time

import numpy as np
import pinocchio as pin
import pytest

from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.task.steps import Target, TargetTour
from optiplan.problem.task.tour_order import cycle, precedence, wrong_order

GOAL = RegionGoal("tool", pin.SE3.Identity(), pin.SE3.Identity(), np.zeros(6), np.zeros(6))
A, C = Target("a", GOAL, cluster="left"), Target("c", GOAL, cluster="left")
B, D = Target("b", GOAL, window=(2.0, 4.0)), Target("d", GOAL, after=("a",))


@pytest.mark.parametrize(
    ("tour", "arrived", "words"),
    [
        ({}, {"a": 1, "c": 2, "b": 3, "d": 4}, ""),
        ({}, {"a": 1, "c": 2, "b": 3}, "not every target is visited once: d"),
        ({}, {"d": 1, "a": 2, "c": 2.5, "b": 3}, "'d' is visited before 'a'"),
        ({}, {"b": 1, "a": 2, "c": 3, "d": 4}, "'b' is reached at 1 s, outside [2, 4] s"),
        ({}, {"a": 1, "b": 2, "c": 3, "d": 4}, "the cluster 'left' is not visited in one go"),
        ({"first": "c"}, {"a": 1, "c": 2, "b": 3, "d": 4}, "'a' is visited first, not 'c'"),
        ({"last": "b"}, {"a": 1, "c": 2, "b": 3, "d": 4}, "'d' is visited last, not 'b'"),
        ({"free": False}, {"a": 1, "c": 2, "b": 3, "d": 4}, "the order is not that of the list"),
    ],
)
def test_each_broken_statement_is_told(tour, arrived, words):
    assert wrong_order(TargetTour((), (A, B, C, D), **tour), arrived) == words


def test_precedence_is_transitive_and_of_whole_clusters():
    before = precedence(TargetTour((), (A, B, C, D)))
    assert before[[0, 2], 3].all()  # d after a, so after all of a's cluster
    assert before.sum() == 2
    e = Target("e", GOAL, after=("d",))
    assert precedence(TargetTour((), (A, B, C, D, e)))[[0, 2, 3], 4].all()


def test_a_circle_is_named():
    f = Target("f", GOAL, after=("g",))
    g = Target("g", GOAL, after=("f",))
    assert sorted(cycle(TargetTour((), (A, f, g)))) == ["f", "g"]
    assert cycle(TargetTour((), (A, B, C, D))) == []


def test_a_circle_of_many_targets_is_found():
    """Two halves, each after the other: 256 targets lie between any two, which a byte counts as none."""
    halves = [[f"{half}{k}" for k in range(256)] for half in "ab"]
    targets = [Target(name, GOAL, after=tuple(halves[1 - k])) for k in range(2) for name in halves[k]]
    assert len(cycle(TargetTour((), tuple(targets)))) == 2


def test_many_targets_in_any_order_cost_nothing():
    tour = TargetTour((), tuple(Target(f"t{k}", GOAL) for k in range(3000)))
    began = process_time()
    assert cycle(tour) == []
    assert process_time() - began < 2.0
