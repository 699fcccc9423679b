"""Grips by friction in MuJoCo: fingers press, and how much of what friction can hold is needed."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.errors import wrong_argument
from optiplan.simulation.plants.mjcf_objects import TaskObjects, coupling_name
from optiplan.simulation.tasks.stages import TaskStage

CLOSED = 0.5
"""Share of the force of all fingers from which on a grip counts as closed."""


PAD_RADIUS = 0.015
"""m; of pads that stand for fingers."""


class FingerGrip:
    """The fingers of a robot that hold the objects of a task by friction.

    Where a task closes fingers on an object, each presses with a constant force, coupled as by one drive, and contacts
    of MuJoCo hold it. Where it closes none, a weld holds, and two pads stand for fingers in the figures: they press
    along y at the tool frame, or at the link that holds.

    The load is the share of what can be held that is needed. Of an object's fingers it is |f_t| / (mu f_n), f_t the sum
    of their forces along their surfaces and f_n that of the normal ones. Of two pads of radius R it is, with the force
    f and the moment m about the tool frame that the object's acceleration and weight need and P = 2 F,

        |f_xz| / (mu P) + |m_y| / (2/3 mu R P) + |m_xz| / (R P).

    Gyroscopic moments are left out.
    """

    def __init__(self, mujoco: Any, model: Any, data: Any, objects: TaskObjects) -> None:
        assert objects.grip is not None
        self._mujoco, self._model, self._data, self._objects, self._grip = mujoco, model, data, objects, objects.grip
        robot = objects.robot
        self._following = {
            int(model.joint(name).dofadr[0]): (robot.joint_names.index(mimic.source), float(np.sign(mimic.multiplier)))
            for name, mimic in robot.followers.items()
        }
        self._check_drives()
        self._pressing: dict[int, float] = {}
        self._holding: dict[str, tuple[set[int], float]] = {}
        self._closed: set[str] = set()
        self._most, self._wrench = 0.0, np.zeros(6)

    def _check_drives(self) -> None:
        """Raise InputError where fingers would press with more than their drives give."""
        robot, stages = self._objects.robot, self._objects.stages
        for j in {j for stage in stages for joints in stage.fingers.values() for j in joints}:
            fingers = 1 + sum(leader == j for leader, _ in self._following.values())
            most = float(robot.limits.torque[j]) / fingers
            if self._grip.force > most:
                found = f"fingers that press with {self._grip.force:g} N each"
                raise wrong_argument("execute", "grip", found, f"at most {most:g} N, what {robot.joint_names[j]} gives")

    def enter(self, stage: TaskStage, q: Array) -> None:
        """Press on what a stage says, with the joints at q (n,), rad or m."""
        self._pressing, self._holding = {}, {}
        self._data.qfrc_applied[list(self._following)] = 0.0
        for name in stage.pressed:
            force = {j: direction * self._grip.force for j, direction in stage.fingers[name].items()}
            led = [(dof, factor * force[j]) for dof, (j, factor) in self._following.items() if j in force]
            for dof, value in led:
                self._data.qfrc_applied[dof] = value
            self._pressing |= force
            touching = self._objects.meetings_with(name, self._objects.finger_links(stage, name))
            self._holding[name] = touching, self._grip.force * (len(force) + len(led))
        self._closed &= stage.pressed
        for a, b in self._objects.coupled:
            coupling = int(self._model.equality(coupling_name(a, b)).id)
            pressed = {a, b} <= set(self._pressing)
            if pressed and not self._data.eq_active[coupling]:
                self._model.eq_data[coupling][0] = q[a] - self._model.eq_data[coupling][1] * q[b]
            self._data.eq_active[coupling] = int(pressed)

    def pressed(self, command: Array) -> Array:
        """Return a command (n,), N·m or N, with the forces of the fingers that press."""
        if not self._pressing:
            return command
        command = np.array(command)
        command[list(self._pressing)] = list(self._pressing.values())
        return command

    def measure(self, meetings: Index, welded: Mapping[str, str]) -> None:
        """Look at the contacts of the present state, between these meetings (contacts,), and at what welds hold."""
        for name, (touching, expected) in self._holding.items():
            body = self._model.body(name).id
            normal, along = 0.0, np.zeros(3)
            for k in np.flatnonzero(np.isin(meetings, list(touching))).tolist():
                self._mujoco.mj_contactForce(self._model, self._data, k, self._wrench)
                normal += float(self._wrench[0])
                way = 1.0 if self._model.geom_bodyid[self._data.contact[k].geom[1]] == body else -1.0
                along += way * (self._wrench[1:3] @ self._data.contact[k].frame[3:].reshape(2, 3))
            needed = float(np.linalg.norm(along))
            if normal > CLOSED * expected:
                self._closed.add(name)
            if name in self._closed:
                self._most = max(self._most, 1.0 if normal <= 0.0 else needed / (self._grip.friction * normal))
        for name, link in welded.items():
            self._most = max(self._most, self._pad_load(name, link))

    def _pad_load(self, name: str, link: str) -> float:
        """Share of what two pads can hold that a welded object needs by its motion and weight."""
        body, first = self._data.body(name), int(self._model.joint(name).dofadr[0])
        model, carrier = self._model.body(name), self._objects.pads(link)
        X = self._data.body(carrier[0])
        R_pads = X.xmat.reshape(3, 3) @ carrier[1].rotation
        here = X.xpos + X.xmat.reshape(3, 3) @ carrier[1].translation
        acceleration, R = self._data.qacc[first : first + 6], body.ximat.reshape(3, 3)
        force = float(model.mass[0]) * (acceleration[:3] - self._model.opt.gravity)
        turning = R @ (model.inertia * (R.T @ body.xmat.reshape(3, 3) @ acceleration[3:]))
        f, m = R_pads.T @ force, R_pads.T @ (np.cross(body.xipos - here, force) + turning)
        press, friction = 2.0 * self._grip.force, self._grip.friction
        along, across = np.hypot(f[0], f[2]) / (friction * press), np.hypot(m[0], m[2]) / (PAD_RADIUS * press)
        return float(along + across + abs(m[1]) / (2.0 / 3.0 * friction * PAD_RADIUS * press))

    def load(self) -> float:
        """Return the largest load since the last call."""
        most, self._most = self._most, 0.0
        return most
