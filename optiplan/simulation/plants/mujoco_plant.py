"""MuJoCo as the plant (extra `[sim]`): dynamics, friction and contacts of an engine that nobody here wrote."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.errors import OptiPlanError
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.base import NOMINAL, PlantOptions, TorquePlant
from optiplan.simulation.plants.mecanum_wheels import MecanumWheels
from optiplan.simulation.plants.mjcf import SEPARATOR, mjcf

TOUCHING = 1e-6
"""m; bodies that MuJoCo sees overlap by more are in contact. Its distances of hulls are exact to about 1e-7 m."""


class MujocoPlant(TorquePlant):
    """The robot of a problem in MuJoCo, with its obstacles; torques act on the planned joints."""

    def __init__(
        self,
        robot: Robot,
        scene: Scene,
        q: Array,
        step: float,
        options: PlantOptions = NOMINAL,
        wheels: MecanumWheels | None = None,
    ) -> None:
        """Begin at q (n,), rad or m; obstacles of the scene may move, objects are held; the rest as of `TorquePlant`.

        With `wheels` the base drives on them, and its joints have no drives.

        Raises:
            OptiPlanError: MuJoCo is not installed.
        """
        self.wheels = wheels
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
        if wheels is not None:
            wheels.start(self.model, np.asarray(q), velocity, self.data)
        self._motions = [body.motion for body in scene.dynamic_obstacles if body.motion is not None]
        self._move_obstacles()
        names = [self.model.geom(k).name for k in range(self.model.ngeom)]
        self._reported = np.array([SEPARATOR in name for name in names])  # not those of wheels
        self._touched: set[tuple[str, str]] = set()
        self._mujoco.mj_forward(self.model, self.data)
        self._note()
        self._take_state()

    def _mjcf(self, robot: Robot, scene: Scene, options: PlantOptions) -> str:
        return mjcf(robot, scene, self.step, options, wheels=self.wheels)

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Hold the torque `command` (n,), N·m (N), as far as the drives can give it."""
        applied = self._within_limits(command)
        driven = applied if self.wheels is None else self.wheels.drive(self.q, applied, self.data)
        self.data.qfrc_applied[self._dof] = self._pushed(driven, self.q, wrench)
        for _ in range(steps):
            self._move_obstacles()
            self._mujoco.mj_step(self.model, self.data)
            if self.data.ncon:
                self._note()
        self._take_state()
        if self.wheels is not None:
            self.wheels.note(self.q, steps * self.step, self.data)
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
            x, y, z, *quaternion = pin.SE3ToXYZQUAT(motion.carrier(float(self.data.time)))
            self.data.mocap_pos[k], self.data.mocap_quat[k] = (x, y, z), (quaternion[3], *quaternion[:3])

    def _note(self) -> None:
        for geoms in self._touching().tolist():
            a, b = (self.model.geom(geom).name.rpartition(SEPARATOR)[0] for geom in geoms)
            self._touched.add((min(a, b), max(a, b)))

    def _touching(self) -> Index:
        """Return the geoms of all contacts that count, (K, 2)."""
        contact = self.data.contact
        geoms = contact.geom[contact.dist < -TOUCHING].reshape(-1, 2)
        return np.asarray(geoms[self._reported[geoms].all(axis=1)])


def mujoco_module() -> Any:
    """The module `mujoco`.

    Raises:
        OptiPlanError: it is not installed.
    """
    if find_spec("mujoco") is None:
        raise OptiPlanError("the engine 'mujoco' needs the package mujoco: pip install 'optiplan[sim]'")
    return import_module("mujoco")
