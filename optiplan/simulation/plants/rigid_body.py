"""Our own plant: rigid-body dynamics with friction, integrated at a finer step than the controller's."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.base import NOMINAL, Input, PlantOptions
from optiplan.simulation.plants.dynamics import RigidBodyDynamics

BREAKAWAY = 1e-3
"""rad/s (m/s): below about this speed, dry friction is less than its full value; a joint at rest creeps, if at all."""


class RigidBodyPlant:
    """M(q) v' + c(q, v) + g(q) = tau - tau_f(v) + J^T f, saturated at the torque limits, in steps of `step`, s.

    One step is semi-implicit: friction is linearised, so that the stiffest joint stays stable,

        (M + B + h F'(v)) a = tau - c - g - F(v) + J^T f,   v+ = v + h a,   q+ = q + h v+,

    with F the friction, B the inertia of the rotors and h the step. Without friction this is the symplectic Euler
    method: energy errors stay bounded, position errors are of order h.
    """

    input: Input = "torque"

    def __init__(self, robot: Robot, q: Array, step: float, options: PlantOptions = NOMINAL) -> None:
        """Begin at q.

        Args:
            robot: with n joints.
            q: (n,), rad or m.
            step: s.
            options: drives, friction, payload, velocity.
        """
        self.step = step
        none, friction = np.zeros(robot.n), options.friction
        self._limit = robot.limits.torque if options.limit is None else options.limit
        self._viscous, self._coulomb = (none, none) if friction is None else (friction.viscous, friction.coulomb)
        self._frictionless = not (self._viscous.any() or self._coulomb.any())
        self._rotor = none if options.rotor_inertia is None else options.rotor_inertia
        self.dynamics = RigidBodyDynamics(robot, options.mass, options.centre)
        self._q, self._v = np.array(q, float), np.array(none if options.velocity is None else options.velocity, float)

    @property
    def q(self) -> Array:
        """Positions (n,), rad or m."""
        return self._q

    @property
    def v(self) -> Array:
        """Velocities (n,)."""
        return self._v

    def holding(self) -> Array:
        """Gravity's torque, within the limits."""
        return np.clip(self.dynamics.gravity(self._q), -self._limit, self._limit)

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Hold the torque `command` (n,), N·m (N), as far as the drives can give it."""
        applied = np.minimum(np.maximum(command, -self._limit), self._limit)
        h, q, v, drive = self.step, self._q, self._v, applied
        for _ in range(steps):
            if wrench is not None:
                drive = applied + self.dynamics.tool_jacobian(q).T @ wrench.vector
            if self._frictionless:
                a = self.dynamics.acceleration(q, v, drive, self._rotor)
            else:
                slip = np.tanh(v / BREAKAWAY)
                slope = self._viscous + self._coulomb / BREAKAWAY * (1.0 - slip * slip)
                resisting = self._viscous * v + self._coulomb * slip
                a = self.dynamics.acceleration(q, v, drive - resisting, self._rotor + h * slope)
            v = v + h * a
            q = q + h * v
        self._q, self._v = q, v
        return applied

    def contacts(self) -> list[tuple[str, str]]:
        """None: bodies pass through each other here; the log measures their distances instead."""
        return []
