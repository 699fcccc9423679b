"""OMPL as MoveIt sets it up: RRT-Connect, edges checked at a fixed resolution, simplified, then TOPP-RA along a spline.

Needs: pip install ompl==2.0.1 'pin>=4.1' coal toppra. Setting `resolution`: share of the joint space's extent, 0.005 by
default as MoveIt's `longest_valid_segment_fraction`.
"""

import time

import numpy as np
import pinocchio as pin
import toppra
from common import answer, question, refuse
from hulls import geometry
from ompl import base as ob
from ompl import geometric as og
from ompl import util

GRID = 200


def path(asked):
    """Waypoints (k, n), or None."""
    model, shapes = geometry(asked)
    data, shape_data = model.createData(), shapes.createData()
    n = len(asked["joints"])
    order = [model.joints[model.getJointId(name)].idx_q for name in asked["joints"]]
    q = np.zeros(model.nq)

    def free(state):
        for k in range(n):
            q[order[k]] = state[k]
        return not pin.computeCollisions(model, data, shapes, shape_data, q, True)

    space = ob.RealVectorStateSpace(n)
    bounds = ob.RealVectorBounds(n)
    for k in range(n):
        bounds.setLow(k, asked["lower"][k])
        bounds.setHigh(k, asked["upper"][k])
    space.setBounds(bounds)
    space.setLongestValidSegmentFraction(float(asked["settings"].get("resolution", 0.005)))
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(free)
    start = space.allocState()
    goals = ob.GoalStates(setup.getSpaceInformation())
    for k in range(n):
        start[k] = asked["start"][k]
    for values in asked["goals"]:
        goal = space.allocState()
        for k in range(n):
            goal[k] = values[k]
        goals.addState(goal)
    setup.setStartState(start)
    setup.setGoal(goals)
    setup.setPlanner(og.RRTConnect(setup.getSpaceInformation()))
    if not setup.solve(0.8 * asked["budget"]) or not setup.haveExactSolutionPath():
        return None
    setup.simplifySolution()
    states = setup.getSolutionPath().getStates()
    return np.array([[state[k] for k in range(n)] for state in states])


def timed(points, asked):
    """TOPP-RA along the cubic spline through the points: q(s(t)), exactly, as pieces of degree 6."""
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    spline = toppra.SplineInterpolator(knots, points)
    limit = [np.array(asked[name]) for name in ("velocity", "acceleration")]
    bounds = [
        toppra.constraint.JointVelocityConstraint(limit[0]),
        toppra.constraint.JointAccelerationConstraint(limit[1]),
    ]
    grid = np.unique(np.concatenate([np.linspace(0, knots[-1], GRID), knots]))
    found = toppra.algorithm.TOPPRA(bounds, spline, gridpoints=grid).compute_parameterization(0.0, 0.0)
    speed = found[1] if found[1] is not None else refuse("TOPP-RA finds no timing")
    steps = 2 * np.diff(grid) / (speed[1:] + speed[:-1])
    rate = (speed[1:] ** 2 - speed[:-1] ** 2) / (2 * np.diff(grid))
    u = np.linspace(0, 1, 7)
    coefficients = []
    for s, v, a, h in zip(grid, speed, rate, steps, strict=False):
        tau = u * h
        values = spline(np.clip(s + v * tau + a * tau**2 / 2, 0, knots[-1]))
        coefficients.append(np.linalg.solve(np.vander(u, increasing=True), values) / h ** np.arange(7)[:, None])
    return {
        "breakpoints": np.concatenate([[0.0], np.cumsum(steps)]).tolist(),
        "coefficients": np.array(coefficients).tolist(),
    }


def main():
    """Answer one question."""
    asked = question()
    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(asked["seed"] + 1)
    began = time.perf_counter()
    points = path(asked)
    if points is None:
        refuse("RRT-Connect finds no path within the budget")
    if asked["settings"].get("timing", "toppra") == "ours":
        return answer(waypoints=points.tolist(), seconds=time.perf_counter() - began)
    return answer(pieces=timed(points, asked), seconds=time.perf_counter() - began)


main()
