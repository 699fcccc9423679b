"""The reference of a simulated drive: set-points as they come, and the way ahead when they do not."""

from collections import deque

import numpy as np

from optiplan.arrays import Array
from optiplan.execution.loop.clock_offset import ClockOffset

RATE = 0.02
"""By which share the reference may run faster or slower than time, to come in step with the sender's clock."""

KEPT = 16
"""Ways ahead that are kept."""


class ReceivedSetPoints:
    """Where the joints are wanted at a time, of set-points with a delay that varies.

    A set-point for time t of the sender that was sent at t' of this machine shows t' - t, the clocks' distance and its
    delay. The reference follows the smallest, so that late set-points do not slow it, without jumps. Between
    set-points, and for `silence` s after the last, the reference goes on with its acceleration; later it is that of the
    way ahead. A simulation that is late itself finds its own time in the ways before.

    Args:
        q: (n,) where the robot stands.
        silence: s.
    """

    def __init__(self, q: Array, silence: float) -> None:
        still = np.zeros(len(q))
        self._point, self._silence = (0.0, np.array(q), still, still), silence
        self._ahead: deque[tuple[Array, Array, Array, Array]] = deque(maxlen=KEPT)
        self._offset: float | None = None
        self._clocks = ClockOffset()
        self.stopping = False

    def take(self, t: float, q: Array, v: Array, a: Array, sent: float) -> None:
        """Take a set-point that was sent at `sent`, s."""
        least = self._clocks.take(sent, t)
        if self._offset is None:
            self._offset = least
        most = RATE * max(0.0, t - self._point[0])
        self._offset += min(max(least - self._offset, -most), most)
        self._point = t, q, v, a

    def take_ahead(self, t: Array, q: Array, v: Array, a: Array) -> None:
        """Take the way of a robot without further set-points: (K,) and (K, n)."""
        self._ahead.append((t, q, v, a))

    def at(self, now: float) -> tuple[Array, Array, Array]:
        """Return q, v, a (n,) at `now`, s."""
        t, q, v, a = self._point
        if self._offset is None:
            return q, v, a
        time = now - self._offset
        h = time - t
        if self._ahead and (self.stopping or abs(h) > self._silence):
            way = next((one for one in reversed(self._ahead) if one[0][0] <= time), self._ahead[0])
            return between(*way, time)
        if not self._ahead:  # nothing is known beyond the set-point
            h = min(max(h, -self._silence), self._silence)
        return q + h * (v + 0.5 * h * a), v + h * a, a

    def rests(self, now: float) -> bool:
        """Whether the reference stands still from `now` on."""
        if self._offset is None or not self._ahead:
            return True
        return bool(now - self._offset >= self._ahead[-1][0][-1])


def between(t: Array, q: Array, v: Array, a: Array, time: float) -> tuple[Array, Array, Array]:
    """Return q, v, a (n,) at a time of samples (K,), (K, n), on quintic polynomials between them; its ends outside."""
    if time >= t[-1] or time <= t[0]:
        k = -1 if time >= t[-1] else 0
        return q[k], v[k], a[k]
    k = int(np.searchsorted(t, time, side="right")) - 1
    w = t[k + 1] - t[k]
    x = (time - t[k]) / w
    d = q[k + 1] - q[k] - w * (v[k] + 0.5 * w * a[k])
    e = w * (v[k + 1] - v[k] - w * a[k])
    f = w * w * (a[k + 1] - a[k])
    c3, c4, c5 = 10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f
    position = q[k] + w * x * (v[k] + 0.5 * w * x * a[k]) + x**3 * (c3 + x * (c4 + x * c5))
    velocity = v[k] + w * x * a[k] + x * x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)) / w
    acceleration = a[k] + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)) / (w * w)
    return position, velocity, acceleration
