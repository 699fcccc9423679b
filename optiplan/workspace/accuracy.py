"""Resolution, accuracy and repeatability, and what the resolution of the joints means at the tool."""

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

TURN = 2.0 * np.pi
"""Range, rad, that the encoder of a revolute joint divides."""
DEFAULT_RESOLUTION = "17bit"
"""Of the joints, when none is given: the common absolute encoder of an industrial arm, 48 µrad."""


def programming_resolution(length: float, bits: int) -> float:
    """Smallest step that a program can name, PR = L / (2^B - 1): range L, m or rad, in a word of B bits.

    Raises:
        ValueError: fewer bits than 1.
    """
    if bits < 1:
        raise ValueError(f"found {bits} bits; expected at least 1")
    return length / (2.0**bits - 1.0)


def control_resolution(travel_per_turn: float, pulses_per_turn: int, gear: float = 1.0) -> float:
    """Smallest step that the controller can sense, CR = p / (N g), m or rad.

    The shaft moves p, m or rad, a turn; the encoder counts N pulses a turn and turns g times as fast as the shaft.
    """
    return travel_per_turn / (pulses_per_turn * gear)


def spatial_accuracy(basic_length_unit: float, robot_accuracy: float = 0.0) -> float:
    """Largest distance, m, of the wanted from the reached point, SA = BLU / 2 + accuracy of the mechanics.

    A point between two steps of size BLU is at most half a step from one of them.
    """
    return 0.5 * basic_length_unit + robot_accuracy


def pose_accuracy(reached: Array, wanted: Array) -> float:
    """AP = |mean of the points reached - point wanted|, m, of points (N, 3) and (3,). Source: ISO 9283, 7.2."""
    return float(np.linalg.norm(reached.mean(axis=0) - wanted))


def repeatability(reached: Array) -> float:
    """RP = l + 3 S, m: mean and standard deviation of the distances of points (N, 3) from their mean. ISO 9283, 7.2.

    Raises:
        ValueError: fewer than two points.
    """
    if len(reached) < 2:
        raise ValueError(f"found {len(reached)} points; expected at least 2")
    distance = np.linalg.norm(reached - reached.mean(axis=0), axis=1)
    return float(distance.mean() + 3.0 * distance.std(ddof=1))


def joint_resolution(robot: Robot, text: str) -> Array:
    """Resolution (n,) of the joints, rad or m, from `17bit` or from a number.

    A number holds for every joint, rad (m for sliding ones). Bits divide one turn, or the stroke of a sliding joint:
    `programming_resolution`.

    Raises:
        OptiPlanError: neither a positive number nor a number of bits from 1 to 64.
    """
    word = text.strip().lower().removesuffix("s")
    bits = word.removesuffix("bit").strip()
    if word != bits and bits.isdecimal() and 1 <= int(bits) <= 64:
        stroke = robot.limits.upper - robot.limits.lower
        return np.array([programming_resolution(r, int(bits)) for r in np.where(robot.revolute, TURN, stroke)])
    try:
        step = float(word)
    except ValueError:
        step = np.nan
    if not 0.0 < step < np.inf:
        raise OptiPlanError(f"resolution: found '{text}'; expected a step in rad, 1e-4, or encoder bits, 17bit")
    return np.full(robot.n, step)


@dataclass(frozen=True, eq=False)
class ToolError:
    """Error of the tool at N configurations because joints stand on steps, each (N,).

    Attributes:
        position_worst: m, no position error is larger: sum_j |J_v,j| d_j / 2.
        position_rms: m, for errors spread evenly over a step, independent: sqrt(sum_j |J_v,j|² d_j² / 12).
        rotation_worst: rad, sum_j |J_w,j| d_j / 2.
        rotation_rms: rad, sqrt(sum_j |J_w,j|² d_j² / 12).
    """

    position_worst: Array
    position_rms: Array
    rotation_worst: Array
    rotation_rms: Array


def tool_error(J: Array, resolution: Array) -> ToolError:
    """First-order error of the tool from joint errors |dq_j| <= d_j / 2: J (N, 6, n), resolution d (n,), rad or m."""
    linear, angular = (np.linalg.norm(J[:, rows], axis=1) * resolution for rows in (slice(0, 3), slice(3, 6)))
    rms = [np.sqrt(np.square(part).sum(axis=1) / 12.0) for part in (linear, angular)]
    return ToolError(0.5 * linear.sum(axis=1), rms[0], 0.5 * angular.sum(axis=1), rms[1])
