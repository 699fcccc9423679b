"""The order of a tour: what it must keep to, and what is wrong with one."""

from itertools import groupby

import numpy as np

from optiplan.arrays import Flags
from optiplan.problem.task.steps import TargetTour

_ROUNDING = 1e-9
"""s, by which an arrival may be outside its window."""


def wrong_order(tour: TargetTour, arrived: dict[str, float]) -> str:
    """Return in words what is wrong with a tour that arrives at targets at these times, s; empty if nothing is.

    `arrived` is in the order of the arrivals.
    """
    names = list(arrived)
    if sorted(names) != sorted(target.name for target in tour.targets):
        missing = [target.name for target in tour.targets if target.name not in arrived]
        return f"not every target is visited once: {', '.join(missing[:6]) or 'some have other names'}"
    for target in tour.targets:
        for other in target.after:
            if arrived[other] > arrived[target.name] or names.index(other) > names.index(target.name):
                return f"'{target.name}' is visited before '{other}'"
        low, high = target.window
        if not low - _ROUNDING <= arrived[target.name] <= high + _ROUNDING:
            return f"'{target.name}' is reached at {arrived[target.name]:.6g} s, outside [{low:g}, {high:g}] s"
    clusters = {target.name: target.cluster for target in tour.targets}
    visited = [cluster for cluster, _ in groupby(names, clusters.__getitem__) if cluster]
    if len(set(visited)) < len(visited):
        return f"the cluster '{next(one for one in visited if visited.count(one) > 1)}' is not visited in one go"
    for wanted, found, words in ((tour.first, names[0], "first"), (tour.last, names[-1], "last")):
        if wanted and wanted != found:
            return f"'{found}' is visited {words}, not '{wanted}'"
    if not tour.free and names != [target.name for target in tour.targets]:
        return "the order is not that of the list"
    return ""


def precedence(tour: TargetTour) -> Flags:
    """Return which target is visited before which, (m, m) of 0 and 1: entry [i, j] where i comes before j.

    From `after`, `first`, `last` and the order of the list where it is given, closed under transitivity. Where a
    target of one cluster comes before one of another, all of the one come before all of the other.
    """
    names = [target.name for target in tour.targets]
    m, places = len(names), {name: k for k, name in enumerate(names)}
    before = np.zeros((m, m), dtype=bool)
    for j, target in enumerate(tour.targets):
        before[[places[other] for other in target.after], j] = True
    if tour.first:
        before[places[tour.first], [name != tour.first for name in names]] = True
    if tour.last:
        before[[name != tour.last for name in names], places[tour.last]] = True
    if not tour.free:
        before |= np.triu(np.ones((m, m), dtype=bool), 1)
    if not before.any():
        return before
    clusters = [np.array([one.cluster == name for one in tour.targets]) for name in _clusters(tour)]
    while True:
        closed = before | implied(before)
        for own in clusters:
            closed |= np.outer(own, closed[own].any(axis=0) & ~own)
            closed |= np.outer(closed[:, own].any(axis=1) & ~own, own)
        if (closed == before).all():
            return before
        before = closed


def implied(before: Flags) -> Flags:
    """Return the pairs (m, m) of a relation with another target between them: i before j before k."""
    small = before.astype(np.float32)  # whole numbers have no fast product, and those of one byte end at 255
    return np.asarray(small @ small > 0.0)


def cycle(tour: TargetTour) -> list[str]:
    """Return the names of targets that would each have to come before the next, and the last before the first.

    Empty where the order is possible.
    """
    before = precedence(tour)
    caught = np.flatnonzero(np.diag(before))
    if not len(caught):
        return []
    names = [target.name for target in tour.targets]
    direct = {target.name: target.after for target in tour.targets}
    for k in caught:  # a short one that `after` alone makes, if there is one
        path = _path_back(direct, names[int(k)])
        if path:
            return path
    return [names[int(k)] for k in caught]


def _path_back(direct: dict[str, tuple[str, ...]], name: str) -> list[str]:
    came: dict[str, str] = {}
    waiting = [name]
    while waiting:
        here = waiting.pop(0)
        for other in direct[here]:
            if other == name:
                path = [here]
                while path[-1] != name:
                    path.append(came[path[-1]])
                return path
            if other not in came:
                came[other] = here
                waiting.append(other)
    return []


def _clusters(tour: TargetTour) -> list[str]:
    return list(dict.fromkeys(target.cluster for target in tour.targets if target.cluster))
