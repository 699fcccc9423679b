"""Stages: a robot of the joints that move in a step, in the scene of that moment."""

from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel, planning_model
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Failure
from optiplan.planners.common.safety_ends import ending_at
from optiplan.planners.common.tracking_tube import constraints_in_tube
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.problem import Goal, Problem, Via, derived
from optiplan.problem.task.scene_change import carrying, columns, scene_during, standing
from optiplan.problem.task.steps import TaskStep
from optiplan.records import dataclass

_SAME_POSITION = 1e-12
"""rad or m: resting joints that differ by less are in one place."""


@dataclass(frozen=True, eq=False)
class WorldState:
    """Configuration q (n,) of the whole robot, and the scene."""

    q: Array
    scene: Scene


@dataclass(frozen=True, eq=False)
class Stage:
    """A step's own problem: the robot with the other joints standing still, loaded with what it holds.

    Attributes:
        problem: without goal; its start is that of the state.
        model: of that robot in that scene.
        columns: places of its joints in a configuration of the whole robot.
    """

    problem: Problem
    model: CollisionModel
    columns: list[int]

    def arrived(self, q: Array, state: WorldState) -> WorldState:
        """Return a state of the whole robot with the joints of this stage at q (k,)."""
        whole = np.array(state.q)
        whole[self.columns] = q
        return WorldState(whole, state.scene)

    def ending(self, *ends: Array) -> "Stage":
        """Return the stage of a motion from its start to these ends (k,), about which pairs may be nearer: `Safety`."""
        told, model = ending_at(self.problem, self.problem.start, *ends), self.model
        if told is self.problem or not isinstance(model, NativeCollisionModel) or model.floors is None:
            return self
        return replace(self, problem=told, model=model.about_ends(self.problem.start, *ends))

    @property
    def touching(self) -> "Stage":
        """The stage in which bodies may come as near as they do not touch; itself where no distance is asked."""
        scene = self.problem.scene
        if scene.safety is None:
            return self
        bare = replace(scene, safety=None)
        model = planning_model(self.problem.robot, bare, self.model, error=self.problem.tracking_error)
        return replace(self, problem=derived(self.problem, scene=bare), model=model)

    def of_all_joints(self, failure: Failure, state: WorldState) -> Failure:
        """Return a failure of this stage whose witness has the configuration of the whole robot."""
        q = failure.witness.get("q")
        if q is None or len(q) != len(self.columns):
            return failure
        return replace(failure, witness={**failure.witness, "q": self.arrived(q, state).q.tolist()})

    def to(self, goal: Goal, vias: tuple[Via, ...] = ()) -> Problem:
        """Return the problem of going somewhere."""
        return derived(self.problem, goal=goal, vias=vias)


class Stages:
    """Stages of a task; a model is made once for equal scenes and equal places of the resting joints."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._known: list[tuple[tuple[object, ...], Array, Scene, Stage]] = []

    def moving(self, stage: Stage) -> Stage:
        """Return the stage of the first step, with the motion at the start that the task's problem states."""
        v, a = self.problem.start_velocity[stage.columns], self.problem.start_acceleration[stage.columns]
        return replace(stage, problem=derived(stage.problem, start_velocity=v, start_acceleration=a))

    def at(self, state: WorldState, step: TaskStep, joints: tuple[str, ...]) -> Stage:
        """Return the stage of a step from a state."""
        own = columns(self.problem.robot, joints)
        others = np.delete(state.q, own)
        key = joints, step.allowed, step.constraints
        for known, place, scene, stage in self._known:
            if known == key and scene is state.scene and np.abs(place - others).max(initial=0.0) <= _SAME_POSITION:
                return replace(stage, problem=derived(stage.problem, start=state.q[own])).ending()
        scene = scene_during(state.scene, step)
        robot = carrying(standing(self.problem.robot, joints, state.q), scene)
        problem = derived(
            self.problem,
            robot=robot,
            scene=scene,
            start=state.q[own],
            start_velocity=np.zeros(len(own)),
            start_acceleration=np.zeros(len(own)),
            goal=(),
            limits=self.problem.limits.of_joints(own),
            tracking_error=self.problem.tracking_error[own],
            vias=(),
            task=(),
            path_constraints=(*self.problem.path_constraints, *self._constraints(step, scene)),
        )
        stage = Stage(problem, planning_model(robot, scene, error=problem.tracking_error), own)
        self._known = [*self._known[-30:], (key, others, state.scene, stage)]
        return stage.ending()

    def _constraints(self, step: TaskStep, scene: Scene) -> tuple[PathConstraint, ...]:
        """Return a step's own, as planners are given them; what is held may be a frame of theirs."""
        if not step.constraints or not self.problem.tracking_error.any():
            return step.constraints
        loaded = carrying(self.problem.robot, scene)
        return constraints_in_tube(derived(self.problem, robot=loaded, scene=scene, path_constraints=step.constraints))
