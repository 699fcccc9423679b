"""A task in MuJoCo: objects are free bodies, held by welds or by the friction of fingers."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_change import carrying
from optiplan.problem.task.steps import Attach, Event
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.base import NOMINAL, PlantOptions
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.plants.mecanum_wheels import MecanumWheels
from optiplan.simulation.plants.mjcf import SEPARATOR, mjcf
from optiplan.simulation.plants.mjcf_objects import RESTED, RESTING, TaskObjects, weld_name
from optiplan.simulation.plants.mujoco_grip import FingerGrip
from optiplan.simulation.plants.mujoco_plant import MujocoPlant
from optiplan.simulation.tasks.stages import TaskStage

APART = 1.0
"""m; bodies of an inactive pair may overlap by as much without force."""


class MujocoTaskPlant(MujocoPlant):
    """MuJoCo with the objects of a task.

    An object is a free body: it rests on what is below it, and falls where it is released above that. A link holds it
    by a weld, where it really is, or by the friction of its fingers, which then press with a constant force.
    """

    def __init__(
        self,
        problem: Problem,
        found: TaskObjects,
        step: float,
        options: PlantOptions = NOMINAL,
        wheels: MecanumWheels | None = None,
    ) -> None:
        """Begin at the start of the motion of which the objects are found; the rest as of `MujocoPlant`."""
        self._objects, self._stage = found, -1
        super().__init__(found.robot, found.scene, found.start, step, options, wheels)
        self._robot, self._options = problem.robot, options
        self._carry(problem.scene)
        names = [self.model.geom(k).name for k in range(self.model.ngeom)]
        count = len(found.bodies)  # which stands for geoms of wheels, whose meetings are -1
        self._body = np.array(
            [int(n.rpartition(SEPARATOR)[2].partition(".")[0]) if SEPARATOR in n else count for n in names]
        )
        self._meeting = np.full((count + 1, count + 1), -1, np.intp)
        for k, one in enumerate(found.meetings):
            self._meeting[[one.a, one.b], [one.b, one.a]] = k
        self._of_pair = self.meetings(self.model.pair_geom1, self.model.pair_geom2)
        first = np.array([self.model.joint(name).qposadr[0] for name in found.names], np.intp)
        self._placed = first[:, None] + np.array([0, 1, 2, 4, 5, 6, 3])
        self._welded: dict[str, str] = {}
        self._grip = None if found.grip is None else FingerGrip(self._mujoco, self.model, self.data, found)
        for body in problem.scene.attached:
            if body.name in found.names:
                self._weld(body.name, body.link)

    def _mjcf(self, robot: Robot, scene: Scene, options: PlantOptions) -> str:
        return mjcf(robot, scene, self.step, options, self._objects, self.wheels)

    def meetings(self, a: Index, b: Index) -> Index:
        """Return the meeting of each two geoms of a and b (K,), its place in `TaskObjects.meetings`: (K,)."""
        return np.asarray(self._meeting[self._body[a], self._body[b]])

    def enter(self, stage: TaskStage, actions: Sequence[Event]) -> None:
        """See `TaskPlant`."""
        self._stage = self._objects.stages.index(stage)
        active = self._objects.active[self._stage][self._of_pair] | (self._of_pair < 0)
        self.model.pair_margin[:], self.model.pair_gap[:] = np.where(active, 0.0, -APART), np.where(active, 0.0, APART)
        for action in actions:
            if action.body in self._welded:
                self.data.eq_active[self._weld_id(action.body, self._welded.pop(action.body))] = 0
            if isinstance(action, Attach) and (self._grip is None or action.body not in stage.fingers):
                self._weld(action.body, action.link)
        if self._grip is not None:
            self._grip.enter(stage, self.q)
        if actions:
            self._carry(stage.problem.scene)

    def _carry(self, scene: Scene) -> None:
        """Take over the loads of a scene into the model of the robot, which is for holding it and for pushes."""
        self.dynamics = RigidBodyDynamics(carrying(self._robot, scene), self._options.mass, self._options.centre)

    def _weld_id(self, name: str, link: str) -> int:
        return int(self.model.equality(weld_name(name, link)).id)

    def _weld(self, name: str, link: str) -> None:
        """Hold an object where it is."""
        weld = self._weld_id(name, link)
        self._mujoco.mj_kinematics(self.model, self.data)  # a step leaves poses of its begin
        X_WC, X_WO = (self._frame(int(of[weld])) for of in (self.model.eq_obj1id, self.model.eq_obj2id))
        x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(X_WC.actInv(X_WO))
        self.model.eq_data[weld, :10] = [0.0, 0.0, 0.0, x, y, z, qw, qx, qy, qz]
        self.data.eq_active[weld] = 1
        self._welded[name] = link

    def _frame(self, body: int) -> pin.SE3:
        return pin.SE3(self.data.xmat[body].reshape(3, 3).copy(), self.data.xpos[body].copy())

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """See `Plant`; fingers that press have a force of their own."""
        if self._grip is None:
            return super().advance(command, steps, wrench)
        applied = super().advance(self._grip.pressed(command), steps, wrench)
        self._grip.measure(self.meetings(*self.data.contact.geom.T), self._welded)
        return applied

    def objects(self) -> Array:
        """See `TaskPlant`."""
        return np.asarray(self.data.qpos[self._placed])

    def grip_load(self) -> float:
        """See `TaskPlant`."""
        return 0.0 if self._grip is None else self._grip.load()

    def _note(self) -> None:
        if self._stage < 0:  # which pairs have contact is not set yet
            return
        meaning, found = self._objects.meaning[self._stage], self.meetings(*self._touching().T)
        for k in set(found[meaning[found] > 0].tolist()):
            a, b = self._objects.pair_names(k)
            if meaning[k] != RESTED or not (self._rests(a, b) or self._rests(b, a)):
                self._touched.add((min(a, b), max(a, b)))

    def _rests(self, name: str, other: str) -> bool:
        """Whether an object is where it is put down on another body."""
        places = [place for body, place in self._objects.rests.get(name, ()) if body == other]
        return any(float(np.linalg.norm(self.data.body(name).xpos - place)) < RESTING for place in places)
