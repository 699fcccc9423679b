"""Choose the ends of moves so that the steps between them can be done, cheapest first, and plan the moves between.

A leg is a move and the steps without choice that follow it. Its candidates are the configurations that reach the
move's goal and from which those steps can be done. Over all legs they make a graph in layers. An edge costs the lower
bound of a move's duration; after the move is planned it costs the duration, or infinity if there is no motion. The
cheapest path is planned, edge by edge, until one holds (Dellin and Srinivasa 2016, lazy shortest paths).
"""

from collections.abc import Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget, Failure, Planner, Progress
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.goal_ranking import goal_sampler
from optiplan.planners.common.many_ends import end_batches
from optiplan.planners.common.safety_ends import with_ends
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.task.chains import Chain, do_chain, is_chained, of_step
from optiplan.planners.task.planned_steps import PlannedMotion, PlannedStep
from optiplan.planners.task.stages import Stage, Stages, WorldState
from optiplan.planners.task.stops import ends_in_motion
from optiplan.problem.goals_and_vias import ExactGoal
from optiplan.problem.problem import Goal, Problem
from optiplan.problem.task.steps import Move, TaskStep
from optiplan.records import dataclass
from optiplan.trajectory.timing.lower_bound import lower_bounds

_CANDIDATES, _MORE = 8, 24
"""Configurations of a goal tried first; and at most, where none of the first allows the next steps."""

_KEPT = 6
"""Candidates of a layer that go on to the next."""

_SEARCHING = 0.7
"""Share of the remaining time that candidates and moves share."""

_PLANNING = 2, 0.5
"""Planning the moves counts as so many layers when time is shared: at least, and for each leg."""

_SCENES = 3
"""Different places of held objects and resting joints for which a layer's candidates are searched."""

_SAME_POSITION = 1e-6
"""rad or m: resting joints that differ by less are in one place."""

_SAME_PLACE = 5e-3
"""m and 1: objects that are nearer are in one place; in the end the steps are done again exactly."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A move, as a step and as its action, and the steps without choice that follow it."""

    step: TaskStep
    move: Move
    chain: tuple[TaskStep, ...]


class TaskLegs(NamedTuple):
    """The steps without choice before the first move, and the legs."""

    opening: tuple[TaskStep, ...]
    legs: list[Leg]


def legs_of(task: Sequence[TaskStep]) -> TaskLegs:
    """Divide a task into legs."""
    moves = [(k, step.action) for k, step in enumerate(task) if isinstance(step.action, Move) and not is_chained(step)]
    ends = [*(k for k, _ in moves[1:]), len(task)]
    legs = [Leg(task[k], move, tuple(task[k + 1 : end])) for (k, move), end in zip(moves, ends, strict=False)]
    return TaskLegs(tuple(task[: moves[0][0] if moves else len(task)]), legs)


@dataclass(eq=False)
class _Node:
    """A candidate of a layer.

    Attributes:
        q: (n,) the candidate.
        after: state after the leg.
        seconds: lower bound on the duration of the chain, s.
        edges: cost from each node of the layer before, s; infinite where there is no motion.
        cost: of the cheapest path from the start, s.
    """

    q: Array
    after: WorldState
    seconds: float
    edges: list[float] = field(default_factory=list)
    cost: float = 0.0


@dataclass(frozen=True, eq=False)
class _PlannedLeg:
    """A leg done exactly: the move and the chain."""

    steps: tuple[PlannedStep, ...]
    info: dict[str, Any]

    @property
    def after(self) -> WorldState:
        return self.steps[-1].after


class TaskSearch:
    """One search; `run` returns all steps done one after another, or the failure of the step that cannot be.

    Layers and moves share seven tenths of the budget. When the time of a layer ends, the search goes on with the
    candidates found by then, if there is one. The rest of the budget is spent only if there is no motion yet.

    Attributes:
        infos: of the moves of the motion found.
        attempts: moves planned.
        cut_short: whether more time would have allowed more candidates.
        hurried: whether the time for a move ended some of its planning.
    """

    def __init__(self, problem: Problem, planner: Planner[Any], budget: Budget, progress: Progress) -> None:
        self.problem, self.planner, self.budget, self.progress = problem, planner, budget, progress
        self.stages = Stages(problem)
        self.opening, self.legs = legs_of(problem.task)
        self.infos: list[dict[str, Any]] = []
        self.attempts = 0
        self._paced, self.cut_short, self.hurried = True, False, False

    def run(self) -> list[PlannedStep] | Failure:
        """Search within the budget; where the candidates found in time lead nowhere, once more among all."""
        found = self._search()
        if isinstance(found, Failure) and self.cut_short and not self.budget.over:
            self._paced = False
            found = self._search()
        return found

    def _search(self) -> list[PlannedStep] | Failure:
        start = WorldState(self.problem.start, self.problem.scene)
        first = do_chain(self.stages, start, self.opening, self.budget)
        if first.failure is not None:
            return self._late(first.failure)
        after, count = first.after(start), len(self.legs) + 1
        planning = max(_PLANNING[0], _PLANNING[1] * count)
        layers = [[_Node(start.q, after, 0.0, [0.0])]]
        for k, leg in enumerate(self.legs, 1):
            self.progress("looking ahead", k / count)
            found = self._layer(leg, layers[-1], self._pace(count - k + planning))
            if isinstance(found, Failure):
                return self._late(found)
            layers.append(found)
        found_steps = self._plan(layers, after)
        if isinstance(found_steps, Failure):
            return self._late(found_steps)
        return [*first.steps, *found_steps]

    def _late(self, failure: Failure) -> Failure:
        """Return a failure that mentions the budget if it ended: with more, the step may still be done."""
        if not self.budget.over:
            return failure
        late = out_of_time(self.budget, "planning the task")
        if "step" not in failure.witness or failure.kind in ("budget", "cancelled"):
            return late
        return replace(failure, detail=f"{failure.detail}; {late.detail}")

    def _pace(self, parts: float) -> Budget:
        """Return the time for the first of as many parts of the search."""
        return self.budget.share(_SEARCHING / parts if self._paced else 1.0)

    def _layer(self, leg: Leg, before: list[_Node], pace: Budget) -> list[_Node] | Failure:
        """Return the candidates of a leg, the cheapest to reach first: at least one, and more while `pace` lasts."""
        costs = np.array([node.cost for node in before])
        kinds: list[list[int]] = []
        for i in np.argsort(costs, kind="stable").tolist():
            others = [kind for kind in kinds if self._alike(before[kind[0]].after, before[i].after, leg.move)]
            same = others[0] if others else None
            if same is not None:
                same.append(i)
            elif len(kinds) < _SCENES:
                kinds.append([i])
        nodes: list[_Node] = []
        failures: list[tuple[tuple[int, float], Failure]] = []
        for kind in kinds:
            if nodes and pace.over:
                self.cut_short = True
                break
            for node in self._candidates(leg, before[kind[0]].after, failures, pace):
                bounds = [self._bound(before[i].after.q, node.q) if i in kind else np.inf for i in range(len(before))]
                node.edges, node.cost = bounds, float(np.min(costs + bounds)) + node.seconds
                nodes.append(node)
        if not nodes:
            late = out_of_time(self.budget, "planning the task")
            return max(failures, key=lambda item: item[0])[1] if failures else late
        return sorted(nodes, key=lambda node: node.cost)[:_KEPT]

    def _candidates(
        self, leg: Leg, state: WorldState, failures: list[tuple[tuple[int, float], Failure]], pace: Budget
    ) -> list[_Node]:
        """Return the configurations from which what follows a move can be done; see `_layer`."""
        stage = self.stages.at(state, leg.step, leg.move.joints)
        for goal in end_batches(stage.problem, leg.move.goal, stage.model, self.budget):
            good = self._candidates_of(leg, (stage, state), goal, failures, pace)
            if good or self.budget.over:
                return good
        return []

    def _candidates_of(
        self,
        leg: Leg,
        at: tuple[Stage, WorldState],
        goal: Goal,
        failures: list[tuple[tuple[int, float], Failure]],
        pace: Budget,
    ) -> list[_Node]:
        stage, state = at
        told = with_ends(stage.to(goal), self.budget)
        stage = stage.ending(*told.scene.safety.ends[1:]) if told.scene.safety is not None else stage
        sampler = goal_sampler(told, stage.model, self.budget, _CANDIDATES, nearer=not leg.chain)
        if isinstance(sampler, Failure):
            failures.append(((-1, 0.0), of_step(sampler, leg.step, state, self.stages.problem.robot, stage)))
            return []
        good: list[_Node] = []
        tried = 0
        configurations = sampler.configurations[: 2 * _CANDIDATES]
        while configurations and not self.budget.over:
            for q in configurations:
                tried += 1
                arrived = stage.arrived(q, state)
                chain = do_chain(self.stages, arrived, leg.chain, self.budget)
                if chain.failure is None:
                    good.append(_Node(arrived.q, chain.after(arrived), self._seconds(chain)))
                else:
                    failures.append((chain.far(), chain.failure))
                late = pace.over and len(good) > 0
                self.cut_short |= late
                if len(good) >= _CANDIDATES or late or self.budget.over:
                    return good
            if good or tried >= _MORE:
                break
            configurations = sampler.more(_CANDIDATES, lambda: self.budget.over)
        return good

    def _alike(self, a: WorldState, b: WorldState, move: Move) -> bool:
        """Whether resting joints, held objects and all others are in about the same place."""
        others = [k for k, name in enumerate(self.problem.robot.joint_names) if name not in move.joints]
        if np.abs(a.q[others] - b.q[others]).max(initial=0.0) > _SAME_POSITION:
            return False
        places = [
            {one.name: one.X_LO.homogeneous for one in state.scene.attached}
            | {one.name: one.X_WO.homogeneous for one in state.scene.obstacles}
            for state in (a, b)
        ]
        return all(np.abs(X - places[1][name]).max() < _SAME_PLACE for name, X in places[0].items())

    def _seconds(self, chain: Chain) -> float:
        """Return a lower bound of the duration of a chain, s."""
        return sum(self._bound(done.before.q, done.after.q) for done in chain.steps)

    def _bound(self, q: Array, other: Array) -> float:
        return float(lower_bounds(q, other[None], self.problem.limits)[0])

    def _plan(self, layers: list[list[_Node]], start: WorldState) -> list[PlannedStep] | Failure:
        """Plan the cheapest path through the layers, edge by edge, until one holds."""
        known: dict[tuple[int, ...], _PlannedLeg] = {}
        failure: Failure | None = None
        while not self.budget.over:
            path = _cheapest(layers)
            if path is None:
                break
            found = self._along(layers, path, start, known)
            if not isinstance(found, Failure):
                self.infos = [leg.info for leg in found]
                return [step for leg in found for step in leg.steps]
            failure = found if failure is None else max(failure, found, key=lambda one: int(one.witness.get("step", 0)))
        if failure is None and not self.budget.over:
            failure = Failure("no-path", "no ends of the moves were found from which every step leads to the next")
        return failure or out_of_time(self.budget, "planning the task")

    def _along(
        self,
        layers: list[list[_Node]],
        path: tuple[int, ...],
        start: WorldState,
        known: dict[tuple[int, ...], _PlannedLeg],
    ) -> list[_PlannedLeg] | Failure:
        """Plan the moves of one path; the first that cannot be planned is barred."""
        found: list[_PlannedLeg] = []
        state = start
        for k in range(1, len(path)):
            prefix = path[: k + 1]
            if prefix not in known:
                node = layers[k][path[k]]
                self.attempts += 1
                planned = self._planned(k, state, node)
                if isinstance(planned, Failure):
                    node.edges[path[k - 1]] = np.inf
                    return planned
                known[prefix] = planned
            found.append(known[prefix])
            state = known[prefix].after
        return found

    def _planned(self, k: int, state: WorldState, node: _Node) -> _PlannedLeg | Failure:
        """Plan the move of a leg exactly, then do what follows it."""
        leg, count = self.legs[k - 1], len(self.legs) + 1
        stage = self.stages.at(state, leg.step, leg.move.joints)
        q = node.q[stage.columns]
        goal: Goal = (ExactGoal(q),)
        if ends_in_motion(leg.move):
            ends = stage.to(leg.move.goal).end_states(q)
            goal = tuple(ExactGoal(q, velocity=end.v, acceleration=end.a) for end in ends)
        if k == 1 and self.problem.moving_start:
            stage = self.stages.moving(stage)
        stage = stage.ending(q)
        problem = stage.to(goal, leg.move.vias)

        def progress(what: str, part: float) -> None:
            self.progress(f"{leg.step.words}: {what}", (k - 1 + part) / count)

        for parts in (count - k + 1, 1):  # where its own part is not enough, most of the rest
            share = self._pace(parts)
            result = plan_through(self.planner, problem, share, progress)
            self.hurried |= bool(result.info.get("cut_short", False))
            if result.trajectory is not None or not share.over or self.budget.over:
                break
        if result.trajectory is None:
            self.cut_short |= share.over
            failure = result.failure or Failure("no-path", "no motion was found")
            return of_step(failure, leg.step, state, self.stages.problem.robot, stage)
        arrived = stage.arrived(result.trajectory.end, state)
        chain = do_chain(self.stages, arrived, leg.chain, self.budget)
        if chain.failure is not None:
            return chain.failure
        move = PlannedMotion(leg.step, state, arrived, stage, result.trajectory)
        return _PlannedLeg((move, *chain.steps), dict(result.info))


def _cheapest(layers: list[list[_Node]]) -> tuple[int, ...] | None:
    """Return the node of each layer on the cheapest path, by dynamic programming; None where all are barred."""
    costs, came = [np.zeros(1)], [np.zeros(1, dtype=int)]
    for before, layer in pairwise(layers):
        through = costs[-1] + np.array([node.edges for node in layer]).reshape(len(layer), len(before))
        came.append(through.argmin(axis=1))
        costs.append(through.min(axis=1) + np.array([node.seconds for node in layer]))
    last = int(np.argmin(costs[-1]))
    if not np.isfinite(costs[-1][last]):
        return None
    path = [last]
    for k in range(len(layers) - 1, 0, -1):
        path.append(int(came[k][path[-1]]))
    return tuple(reversed(path))
