"""Neighbouring links that never touch, whatever their joint does: planners skip them."""

import coal
import numpy as np

from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_bounds import PairBounds
from optiplan.robot.urdf.srdf import link_pair


@once_for_each_robot
def passing_neighbours(robot: Robot) -> frozenset[tuple[int, int]]:
    """Return those of `apart_neighbours` with a mesh, which planners skip whatever clearance is required.

    Flanges tenths of a millimetre apart take hundreds of times as long as two convex bodies, at every configuration.
    """
    meshes = [isinstance(body.geometry, coal.BVHModelBase) for body in robot.geometry.geometryObjects]
    if not any(meshes):
        return frozenset()
    return frozenset((a, b) for a, b in apart_neighbours(robot) if meshes[a] or meshes[b])


@once_for_each_robot
def apart_neighbours(robot: Robot) -> frozenset[tuple[int, int]]:
    """Return the pairs of bodies that the survey found apart over the whole range of the one joint that moves them.

    Their distance is a function of that joint alone, so that they are apart in any tube about a motion, too. This is no
    proof; the verifier checks these pairs along every motion.
    """
    if robot.held:  # a robot with held joints is not surveyed
        return frozenset()
    pairs = [(int(pair.first), int(pair.second)) for pair in robot.geometry.collisionPairs]
    if not pairs:
        return frozenset()
    depends = PairBounds(robot.kinematics, robot.geometry, pairs, robot.link_boxes).depends
    # The survey covers the whole range of an endless joint without followers.
    alone = (np.abs(robot.kinematics.coupling) > 0.0).sum(axis=0) == 1
    whole = np.isfinite(robot.limits.upper - robot.limits.lower) | (robot.endless & alone)
    moved = [pairs[k] for k in np.flatnonzero((depends.sum(axis=1) == 1) & (~depends | whole).all(axis=1))]
    rates = robot.survey.rates if moved else {}
    return frozenset((a, b) for a, b in moved if rates.get(link_pair(robot.link_of(a), robot.link_of(b))) == 0.0)
