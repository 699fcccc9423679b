"""What every plant can do, and what it is made of."""

from abc import ABC, abstractmethod
from dataclasses import field
from typing import ClassVar, Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.dynamics import RigidBodyDynamics

Input = Literal["velocity", "torque"]
"""What a plant takes: joint velocities, rad/s (m/s), or joint torques, N·m (N)."""


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of the joints: tau_f = viscous v + coulomb tanh(v / BREAKAWAY).

    Attributes:
        viscous: (n,), N·m·s/rad (N·s/m).
        coulomb: (n,), N·m (N).
    """

    viscous: Array
    coulomb: Array


@dataclass(frozen=True, eq=False)
class Payload:
    """A point mass at the tool, and what the controller takes it for.

    Attributes:
        mass: kg, in the plant.
        assumed: kg, in the controller's model.
        centre: (3,), m, in the tool frame.
    """

    mass: float
    assumed: float
    centre: Array = field(default_factory=lambda: np.zeros(3))


def assumed_dynamics(robot: Robot, payload: Payload | None) -> RigidBodyDynamics:
    """Return the model that the controller takes the robot for."""
    if payload is None:
        return RigidBodyDynamics(robot)
    return RigidBodyDynamics(robot, payload.assumed, payload.centre)


@dataclass(frozen=True, eq=False)
class PlantOptions:
    """What a plant has beside the links of its robot.

    Attributes:
        limit: torque (n,) that the drives can give, N·m (N); None: the robot's own.
        friction: of the joints; None: without.
        payload: at the tool; None: without.
        rotor_inertia: (n,), kg·m² (kg), of the drives, seen from the joints; None: without.
        velocity: (n,), with which it begins, rad/s (m/s); None: at rest.
    """

    limit: Array | None = None
    friction: Friction | None = None
    payload: Payload | None = None
    rotor_inertia: Array | None = None
    velocity: Array | None = None

    @property
    def mass(self) -> float:
        """Of the payload, kg."""
        return 0.0 if self.payload is None else self.payload.mass

    @property
    def centre(self) -> Array:
        """Of the payload, (3,), m, in the tool frame."""
        return np.zeros(3) if self.payload is None else np.asarray(self.payload.centre, float)


NOMINAL = PlantOptions()
"""The robot as it is described."""


class Plant(ABC):
    """A robot that moves; its state changes by `advance` only.

    Attributes:
        input: what it takes.
        step: s.
        q: positions (n,), rad or m; `v`: velocities (n,).
    """

    input: ClassVar[Input]
    step: float
    q: Array
    v: Array

    @abstractmethod
    def holding(self) -> Array:
        """The input (n,) that leaves the plant where it is."""

    @abstractmethod
    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Hold an input for so many steps; `wrench` acts on the tool's origin, along the world's axes, N and N·m.

        Returns:
            (n,) what was applied, after saturation.
        """

    def contacts(self) -> list[tuple[str, str]]:
        """Names of the bodies that touched since the last call; empty for a plant whose bodies meet nothing."""
        return []


class TorquePlant(Plant):
    """A plant that takes torques within the limits of its drives."""

    input = "torque"

    def __init__(self, robot: Robot, step: float, options: PlantOptions) -> None:
        """Set the drives and the model.

        Args:
            robot: with n joints.
            step: s.
            options: drives, friction, payload, velocity.
        """
        self.step = step
        self._limit = robot.limits.torque if options.limit is None else options.limit
        self.dynamics = RigidBodyDynamics(robot, options.mass, options.centre)

    def holding(self) -> Array:
        """Gravity's torque, within the limits."""
        return self._within_limits(self.dynamics.gravity(self.q))

    def _within_limits(self, torque: Array) -> Array:
        return np.minimum(np.maximum(torque, -self._limit), self._limit)

    def _pushed(self, torque: Array, q: Array, wrench: pin.Force | None) -> Array:
        """Add the torque (n,) of a wrench on the tool at q (n,)."""
        return torque if wrench is None else torque + self.dynamics.tool_jacobian(q).T @ wrench.vector
