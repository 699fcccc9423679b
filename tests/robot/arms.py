"""Arms with closed forms, shipped and made at random, and configurations beside their singularities."""

from functools import cache

import numpy as np
import pinocchio as pin

from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.robot.robot import load_robot

ARMS = {"srra": None, "puma560": None, "ur5": None, "ur3": None, "delbot": "arm"}


@cache
def arm(name):
    robot = load_robot(name, group=ARMS[name])
    return robot, closed_form(robot)


def turned(a, b):
    """Largest difference up to whole turns, rad, over the last axis."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max(-1)


def beside(g, Q, rng, kinds, distance):
    """The configurations Q (N, 6) moved to within `distance`, rad, of singularities of these kinds."""
    Q, away = Q.copy(), rng.uniform(-distance, distance, (3, len(Q)))
    if "wrist" in kinds:
        Q[:, 4] = np.pi * rng.integers(0, 2, len(Q)) - g.zero + away[0]
    if "elbow" in kinds:
        Q[:, 2] = g.signs[0] * (np.angle(g.upper) - np.angle(g.fore) + away[1])
    if (
        "shoulder" in kinds
    ):  # axis 1 at the same height of the arm's plane as P: the real part of P - axis 1 alone is left
        hand = 0.0 if g.spherical else np.exp(1j * g.signs[1] * Q[:, 3]) * g.hand
        Q[:, 1] = away[2] - np.angle(g.upper + np.exp(1j * g.signs[0] * Q[:, 2]) * (g.fore + hand))
    return Q


def perpendicular(v, rng):
    w = np.cross(v, rng.normal(size=3))
    return w / np.linalg.norm(w)


def made(family, rng, error=0.0):
    """A model of six joints of a family, anywhere and with any joint frames; axes off by up to `error`, rad."""
    y, z, side = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), rng.choice([-1.0, 1.0], 6)
    w, p = [z, y, y], [*rng.uniform(-0.5, 0.5, (3, 3))]
    p[0][:2] = 0.0
    P = rng.uniform(-0.5, 0.5, 3)
    if family == "spherical":
        w.append(perpendicular(rng.normal(size=3), rng))
        p += [P, P, P]
    else:
        w.append(y)
        p += [rng.uniform(-0.5, 0.5, 3), P, P]
    w.append(perpendicular(w[3], rng))
    w.append(perpendicular(w[4], rng))
    return model_of([s * (v + error * rng.normal(size=3)) for s, v in zip(side, w, strict=True)], p, rng)


def model_of(axes, points, rng):
    """The axes lie so at q = 0, seen from a random base; every joint frame is turned at random."""
    model, base = pin.Model(), pin.SE3.Random()
    parent, X_BP = 0, base.inverse()
    for j, (w, p) in enumerate(zip(axes, points, strict=True)):
        X_BJ = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), p + rng.normal() * w)
        local = X_BJ.rotation.T @ (w / np.linalg.norm(w))
        joint = pin.JointModelRevoluteUnaligned(local)
        parent = model.addJoint(parent, joint, X_BP.inverse() * X_BJ, f"joint_{j}")
        X_BP = X_BJ
    tool = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), rng.uniform(-0.2, 0.2, 3))
    model.addFrame(pin.Frame("tool", parent, tool, pin.FrameType.OP_FRAME))
    return model
