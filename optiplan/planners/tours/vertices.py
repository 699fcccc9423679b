"""Vertices of a tour: configurations that put the tool at its targets, free and within limits."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import cycle

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.collision.native_model import planning_model
from optiplan.config.messages import some
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.kinematics.ik.joint_wraps import images_within
from optiplan.kinematics.ik.numeric import random_seeds
from optiplan.planners.base import Budget, Failure, FailureKind
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.tours.carrier import Carrier
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.problem.goals import GoalOptions, GoalSet, goal_configurations
from optiplan.problem.problem import Problem, derived
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.sampling import RegionSampler
from optiplan.problem.task.steps import TargetTour
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose

_NUMERIC, _STARTS = 12, 60
"""Configurations of a target that the numeric inverse kinematics looks for at first, and its starts at most."""

_NEW = 1e-4
"""rad or m: configurations that differ by less are one."""

_MOST = 200
"""Configurations of a target at first: the soonest from the start, where there are more."""

_NEAR = 0.5
"""s: configurations that are farther from a chosen one are on another branch."""

_NAMED = 8
"""Targets out of reach that a failure describes; it names all."""

_WIDE = np.repeat([0.01, 0.1], 3)
"""m and rad from the middle of a target, beyond which the middle does not stand for it."""

_TURN = 2.0 * np.pi


@dataclass(eq=False)
class Layer:
    """Configurations Q (k, n) at a target, rad or m, with a number (k,) of each that no other has."""

    Q: Array
    numbers: Index

    @cached_property
    def places(self) -> dict[int, int]:
        """The place of each number in the layer."""
        return {number: k for k, number in enumerate(self.numbers.tolist())}


class Vertices:
    """Configurations at the targets of one tour: in closed form at many turns at once, else by descents.

    Attributes:
        check: of configurations and straight motions.
        times: of straight motions.
    """

    def __init__(self, problem: Problem, tour: TargetTour, check: MotionCheck, times: TravelTimes) -> None:
        self.problem, self.tour, self.check, self.times = problem, tour, check, times
        self.goals = [target.goal for target in tour.targets]
        self._carrier = Carrier(problem, tour.carried_by)
        self._arm = self._carrier.problem
        self._closed = closed_form(self._arm.robot, self.goals[0].frame)
        self._positions = self._carrier.positions()
        self._samplers: dict[tuple[int, bytes], RegionSampler] = {}
        self._rng = np.random.default_rng(problem.seed)
        self._count = 0

    def first(self, budget: Budget, turns: int) -> list[Layer] | Failure:
        """Return the first configurations of every target, or a failure that names all targets without any."""
        found = self.candidates(turns, budget)
        if budget.over:
            without = some([self.tour.targets[k].name for k in range(len(found)) if not len(found[k])])
            words = f"; none yet at {without}" if without else ""
            return out_of_time(budget, f"looking for configurations at the targets{words}")
        refused: dict[int, GoalSet] = {}
        for k in range(len(found)):
            if not len(found[k]):
                goals = self._thoroughly(k, budget)
                found[k] = np.array(goals.configurations).reshape(-1, self.problem.robot.n)
                if not len(found[k]):
                    refused[k] = goals
        return self._failure(refused) if refused else [self.layer(Q) for Q in found]

    def candidates(self, turns: int, budget: Budget, starts: int = _STARTS, *, all_over: bool = False) -> list[Array]:
        """Return free configurations (k, n) of every target; none where none was found by so many descents.

        The closed form is of the middle of a target; with `all_over` there are descents besides, all over a wide one.
        """
        if self._closed is None:
            return self._descended(range(len(self.goals)), budget, starts)
        found = self._at_turns(turns)
        if not all_over:
            return found
        wide = [k for k, goal in enumerate(self.goals) if _is_wide(goal)]
        for k, Q in zip(wide, self._descended(wide, budget, starts), strict=True):
            inside = (self.goals[k].low <= 0.0).all() and (self.goals[k].high >= 0.0).all()
            found[k] = np.concatenate([found[k], Q]) if inside else Q
        return found

    def near(self, chosen: Array, before: Array, after: Array, step: float) -> list[Layer]:
        """Return further free configurations near the chosen ones, for each of the m targets.

        Args:
            chosen: (m, n) the configurations of the tour, by target.
            before: (m, n) those of the target before each.
            after: (m, n) those of the target after each.
            step: rad, of the turn about a free axis: up to four to either side are tried.
        """
        positions = self._carrier.near(chosen[:, self._carrier.own], step)
        if self._closed is not None:
            turns = np.zeros((len(chosen), 1))
            if any(goal.free for goal in self.goals):
                turns = self._turns_of(chosen)[:, None] + step * np.arange(-4, 5)
            solved = self._solved(turns, positions)
            soon = [self.times.between(q[None], Q)[0] < _NEAR for q, Q in zip(chosen, solved, strict=True)]
            return self._layers([Q[kept] for Q, kept in zip(solved, soon, strict=True)])
        found = []
        middle = 0.5 * (before + after)
        for k in range(len(self.goals)):
            seeds = [middle[k], 0.5 * (chosen[k] + middle[k]), 0.5 * (chosen[k] + before[k])]
            apart = step * self._rng.uniform(-1.0, 1.0, chosen.shape[1])
            seeds += [0.5 * (chosen[k] + after[k]), chosen[k] + apart]
            seeds += [self._carrier.whole(chosen[k, self._carrier.others], u) for u in positions[k, 1:]]
            there = [q for q, inside in (self._onto(k, seed) for seed in seeds) if inside]
            found.append(np.array(there).reshape(-1, self.problem.robot.n))
        return self._layers(found)

    def _onto(self, k: int, seed: Array) -> tuple[Array, bool]:
        """Return a configuration (n,) at target k near a seed (n,), the carrier where the seed has it."""
        u = seed[self._carrier.own]
        sampler = self._samplers.get((k, u.tobytes()))
        if sampler is None:
            sampler = RegionSampler(self._arm.robot, self._carrier.placed(self.goals[k], u))
            self._samplers[k, u.tobytes()] = sampler
        q, inside = sampler.onto(seed[self._carrier.others])
        return self._carrier.whole(q, u), inside

    def _layers(self, found: list[Array]) -> list[Layer]:
        return [self.layer(Q) for Q in self._free(found)]

    def layer(self, Q: Array) -> Layer:
        """Return configurations (k, n) as a layer, with numbers of their own."""
        self._count += len(Q)
        return Layer(Q, np.arange(self._count - len(Q), self._count))

    def joined(self, layers: Sequence[Layer], more: Sequence[Layer]) -> list[Layer]:
        """Return layers with further configurations, those left out that are there already."""
        found = []
        for layer, other in zip(layers, more, strict=True):
            apart = np.abs(other.Q[:, None] - layer.Q[None]).max(axis=2, initial=0.0).min(axis=1, initial=np.inf)
            new = apart > _NEW
            numbers = np.concatenate([layer.numbers, other.numbers[new]])
            found.append(Layer(np.concatenate([layer.Q, other.Q[new]]), numbers))
        return found

    def _at_turns(self, turns: int) -> list[Array]:
        free = any(goal.free for goal in self.goals)
        angles = np.arange(turns) * (_TURN / turns) if free else np.zeros(1)
        m = len(self.goals)
        positions = np.broadcast_to(self._positions, (m, *self._positions.shape))
        found = self._solved(np.broadcast_to(angles, (m, len(angles))), positions)
        return self._free([self._soonest(Q) for Q in found])

    def _soonest(self, Q: Array) -> Array:
        if len(Q) <= 2 * _MOST:
            return Q
        seconds = self.times.between(self.problem.start[None], Q)[0]
        return np.asarray(Q[np.sort(np.argsort(seconds, kind="stable")[: 2 * _MOST])])

    def _solved(self, turns: Array, positions: Array) -> list[Array]:
        """Return all configurations within limits of every target: at each turn (m, t), rad, and position (m, k, c)."""
        assert self._closed is not None
        X = np.array([goal.X_WR.homogeneous for goal in self.goals])[:, None] @ self._turned(turns)
        X = X @ np.array([goal.X_RF.homogeneous for goal in self.goals])[:, None]
        placed = self._carrier.poses(positions)[:, :, None] @ X[:, None]
        solutions = self._closed.solve(placed.reshape(-1, 4, 4))
        U = np.broadcast_to(positions[:, :, None, None], (*placed.shape[:3], 8, positions.shape[-1]))
        whole = self._carrier.whole(solutions.q.reshape(*U.shape[:-1], -1), U)
        q = whole.reshape(len(self.goals), -1, self.problem.robot.n)
        valid = solutions.valid.reshape(len(self.goals), -1)
        own = self.problem.robot, self.problem.limits
        return [images_within(*own, q[k][valid[k]], self.problem.start) for k in range(len(self.goals))]

    def _turned(self, turns: Array) -> Array:
        """Return the turns (m, t), rad, about the free axes as poses (m, t, 4, 4); the identity without one."""
        found = np.zeros((*turns.shape, 4, 4))
        found[...] = np.eye(4)
        for k, goal in enumerate(self.goals):
            for axis in goal.free[:1]:
                i, j = (axis + 1) % 3, (axis + 2) % 3
                found[k, :, i, i] = found[k, :, j, j] = np.cos(turns[k])
                found[k, :, j, i] = np.sin(turns[k])
                found[k, :, i, j] = -np.sin(turns[k])
        return found

    def _turns_of(self, Q: Array) -> Array:
        """Return the turns (m,), rad, about the free axes of the configurations Q (m, n) of all targets."""
        assert self._closed is not None
        found = np.zeros(len(Q))
        at = zip(self.goals, self._closed.forward(Q[:, self._carrier.others]), Q[:, self._carrier.own], strict=True)
        for k, (goal, X, u) in enumerate(at):
            for axis in goal.free[:1]:
                found[k] = self._carrier.placed(goal, u).coordinates(pin.SE3(X))[3 + axis]
        return found

    def _free(self, found: list[Array]) -> list[Array]:
        return [Q[[not self.check.blocked(q) for q in Q]] if len(Q) else Q for Q in found]

    def _descended(self, targets: Iterable[int], budget: Budget, starts: int) -> list[Array]:
        """Return configurations of targets by descents: from the start, those of the one before, and random."""
        robot = self.problem.robot
        found: list[Array] = []
        own = [self.problem.start, *robot.configurations.values()]
        for k in targets:
            random = list(random_seeds(robot, self.problem.start, self._rng, starts))
            for seed, u in zip(random, cycle(self._positions), strict=False):
                seed[self._carrier.own] = u
            there: list[Array] = []
            for seed in (*(q for Q in found[-1:] for q in Q[:4]), *own, *random):
                q, inside = self._onto(k, seed)
                if inside and all(np.abs(q - other).max() > 0.1 for other in there) and not self.check.blocked(q):
                    there.append(q)
                if len(there) >= _NUMERIC or budget.over:
                    break
            found.append(np.array(there).reshape(-1, robot.n))
        return found

    def _thoroughly(self, k: int, budget: Budget) -> GoalSet:
        """Look for configurations of target k as of any goal; the set says why there are none."""
        u = self.problem.start[self._carrier.own]
        goal = derived(self._arm, goal=(self._carrier.placed(self.goals[k], u),))
        model = planning_model(goal.robot, goal.scene, error=goal.tracking_error) if len(u) else self.check.model
        options = GoalOptions(stop=lambda: budget.over)
        arms = goal_configurations(goal, model, np.random.default_rng(self.problem.seed), options)
        witness = dict(arms.witness)
        if "q" in witness:
            witness["q"] = self._carrier.whole(np.array(witness["q"]), u).tolist()
        whole = [self._carrier.whole(q, u) for q in arms.configurations]
        found = replace(arms, configurations=whole, witness=witness)
        gravity = Gravity(self.problem.robot, self.problem.limits.torque)
        held = [q for q in found.configurations if not gravity.too_much(q)]
        if found.configurations and not held:
            witness = {"q": found.configurations[0].tolist()}
            return GoalSet([], "goal-unreachable", "gravity alone exceeds the torque limits there", witness)
        return GoalSet(held, found.kind, found.reason, found.witness)

    def _failure(self, refused: dict[int, GoalSet]) -> Failure:
        """Return a failure that names every target without a configuration, with the nearest pose of some."""
        names = [self.tour.targets[k].name for k in refused]
        reasons, told = [], []
        for k, goals in refused.items():
            q = np.array(goals.witness.get("q", self.problem.start))
            X = frame_pose(self.problem.robot, q, self.goals[k].frame)
            place = ", ".join(f"{x:.4g}" for x in X.translation)
            near = f"; nearest at [{place}] m" if goals.kind == "goal-unreachable" else ""
            reasons.append(f"'{self.tour.targets[k].name}': {goals.reason}{near}")
            told.append({"target": self.tour.targets[k].name, "reason": goals.reason, **goals.witness})
        every = all(goals.kind == "goal-in-collision" for goals in refused.values())
        listed = f" ({', '.join(names)})" if len(names) > _NAMED else ""
        detail = f"{len(names)} of {len(self.goals)} targets cannot be reached{listed}: {'; '.join(reasons[:_NAMED])}"
        first = next(iter(refused.values())).witness
        kind: FailureKind = "goal-in-collision" if every else "goal-unreachable"
        return Failure(kind, detail, {**({"q": first["q"]} if "q" in first else {}), "targets": told})


def _is_wide(goal: RegionGoal) -> bool:
    """Whether a target is more than its middle and turns about one axis."""
    beyond = np.maximum(-goal.low, goal.high) > _WIDE
    beyond[[3 + axis for axis in goal.free[:1]]] = False
    return bool(beyond.any())
