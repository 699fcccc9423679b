"""The ladder: rungs of configurations along a path, and the cheapest way up them by dynamic programming.

An edge from one rung to the next costs the integral of sum_j (q_j' / limit_j)² over the time that the speed gives it,
and there is none where a joint would pass its speed limit. A jump from one branch to another would, so none is taken.
"""

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import end_collides, out_of_time
from optiplan.planners.seams.rungs import Rungs
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.problem.problem import Problem
from optiplan.problem.seams.actions import SeamPath
from optiplan.records import dataclass

_SPACING, _MOST = 0.02, 1200
"""m between rungs, and how many at most."""

_ALLOWED = 1.0
"""Share of a joint's speed limit between two rungs."""

_JUMP = 0.7
"""rad or m: a joint that moves farther between two rungs jumps."""

_OTHERS, _CORRECTIONS = 6, 6
"""Ways to one configuration that are checked, and corrections of the middle of each."""

_MET = 1e-6
"""m and rad: error of a middle that is met."""

_AHEAD, _NEAR = 0.3, 1e-3
"""Share of the way, and rad or m, by which the middle of a way on one branch is off the middle of its ends."""

_AT_LIMIT = 0.3
"""Weight of being near the limits of joints."""

_APPROACH = 0.2
"""Cost of a second on the way to the first rung."""


@dataclass(frozen=True, eq=False)
class Posture:
    """A configuration at each rung: lengths s (k,), m, and Q (k, n), rad or m."""

    s: Array
    Q: Array


class PostureLadder:
    """The search of one path.

    Args:
        problem: of the joints that move.
        path: the path.
        rungs: that are made as they are needed.
    """

    def __init__(self, problem: Problem, path: SeamPath, rungs: Rungs) -> None:
        self.problem, self.path, self.rungs = problem, path, rungs
        self._times = TravelTimes(problem.limits)

    def lengths(self) -> Array:
        """Return where the rungs are, m: evenly, and at corners."""
        spacing = max(_SPACING, self.path.curve.length / _MOST)
        parts = [np.linspace(a, b, max(2, int(np.ceil((b - a) / spacing))) + 1) for a, b in self.path.curve.runs()]
        return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])

    def climb(self, budget: Budget) -> Posture | Failure:
        """Return the cheapest posture along the path, or why there is none."""
        s = self.lengths()
        rungs = [self.rungs.first(float(s[0]))]
        if not len(rungs[0]):
            return self._unreached(0.0)
        costs = [_APPROACH * self._times.between(self.problem.start[None], rungs[0])[0] + self._own(rungs[0])]
        chosen = self.rungs.fewer(costs[0])
        rungs[0], costs[0] = rungs[0][chosen], costs[0][chosen]
        came: list[Index] = []
        for k in range(1, len(s)):
            if budget.over:
                return out_of_time(budget, "choosing the posture along a path")
            seconds = float(s[k] - s[k - 1]) / self.path.speed
            new = self.rungs.after(rungs[-1], float(s[k]), seconds)
            if not len(new):
                return self._unreached(float(s[k]))
            edges = self._edges(rungs[-1], new, seconds)
            through = costs[-1][:, None] + edges
            origin, cost = self._cheapest(through, (rungs[-1], new), 0.5 * float(s[k - 1] + s[k]))
            cost = cost + seconds * self._own(new)
            kept = np.isfinite(cost)
            if not kept.any():
                return self._cut_off(float(s[k]), rungs[-1], new, seconds)
            chosen = np.flatnonzero(kept)
            chosen = chosen[self.rungs.fewer(cost[chosen])]
            rungs.append(new[chosen])
            costs.append(cost[chosen])
            came.append(origin[chosen])
        way = [int(costs[-1].argmin())]
        for origin in reversed(came):
            way.append(int(origin[way[-1]]))
        Q = np.array([rung[i] for rung, i in zip(rungs, reversed(way), strict=True)])
        return Posture(s, Q)

    def _cheapest(self, through: Array, ends: tuple[Array, Array], s: float) -> tuple[Index, Array]:
        """Return from where each new configuration is reached at the least cost on one branch, and that cost.

        Half way between two configurations of one branch, another of it is near, which has the tool at length s, m.
        Through a singularity, where branches meet, there is none. Those are left out, a few of each.
        """
        before, new = ends
        columns = np.arange(len(new))
        origin = through.argmin(axis=0)
        asked = np.isfinite(through[origin, columns])
        for _ in range(_OTHERS):
            k = columns[asked]
            if not len(k):
                break
            middle = 0.5 * (before[origin[k]] + new[k])
            there, error = self.rungs.tool.corrected(middle, self.rungs.places(s, len(k)), _CORRECTIONS)
            off = np.abs(there - middle).max(axis=1, initial=0.0)
            way = np.abs(new[k] - before[origin[k]]).max(axis=1, initial=0.0)
            apart = k[(error > _MET) | (off > _AHEAD * way + _NEAR)]
            through[origin[apart], apart] = np.inf
            origin[apart] = through[:, apart].argmin(axis=0)
            asked = np.zeros(len(new), dtype=bool)
            asked[apart] = np.isfinite(through[origin[apart], apart])
        cost = through[origin, columns]
        cost[asked] = np.inf
        return origin, cost

    def _own(self, Q: Array) -> Array:
        """Return the cost (k,) of a second in each of configurations Q (k, n): near limits it is larger."""
        limits = self.problem.limits
        ends = np.isfinite(limits.lower) & np.isfinite(limits.upper)
        low, high = limits.lower[ends], limits.upper[ends]
        share = (Q[:, ends] - 0.5 * (high + low)) / (0.5 * (high - low))
        return np.asarray(_AT_LIMIT * (share**8).max(axis=1, initial=0.0))

    def _edges(self, A: Array, B: Array, seconds: float) -> Array:
        limits = self.problem.limits
        cost, fastest, farthest = (np.zeros((len(A), len(B))) for _ in range(3))
        for j in range(A.shape[1]):
            way = np.abs(A[:, j, None] - B[None, :, j])
            share = way / (limits.velocity[j] * seconds)
            cost += share * share
            np.maximum(fastest, share, out=fastest)
            np.maximum(farthest, way, out=farthest)
        cost *= seconds
        cost[(farthest > _JUMP) | (fastest > _ALLOWED)] = np.inf
        return cost

    def _cut_off(self, s: float, before: Array, after: Array, seconds: float) -> Failure:
        way = np.abs(before[:, None] - after[None])
        shares = (way / (self.problem.limits.velocity * seconds)).max(axis=2)
        i, k = np.unravel_index(int(shares.argmin()), shares.shape)
        j = int((way[i, k] / self.problem.limits.velocity).argmax())
        name = self.problem.robot.joint_names[j]
        if way[i, k].max() > _JUMP or shares[i, k] <= _ALLOWED:
            detail = f"no posture leads on at {s:.4g} m of the path: '{name}' would jump"
            return Failure("no-path", detail, {"q": before[i].tolist(), "path": s})
        fastest = self.path.speed / float(shares[i, k])
        detail = (
            f"{self.path.speed:g} m/s is faster than the arm: at {s:.4g} m of the path '{name}' would have to be "
            f"{shares[i, k]:.3g} times as fast as it can; {rounded_down(fastest):.2g} m/s is possible there"
        )
        return Failure("limits", detail, {"q": before[i].tolist(), "path": s, "joint": name, "speed": fastest})

    def _unreached(self, s: float) -> Failure:
        place = self.path.curve.points(np.array([s]))[0]
        words = f"at {s:.4g} m of the path, [{_numbers(place)}] m"
        miss = self.rungs.miss
        if miss is None:
            return Failure("reach", f"no configuration was found {words}", {"path": s})
        if miss.error == 0.0:
            found = end_collides(self.rungs.check.model, miss.q, "goal") if self._touches(miss.q) else None
            why = "gravity exceeds the torque limits" if found is None else found.detail.partition(": ")[2]
            witness = {} if found is None else dict(found.witness)
            detail = f"no configuration is free {words}: {why}"
            return Failure("collision", detail, {**witness, "q": miss.q.tolist(), "path": s})
        near = self.rungs.tool.poses(miss.q[None])[0]
        off = float(np.linalg.norm(near[:3, 3] - place))
        axis = _numbers(near[:3, 2])
        detail = (
            f"the tool does not reach its path {words}; the nearest pose found is at [{_numbers(near[:3, 3])}] m, "
            f"{off:.3g} m away, with its axis along [{axis}]"
        )
        return Failure("reach", detail, {"q": miss.q.tolist(), "path": s, "nearest": near.tolist()})

    def _touches(self, q: Array) -> bool:
        return self.rungs.check.model.collides(q)


def _numbers(values: Array) -> str:
    return ", ".join(f"{x:.4g}" for x in values)


def rounded_down(value: float) -> float:
    """Return a number > 0 with two digits that is not above it: what is suggested has to work."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(np.floor(value / unit) * unit)
