"""Rise, overshoot, settling and steady-state error of a joint's answer to a step."""

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass

SETTLED = 0.02
"""Share of the step within which an answer counts as settled."""


@dataclass(frozen=True)
class StepResponse:
    """Figures of one step.

    Attributes:
        rise: s from 10 % to 90 % of the step; None where it never comes that far.
        overshoot: share of the step by which the answer passes the value requested, 0 without.
        settling: s from the step until the answer stays within 2 % of the step around the value requested; None: never.
        steady_error: rad (m), requested less reached, mean of the last tenth.
    """

    rise: float | None
    overshoot: float
    settling: float | None
    steady_error: float


def step_response(t: Array, q: Array, at: float, start: float, end: float) -> StepResponse:
    """Figures of q(t), (K,) each, that was sent from `start` to `end` (rad or m) at time `at`, s.

    Raises:
        ValueError: there is no step, or nothing after it.
    """
    after = t >= at
    if start == end or after.sum() < 2:
        raise ValueError("found no step; expected different ends and samples after it")
    share, seconds = (q[after] - start) / (end - start), t[after] - at
    low, high = _first(share >= 0.1), _first(share >= 0.9)
    rise = None if low is None or high is None else float(seconds[high] - seconds[low])
    outside = np.flatnonzero(np.abs(share - 1.0) > SETTLED)
    last = -1 if not len(outside) else int(outside[-1])
    settling = None if last == len(share) - 1 else float(seconds[last + 1])
    tail = share[-max(1, len(share) // 10) :]
    return StepResponse(rise, max(0.0, float(share.max()) - 1.0), settling, float((1.0 - tail.mean()) * (end - start)))


def _first(reached: np.ndarray) -> int | None:
    found = np.flatnonzero(reached)
    return int(found[0]) if len(found) else None
