"""The angles of one branch of the closed forms, for arrays of poses; formulas in `closed_form`."""

from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.kinematics.ik.arm_recognition import TOLERANCE, ArmGeometry
from optiplan.records import dataclass

Complex = npt.NDArray[np.complex128]
"""Points z + i x of the plane in which the links move."""

SIGNS: Array = np.array(list(product((1.0, -1.0), repeat=3))).T
"""(3, 8): the sign that shoulder, elbow and wrist take on each branch."""

_FREE_LENGTH = 1e-10
"""m or 1; a shorter direction is rounding: the joint about it is free."""

_PARALLEL_SINE = 1e-6
"""Sine between axes 4 and 6 below which a shift of q6 by its rounding changes the pose by less than 1e-9."""


@dataclass(frozen=True, eq=False)
class Places:
    """Points and directions that a target pose prescribes, in the arm frame A: arrays (..., 3).

    Attributes:
        six: direction of axis 6.
        five: where joint 6 at zero would put axis 5.
        cross: where joint 6 at zero would put the direction 5 x 6.
        point: wrist point, m.
    """

    six: Array
    five: Array
    cross: Array
    point: Array


def branch_names(geometry: ArmGeometry) -> tuple[str, ...]:
    """Return the names of the branches in the order of `SIGNS`.

    The view is from axis 1 towards the wrist point. Left and right: the side of axis 1 on which the arm's plane lies.
    Front and back: the direction of the arm if that plane contains axis 1. Up: the elbow is above the line from axis 2
    to the wrist point. With three parallel axes that line ends at axis 4, if that is on the same side of axis 2 as the
    wrist point. No flip: sin(q5 + zero) < 0, as for a PUMA.
    """
    sides = ("front", "back")
    if abs(geometry.lateral) > TOLERANCE:
        sides = ("left", "right") if geometry.lateral > 0.0 else ("right", "left")
    words = product(sides, ("up", "down"), ("flip", "no flip"))
    return tuple(f"shoulder {shoulder}, elbow {elbow}, wrist {wrist}" for shoulder, elbow, wrist in words)


def spherical_wrist(g: ArmGeometry, places: Places, signs: Array) -> tuple[Array, Array]:
    """Return angles (..., 6) and measures (..., 3), which are 0 where shoulder, elbow, wrist are singular.

    In the basis (5 x 4, 5, 4) of the forearm, axis 6 is v = Rz(q4) (sin t, 0, cos t) with t = q5 + zero. So
    t = atan2(± hypot(v_x, v_y), v_z) and q4 = atan2(± v_y, ± v_x). The direction of axis 5 gives q6.
    """
    pan, r = _pan(g, places.point, signs[0])
    way = places.point[..., 2] + 1j * r - g.shoulder
    lift, elbow, sine = _two_links(g, way, signs[0] * signs[1])
    forward = lift + elbow
    v = _turned(places.six, pan, forward) @ g.wrist
    m = _turned(places.five, pan, forward) @ g.wrist
    across = np.hypot(v[..., 0], v[..., 1])
    t = np.arctan2(signs[2] * across, v[..., 2])
    q4 = np.where(across > _FREE_LENGTH, np.arctan2(signs[2] * v[..., 1], signs[2] * v[..., 0]), 0.0)
    c4, s4 = np.cos(q4), np.sin(q4)
    along = c4 * m[..., 0] + s4 * m[..., 1]
    q6 = np.arctan2(np.sin(t) * m[..., 2] - np.cos(t) * along, c4 * m[..., 1] - s4 * m[..., 0])
    q = _wrap([pan, lift, g.signs[0] * elbow, q4, t - g.zero, q6])
    return q, _measures(g, r, sine, across)


def three_parallel(g: ArmGeometry, places: Places, signs: Array) -> tuple[Array, Array]:
    """Return angles (..., 6) and measures (..., 3), which are 0 where shoulder, elbow, wrist are singular.

    Joints 2, 3, 4 do not change components along y. That of axis 6 is cos t with
    t = q5 + zero = ± atan2(sqrt(v_x^2 + v_z^2), v_y). Then q6 turns axis 5 into the x-z plane, and q2 + q3 + q4 is the
    angle of axis 5 about y.
    """
    pan, r = _pan(g, places.point, signs[0])
    v, a, b = (_turned(u, pan, None) for u in (places.six, places.five, places.cross))
    across = np.hypot(v[..., 0], v[..., 2])
    t = signs[2] * np.arctan2(across, v[..., 1])
    way = places.point[..., 2] + 1j * r - g.shoulder
    q6 = np.arctan2(signs[2] * a[..., 1], -signs[2] * b[..., 1])
    axis = np.cos(q6)[..., None] * a + np.sin(q6)[..., None] * b
    total = np.angle(axis[..., 2] + 1j * axis[..., 0]) - g.five
    shift = _shift(g, way, total, np.where(across > _FREE_LENGTH, np.nan, signs[2]))
    shift = np.where(across < _PARALLEL_SINE, shift, 0.0)
    total, q6 = total + shift, q6 - np.sign(v[..., 1]) * shift
    lift, elbow, sine = _two_links(g, way - np.exp(1j * total) * g.hand, signs[0] * signs[1])
    q = _wrap([pan, lift, g.signs[0] * elbow, g.signs[1] * (total - lift - elbow), t - g.zero, q6])
    return q, _measures(g, r, sine, across)


def _pan(g: ArmGeometry, point: Array, sign: Array) -> tuple[Array, Array]:
    """q1, and the x coordinate r that the wrist point has in the arm turned by it (0 when it lies too close)."""
    square = point[..., 0] ** 2 + point[..., 1] ** 2
    r = sign * np.sqrt(np.maximum(square - g.lateral**2, 0.0))
    heading = np.where(square > _FREE_LENGTH**2, np.arctan2(point[..., 1], point[..., 0]), 0.0)
    return heading - np.arctan2(g.lateral, r), r


class _Elbow(NamedTuple):
    """Angles of joints 2 and 3, rad, and |sin beta|, which is 0 for a stretched or folded arm."""

    lift: Array
    elbow: Array
    sine: Array


def _two_links(g: ArmGeometry, way: Complex, sign: Array) -> _Elbow:
    """Return the angles of joints 2 and 3, both about y, that span `way`, or come nearest to it."""
    upper, fore = abs(g.upper), abs(g.fore)
    cosine = (way.real**2 + way.imag**2 - upper**2 - fore**2) / (2.0 * upper * fore)
    beta = np.arccos(np.clip(cosine, -1.0, 1.0))
    elbow = sign * beta - np.angle(g.fore) + np.angle(g.upper)
    return _Elbow(np.angle(way) - np.angle(g.upper + np.exp(1j * elbow) * g.fore), elbow, np.sin(beta))


def _shift(g: ArmGeometry, way: Complex, total: Array, side: Array) -> Array:
    """Turn of q2 + q3 + q4, and of q6 against it, that brings axis 4 into the reach of the two links.

    Where axes 4 and 6 are nearly parallel, q6 is hardly known, and a stretched arm might not get where its rounding
    errors put axis 4. `side` is NaN there: the least turn is taken. Elsewhere q6 is free: axis 4 is put where it suits
    the links best, on that side of the line from axis 2 to P.
    """
    reach, hand, upper, fore = np.maximum(np.abs(way), _FREE_LENGTH), abs(g.hand), abs(g.upper), abs(g.fore)
    now = np.abs(way - np.exp(1j * total) * g.hand)
    wanted = np.where(np.isnan(side), np.clip(now, abs(upper - fore), upper + fore), np.hypot(upper, fore))
    wanted = np.clip(wanted, np.abs(reach - hand), reach + hand)
    angle = np.angle(way * np.conj(g.hand) * np.exp(-1j * total))
    cosine = (reach**2 + hand**2 - wanted**2) / (2.0 * reach * hand)
    aim = np.where(np.isnan(side), np.sign(angle), side) * np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.where(np.isnan(side) & (wanted == now), 0.0, angle - aim)


def _turned(u: Array, pan: Array, forward: Array | None) -> Array:
    """Ry(-forward) Rz(-pan) u: a direction of A as the link behind joint 1, or 3, sees it: (..., 3)."""
    c, s = np.cos(pan), np.sin(pan)
    x, y = c * u[..., 0] + s * u[..., 1], c * u[..., 1] - s * u[..., 0]
    z = np.broadcast_to(u[..., 2], x.shape)
    if forward is None:
        return np.stack([x, y, z], axis=-1)
    c, s = np.cos(forward), np.sin(forward)
    return np.stack([c * x - s * z, y, s * x + c * z], axis=-1)


def _measures(g: ArmGeometry, r: Array, sine: Array, across: Array) -> Array:
    shoulder = np.abs(r) / (abs(g.upper) + abs(g.fore))
    return np.stack(np.broadcast_arrays(shoulder, sine, across), axis=-1)


def _wrap(angles: list[Array]) -> Array:
    """Stacked (..., 6) and moved by whole turns into (-pi, pi]."""
    q = np.stack(np.broadcast_arrays(*angles), axis=-1)
    return np.asarray(q - 2.0 * np.pi * np.ceil((q - np.pi) / (2.0 * np.pi)))
