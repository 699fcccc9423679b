"""Controllers of the joints: PID on positions, computed torque, and velocity tracking.

Source: B. Siciliano et al., Robotics: Modelling, Planning and Control, sections 8.5.1 and 8.5.2.
"""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array
from optiplan.simulation.controllers.base import Command, JointTarget
from optiplan.simulation.plants.base import Input
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.references.base import ToolTarget


class _JointLoops:
    """Loops of each joint alone; with or without gravity's torque.

    The integral's part of the torque stays within `integral_limit`, so that it does not wind up while a drive is at
    its limit.
    """

    output: Input = "torque"

    def __init__(
        self,
        gains: tuple[Array, Array, Array],
        dt: float,
        integral_limit: Array | None = None,
        gravity: RigidBodyDynamics | None = None,
    ) -> None:
        """Begin with an empty integral.

        Args:
            gains: (n,) each, as the class says.
            dt: the control period, s.
            integral_limit: (n,), N·m (of sliding joints N); None: without.
            gravity: the model whose gravity is compensated; None: not at all.
        """
        self._gains, self._dt, self._gravity = gains, dt, gravity
        self._most = np.inf if integral_limit is None else integral_limit
        self._integral: Array = np.zeros(len(gains[0]))

    def _integrated(self, rate: Array) -> Array:
        """Return the integral's part of the torque (n,) after a period at this rate (n,), N·m/s."""
        self._integral = np.clip(self._integral + rate * self._dt, -self._most, self._most)
        return self._integral

    def _command(self, torque: Array, q: Array, target: JointTarget) -> Command:
        return Command(torque if self._gravity is None else torque + self._gravity.gravity(q), target.q)


class PidController(_JointLoops):
    """tau = P e + I ∫ e dt + D (v_ref - v), e = q_ref - q.

    Gains: P, N·m/rad; I, N·m/(rad s); D, N·m·s/rad (of sliding joints with m and N).
    """

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See the class."""
        assert isinstance(target, JointTarget)
        p, i, d = self._gains
        e = target.q - q
        return self._command(p * e + self._integrated(i * e) + d * (target.v - v), q, target)


class DriveLoops(_JointLoops):
    """tau = Kv e + Ki ∫ e dt, e = v_cmd - v, v_cmd = v_ref + Kp (q_ref - q).

    Drives that take velocities are given v_cmd. Those that take positions close the outer loop themselves, from q_ref
    alone: there v_ref is missing, and a moving reference is followed late by v_ref / Kp.
    Gains: Kp, 1/s; Kv, N·m·s/rad; Ki, N·m/rad (of sliding joints with m and N).
    """

    def __init__(
        self,
        gains: tuple[Array, Array, Array],
        dt: float,
        takes: str,
        integral_limit: Array | None = None,
        gravity: RigidBodyDynamics | None = None,
    ) -> None:
        """Begin with an empty integral, for drives that take a `velocity` or a `position`."""
        super().__init__(gains, dt, integral_limit, gravity)
        self._ahead = float(takes == "velocity")

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See the class."""
        assert isinstance(target, JointTarget)
        position, velocity, integral = self._gains
        e = self._ahead * target.v + position * (target.q - q) - v
        return self._command(velocity * e + self._integrated(integral * e), q, target)


class ComputedTorque:
    """tau = M(q) (a_ref + Kd (v_ref - v) + Kp (q_ref - q)) + c(q, v) + g(q), Kp = w², Kd = 2 z w.

    With the right model every joint's error obeys e'' + 2 z w e' + w² e = 0. Where the reference has a feed-forward of
    torques, M(q) a_ref + c + g is taken from it.
    """

    output: Input = "torque"

    def __init__(self, dynamics: RigidBodyDynamics, frequency: float, damping: float = 1.0) -> None:
        """Set the gains.

        Args:
            dynamics: the model that the controller believes in.
            frequency: w / 2 pi, Hz.
            damping: z, 1 for no overshoot.
        """
        self._dynamics = dynamics
        w = 2.0 * np.pi * frequency
        self._kp, self._kd = w * w, 2.0 * damping * w

    def torque(self, q: Array, v: Array, target: JointTarget) -> Array:
        """See the class; (n,), N·m (N)."""
        feedback = self._kd * (target.v - v) + self._kp * (target.q - q)
        if target.ahead_torque is not None:
            return np.asarray(target.ahead_torque + self._dynamics.mass_matrix(q) @ feedback)
        return self._dynamics.torque(q, v, target.ahead_a + feedback)

    def carry(self, dynamics: RigidBodyDynamics) -> None:
        """Believe in another model from now on: the robot has taken or released a load."""
        self._dynamics = dynamics

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See the class."""
        assert isinstance(target, JointTarget)
        return Command(self.torque(q, v, target), target.q)


class WheeledTorque(ComputedTorque):
    """Computed torque of a robot on wheels, which are told where their base should be."""

    def __init__(self, dynamics: RigidBodyDynamics, frequency: float, aim: Callable[[Array, Array], None]) -> None:
        """Set the gains; `aim` is told the wanted q and v (n,) of each period, see `MecanumWheels`."""
        super().__init__(dynamics, frequency)
        self._aim = aim

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See `ComputedTorque`."""
        assert isinstance(target, JointTarget)
        self._aim(target.q, target.v)
        return super().command(q, v, target)


class VelocityTracking:
    """v = v_ref + k (q_ref - q), for plants that take velocities."""

    output: Input = "velocity"

    def __init__(self, gain: float) -> None:
        """Set k, 1/s."""
        self._gain = gain

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See the class."""
        assert isinstance(target, JointTarget)
        return Command(target.ahead_v + self._gain * (target.q - q), target.q)
