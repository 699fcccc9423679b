"""MuJoCo as the plant (extra `[sim]`): dynamics, friction and contacts of an engine that nobody here wrote."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.base import NOMINAL, PlantOptions, TorquePlant
from optiplan.simulation.plants.mjcf import SEPARATOR, mjcf

TOUCHING = 1e-6
"""m; bodies that MuJoCo sees overlap by more are in contact. Its distances of hulls are exact to about 1e-7 m."""


class MujocoPlant(TorquePlant):
    """The robot of a problem in MuJoCo, with its obstacles; torques act on the planned joints."""

    def __init__(self, robot: Robot, scene: Scene, q: Array, step: float, options: PlantOptions = NOMINAL) -> None:
        """Begin at q (n,), rad or m; obstacles of the scene may move, objects are held; the rest as of `TorquePlant`.

        Raises:
            OptiPlanError: MuJoCo is not installed.
        """
        super().__init__(robot, step, options)  # its dynamics are for holding and for pushes; the motion is MuJoCo's
        self._mujoco = mujoco_module()
        self.model: Any = self._mujoco.MjModel.from_xml_string(self._mjcf(robot, scene, options))
        self.data: Any = self._mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joint_names]
        self._at = np.array([joint.qposadr[0] for joint in joints])
        self._dof = np.array([joint.dofadr[0] for joint in joints])
        velocity = np.zeros(robot.n) if options.velocity is None else options.velocity
        for name, mimic in robot.followers.items():
            follower, source = self.model.joint(name), robot.joint_names.index(mimic.source)
            self.data.qpos[follower.qposadr[0]] = mimic.multiplier * float(np.asarray(q)[source]) + mimic.offset
            self.data.qvel[follower.dofadr[0]] = mimic.multiplier * float(velocity[source])
        self.data.qpos[self._at], self.data.qvel[self._dof] = q, velocity
        self._motions = [body.motion for body in scene.dynamic_obstacles if body.motion is not None]
        self._move_obstacles()
        self._touched: set[tuple[str, str]] = set()
        self._mujoco.mj_forward(self.model, self.data)
        self._note()
        self._take_state()

    def _mjcf(self, robot: Robot, scene: Scene, options: PlantOptions) -> str:
        return mjcf(robot, scene, self.step, options)

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Hold the torque `command` (n,), N·m (N), as far as the drives can give it."""
        applied = self._within_limits(command)
        self.data.qfrc_applied[self._dof] = self._pushed(applied, self.q, wrench)
        for _ in range(steps):
            self._move_obstacles()
            self._mujoco.mj_step(self.model, self.data)
            if self.data.ncon:
                self._note()
        self._take_state()
        return applied

    def contacts(self) -> list[tuple[str, str]]:
        """Names of the bodies that touched since the last call."""
        found = sorted(self._touched)
        self._touched.clear()
        return found

    def _take_state(self) -> None:
        self.q, self.v = np.asarray(self.data.qpos[self._at]), np.asarray(self.data.qvel[self._dof])

    def _move_obstacles(self) -> None:
        for k, motion in enumerate(self._motions):
            self.data.mocap_pos[k] = motion.at(np.array([self.data.time]))[0]

    def _note(self) -> None:
        for contact in self.data.contact[: self.data.ncon]:
            if contact.dist < -TOUCHING:
                a, b = (self.model.geom(int(geom)).name.rpartition(SEPARATOR)[0] for geom in contact.geom)
                self._touched.add((min(a, b), max(a, b)))


def mujoco_module() -> Any:
    """The module `mujoco`.

    Raises:
        OptiPlanError: it is not installed.
    """
    if find_spec("mujoco") is None:
        raise OptiPlanError("the engine 'mujoco' needs the package mujoco: pip install 'optiplan[sim]'")
    return import_module("mujoco")
