"""Make coal's answers about boxes independent of what the process asked before; importing this module does it."""

import coal
import numpy as np
import pinocchio as pin

from optiplan.geometry.coal_tolerance import DISTANCE_ERROR


def prime_box_support() -> None:
    """Ask coal for the support of a rotated box, once for each instance of its template.

    coal 3.0.3 keeps in `getShapeSupport(const Box*, ...)` a function-local

        static const inflate = (dir.array() == 0).any() ? 1 + 1e-10 : 1

    so that the first direction in which any box of the process is asked decides whether all boxes are larger by that
    factor on their negative sides. The search begins along an axis of the first shape, so that most processes decide
    for 1 + 1e-10; a box turned against a ball, as the first shape, makes it so in every process. One instance of the
    template adds the radius of a swept sphere, the other does not, and each has its own constant.
    """
    turned = coal.Transform3s(pin.rpy.rpyToMatrix(0.3, 0.5, 0.7), np.array([3.0, 1.0, 0.5]))
    box, ball = coal.Box(1.0, 1.0, 1.0), coal.Sphere(0.5)
    for swept in (False, True):
        difference = coal.MinkowskiDiff()
        difference.set(box, ball, turned, coal.Transform3s(), swept)
        coal.GJK(100, DISTANCE_ERROR).evaluate(difference, np.array([1.0, 0.0, 0.0]), np.zeros(2, dtype=np.int32))


prime_box_support()
