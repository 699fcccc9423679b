"""Layers of random configurations, and the cost of a tour by definition."""

from itertools import pairwise, permutations, product

import numpy as np
import pinocchio as pin

import optiplan as op
from optiplan.planners.tours.ladder import Ladder
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.planners.tours.vertices import Layer
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.task.steps import Process, Target, TargetTour
from optiplan.problem.task.tour_order import wrong_order

GOAL = RegionGoal("tool", pin.SE3.Identity(), pin.SE3.Identity(), np.zeros(6), np.zeros(6))


def ladder_of(targets, **tour):
    """Return a ladder from zero for targets given by what is stated of them."""
    named = tuple(Target(name, GOAL, **stated) for name, stated in targets.items())
    limits = op.load_robot("ur5").limits
    return Ladder(TargetTour((), named, at_each=(Process(0.25),), **tour), np.zeros(6), TravelTimes(limits))


def random_layers(m, k, seed):
    """Return m layers of k configurations each."""
    Q = np.random.default_rng(seed).uniform(-2, 2, (m, k, 6))
    return [Layer(Q[i], k * i + np.arange(k)) for i in range(m)]


def seconds_of(ladder, order, Q):
    """Return the duration of a tour, s; infinite where it is not as stated."""
    tour, now, arrived = ladder.tour, 0.0, {}
    for target, (a, b) in zip(order, pairwise([ladder.start, *Q]), strict=True):
        low, _ = tour.targets[target].window
        now = max(now + ladder.times.along(np.array([a, b]))[0], low)
        arrived[tour.targets[target].name] = now
        now += tour.dwelling
    if wrong_order(tour, arrived):
        return np.inf
    return now + (ladder.times.along(np.array([Q[-1], ladder.start]))[0] if tour.closed else 0.0)


def best_of_all(ladder, layers):
    """Return the shortest duration of any order and any configurations, s."""
    return min(
        seconds_of(ladder, order, [layers[t].Q[k] for t, k in zip(order, chosen, strict=True)])
        for order in permutations(range(len(layers)))
        for chosen in product(*(range(len(layers[t].Q)) for t in order))
    )
