"""Our own plant: rigid-body dynamics with friction, integrated at a finer step than the controller's."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.base import NOMINAL, PlantOptions, TorquePlant

BREAKAWAY = 1e-3
"""rad/s (m/s): below about this speed, dry friction is less than its full value; a joint at rest creeps, if at all."""


class RigidBodyPlant(TorquePlant):
    """M(q) v' + c(q, v) + g(q) = tau - tau_f(v) + J^T f, saturated at the torque limits, in steps of `step`, s.

    One step is semi-implicit: friction is linearised, so that the stiffest joint stays stable,

        (M + B + h F'(v)) a = tau - c - g - F(v) + J^T f,   v+ = v + h a,   q+ = q + h v+,

    with F the friction, B the inertia of the rotors and h the step. Without friction this is the symplectic Euler
    method: energy errors stay bounded, position errors are of order h.
    """

    def __init__(self, robot: Robot, q: Array, step: float, options: PlantOptions = NOMINAL) -> None:
        """Begin at q (n,), rad or m; the rest as of `TorquePlant`."""
        super().__init__(robot, step, options)
        none, friction = np.zeros(robot.n), options.friction
        self._viscous, self._coulomb = (none, none) if friction is None else (friction.viscous, friction.coulomb)
        self._frictionless = not (self._viscous.any() or self._coulomb.any())
        self._rotor = none if options.rotor_inertia is None else options.rotor_inertia
        self.q, self.v = np.array(q, float), np.array(none if options.velocity is None else options.velocity, float)

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Hold the torque `command` (n,), N·m (N), as far as the drives can give it."""
        applied = self._within_limits(command)
        h, q, v = self.step, self.q, self.v
        for _ in range(steps):
            drive = self._pushed(applied, q, wrench)
            if self._frictionless:
                a = self.dynamics.acceleration(q, v, drive, self._rotor)
            else:
                slip = np.tanh(v / BREAKAWAY)
                slope = self._viscous + self._coulomb / BREAKAWAY * (1.0 - slip * slip)
                resisting = self._viscous * v + self._coulomb * slip
                a = self.dynamics.acceleration(q, v, drive - resisting, self._rotor + h * slope)
            v = v + h * a
            q = q + h * v
        self.q, self.v = q, v
        return applied
