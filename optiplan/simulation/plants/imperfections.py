"""What a controller sees and when it is heard: encoders, noise, delay."""

from collections import deque

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass

MOST_DELAY = 10.0
"""s, from measurement to torque."""


@dataclass(frozen=True)
class Imperfections:
    """How a real loop differs from an ideal one.

    Attributes:
        delay: s from the measurement to the moment when the command acts.
        encoder: rad (m), the smallest step of a measured position; 0: none.
        position_noise: rad (m), standard deviation; `velocity_noise`: rad/s (m/s).
        velocity_filter: Hz; with an encoder, velocities are differences of positions behind a first-order low-pass of
            this corner frequency.
        seed: of the noise.
    """

    delay: float = 0.0
    encoder: float = 0.0
    position_noise: float = 0.0
    velocity_noise: float = 0.0
    velocity_filter: float = 100.0
    seed: int = 0


PERFECT = Imperfections()
"""No delay, no noise, no steps."""


class Sensor:
    """Measures positions and velocities once a control step."""

    def __init__(self, imperfections: Imperfections, dt: float) -> None:
        self._how, self._dt = imperfections, dt
        self._random = np.random.default_rng(imperfections.seed)
        self._before: Array | None = None
        self._speed: Array | None = None
        self._share = 1.0 - np.exp(-2.0 * np.pi * imperfections.velocity_filter * dt)
        self._perfect = not (imperfections.encoder or imperfections.position_noise or imperfections.velocity_noise)

    def measure(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Measured q and v (n,), of the true ones (n,)."""
        if self._perfect:
            return q, v
        how = self._how
        if how.position_noise:
            q = q + how.position_noise * self._random.standard_normal(len(q))
        if how.encoder:
            q = np.round(q / how.encoder) * how.encoder
            before = q if self._before is None else self._before
            speed = np.zeros(len(q)) if self._speed is None else self._speed
            v = speed + self._share * ((q - before) / self._dt - speed)
            self._before, self._speed = q, v
        if how.velocity_noise:
            v = v + how.velocity_noise * self._random.standard_normal(len(v))
        return q, v


class DelayLine:
    """Commands that act later, by whole steps of the plant."""

    def __init__(self, delay: float, step: float, per_control: int, first: Array) -> None:
        """Fill the line with the input that acts before the first command.

        Args:
            delay: s.
            step: of the plant, s.
            per_control: steps of the plant between two commands.
            first: (n,).
        """
        whole = round(delay / step)
        self._periods, self._rest = divmod(whole, per_control)
        self._count = per_control
        self._waiting = deque([np.array(first)] * (self._periods + 2), maxlen=self._periods + 2)

    def after(self, command: Array) -> list[tuple[Array, int]]:
        """Inputs of the coming control period with the steps that each is held, once `command` (n,) was sent."""
        self._waiting.append(command)  # waiting[-1 - k] was sent k periods ago
        new, old = self._waiting[1], self._waiting[0]
        parts = [(old, self._rest), (new, self._count - self._rest)]
        return [(value, steps) for value, steps in parts if steps]
