"""Rungs of the ladder: free configurations with the tool at a place of its path.

Of arms with a closed form these are all branches at many turns about the tool's axis and at tilts within its cone. Of
others they are those of the place before, carried on and moved in what is free, and some from random configurations.
"""

from dataclasses import field

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.kinematics.ik.joint_wraps import images_within
from optiplan.kinematics.ik.numeric import random_seeds
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.seams.seam_tool import SeamTool, ToolPlaces
from optiplan.problem.problem import Problem
from optiplan.records import dataclass

_REACHED = 1e-6
"""m and rad: largest error of a configuration that counts."""

_TURN = 2.0 * np.pi

_TURNS, _TILTS = 36, 6
"""Turns about the tool's axis (half as many with a cone), and directions of its tilt."""

_TILTED = 0.7
"""Share of the cone by which the tool is tilted."""

_FIRST, _FRESH = 600, 40
"""Random configurations from which the first rung, and every further one, is looked for."""

_CELL = 0.08
"""Share of a second's way of each joint within which one configuration stands for all."""

_STEPS, _CARRIED = 40, 6
"""Corrections of random configurations, and of carried ones."""


@dataclass(eq=False)
class NearMiss:
    """The nearest to a place that was found where nothing is: configuration q (n,), and its error; 0: it is there."""

    q: Array
    error: float


@dataclass(eq=False)
class Rungs:
    """Makes the rungs of one ladder, one after another.

    Attributes:
        problem: of the joints that move.
        tool: on its path.
        check: of configurations.
        most: configurations of a rung.
        miss: of the last place without a rung.
        barred: configurations (n,), by length of the path, m, near which none is taken.
    """

    problem: Problem
    tool: SeamTool
    check: MotionCheck
    most: int
    miss: NearMiss | None = None
    barred: list[tuple[float, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.problem.seed)
        self._closed = closed_form(self.problem.robot, self.tool.path.frame)
        self._own = np.array([self.problem.start, *self.problem.robot.configurations.values()])

    def first(self, s: float) -> Array:
        """Return free configurations (k, n) at a length s, m, of the path; none where none was found."""
        self.miss = None
        if self._closed is not None:
            own = self.problem.robot, self.problem.limits
            return self._kept(images_within(*own, self._solved(s), self.problem.start), s)
        random = random_seeds(self.problem.robot, self.problem.start, self._rng, _FIRST)
        return self._kept(self._reached(np.concatenate([self._own, np.array(list(random))]), s, _STEPS), s)

    def after(self, before: Array, s: float, seconds: float) -> Array:
        """Return those at a length s, of which those `before` (k, n) stand so many seconds earlier on the path."""
        self.miss = None
        if self._closed is not None:
            return self._kept(self._near(self._solved(s), before, seconds), s)
        at = self.places(s, len(before))
        rows = self.tool.rows(before, at, self.tool.path.cone)
        free = self.tool.free_motions(rows.J[:, : self.tool.equalities])
        ways = self._rng.uniform(-0.6, 0.6, (len(before), free.shape[2])) * seconds
        moved = before + np.einsum("nij,nj->ni", free, ways)
        carried = self._reached(np.concatenate([before, moved]), s, _CARRIED)
        random = random_seeds(self.problem.robot, self.problem.start, self._rng, _FRESH)
        fresh = self._reached(np.array(list(random)), s, _STEPS // 2)
        return self._kept(np.concatenate([carried, fresh]), s)

    def places(self, s: float, count: int) -> ToolPlaces:
        """Return where the tool should be at a length, m, as often as requested."""
        return self.tool.places(np.full(count, s))

    def _reached(self, seeds: Array, s: float, steps: int) -> Array:
        low, high = self.problem.limits.lower, self.problem.limits.upper
        at = self.places(s, len(seeds))
        Q, worst = self.tool.corrected(np.clip(seeds, low, high), at, steps)
        k = int(worst.argmin())
        if worst[k] > _REACHED:
            self._missed(Q[k], float(worst[k]))
        return np.asarray(Q[worst <= _REACHED])

    def _missed(self, q: Array, error: float) -> None:
        if self.miss is None or error < self.miss.error:
            self.miss = NearMiss(q, error)

    def _kept(self, Q: Array, s: float) -> Array:
        """Return those that are free, one of each cell."""
        limits = self.problem.limits
        Q = Q[~limits.outside(Q).any(axis=1)]
        for where, q in self.barred:
            if abs(where - s) < 0.05:
                Q = Q[np.abs(Q - q).max(axis=1, initial=0.0) > 0.3]
        cells = np.round(Q / (_CELL * limits.velocity)).astype(np.int64)
        _, chosen = np.unique(cells, axis=0, return_index=True)
        Q = Q[np.sort(chosen)]
        free = np.array([not self.check.blocked(q) for q in Q], dtype=bool)
        if len(Q) and not free.any():
            self._missed(Q[0], 0.0)
        return np.asarray(Q[free])

    def fewer(self, costs: Array) -> Index:
        """Return which of configurations with these costs (k,) go on: the cheapest, and some of the others."""
        if len(costs) <= self.most:
            return np.arange(len(costs))
        order = np.argsort(costs, kind="stable")
        half = self.most // 2
        return np.sort(np.concatenate([order[:half], self._rng.choice(order[half:], self.most - half, replace=False)]))

    def _solved(self, s: float) -> Array:
        """Return all branches at turns and tilts."""
        assert self._closed is not None
        at = self.places(s, 1)
        X = np.tile(np.eye(4), (1, 1, 1))
        X[0, :3, :3], X[0, :3, 3] = at.R[0], at.p[0]
        solutions = self._closed.solve(X @ self._turned())
        if not solutions.valid.any():
            k, j = np.unravel_index(int(solutions.error.max(axis=2).argmin()), solutions.valid.shape)
            self._missed(solutions.q[k, j], float(solutions.error[k, j].max()))
        return np.asarray(solutions.q[solutions.valid])

    def _turned(self) -> Array:
        """Return turns and tilts of the tool as poses (t, 4, 4) in its own frame."""
        path = self.tool.path
        tilts = [np.eye(3)]
        if path.cone > 0.0:
            angles = np.arange(_TILTS) * (_TURN / _TILTS)
            tilts += [pin.exp3(_TILTED * path.cone * np.array([np.cos(a), np.sin(a), 0.0])) for a in angles]
        turns = [np.eye(3)]
        if self.tool.spins:
            count = _TURNS // 2 if path.cone > 0.0 else _TURNS
            turns = [pin.exp3(np.array([0.0, 0.0, a])) for a in np.arange(count) * (_TURN / count)]
        found = np.tile(np.eye(4), (len(tilts) * len(turns), 1, 1))
        found[:, :3, :3] = [tilt @ turn for tilt in tilts for turn in turns]
        return found

    def _near(self, Q: Array, before: Array, seconds: float) -> Array:
        """Return those equal to Q (k, n) up to whole turns that ones before (m, n) reach in time, or the nearest."""
        limits = self.problem.limits
        way = Q[None] - before[:, None]
        way = np.where(self.problem.robot.whole_turns, way - _TURN * np.round(way / _TURN), way)
        share = (np.abs(way) / (limits.velocity * seconds)).max(axis=2, initial=0.0)
        there = before[:, None] + way
        share[limits.outside(there).any(axis=2)] = np.inf
        soon = share <= max(1.0, float(share.min(initial=np.inf)))
        i, k = np.nonzero(soon)
        found = before[i] + way[i, k]
        _, chosen = np.unique(np.round(found / 1e-6).astype(np.int64), axis=0, return_index=True)
        return np.asarray(found[np.sort(chosen)])
