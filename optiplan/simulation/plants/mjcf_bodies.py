"""Inertia and pose of a body in the words of MuJoCo's files."""

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.urdf.elements import number_words

_LEAST = 1e-12
"""kg·m² and kg of a body without mass, such as the sliding parts that stand for a mobile base."""

_ROUNDING = 1e-9  # share of a moment of inertia


def inertial_of(node: ET.Element, inertia: pin.Inertia) -> None:
    """Mass, centre and inertia about it; MuJoCo wants some of each of every body that moves."""
    if inertia.mass <= 0.0:
        ET.SubElement(node, "inertial", pos="0 0 0", mass=repr(_LEAST), diaginertia=number_words([_LEAST] * 3))
        return
    moments = physical(np.array(inertia.inertia))
    full = moments[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    ET.SubElement(
        node,
        "inertial",
        pos=number_words(inertia.lever),
        mass=repr(float(inertia.mass)),
        fullinertia=number_words(full),
    )


def physical(inertia: Array) -> Array:
    """The inertia (3, 3) itself where a body can have it, else the nearest larger one that a body can have.

    The principal moments A <= B <= C of any body obey A > 0 and A + B >= C, on which MuJoCo insists. Published ones do
    not always (those of the PUMA 560's third link do not): what is missing is then added to A and B in equal parts.
    """
    moments, axes = np.linalg.eigh(inertia)
    raised = np.maximum(moments, _LEAST)
    missing = raised[2] * (1.0 + _ROUNDING) - raised[0] - raised[1]
    if (raised == moments).all() and missing <= 0.0:
        return inertia
    raised[:2] += 0.5 * max(missing, 0.0)
    return np.asarray(axes @ np.diag(raised) @ axes.T)


def pose_of(X: pin.SE3) -> dict[str, str]:
    """Return the attributes of a pose."""
    x, y, z, w = pin.Quaternion(X.rotation).normalized().coeffs()
    return {"pos": number_words(X.translation), "quat": number_words([w, x, y, z])}
