"""What every plant can do, and what it is made of."""

from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array

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


class Plant(Protocol):
    """A robot that moves; its state changes by `advance` only."""

    input: Input
    step: float

    @property
    def q(self) -> Array:
        """Positions (n,), rad or m."""

    @property
    def v(self) -> Array:
        """Velocities (n,)."""

    def holding(self) -> Array:
        """The input (n,) that leaves the plant where it is."""

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Hold an input for so many steps; `wrench` acts on the tool's origin, along the world's axes, N and N·m.

        Returns:
            (n,) what was applied, after saturation.
        """

    def contacts(self) -> list[tuple[str, str]]:
        """Names of the bodies that touched since the last call; empty for a plant without bodies."""
