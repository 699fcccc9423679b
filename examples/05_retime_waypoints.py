"""Time a path of your own within the robot's limits, and have the motion proved.

With no deviation the path stays as it is and the motion stops at every corner; with one, corners are rounded within it
and the motion runs through.

Run it: python examples/05_retime_waypoints.py
"""

import numpy as np

import optiplan as op

problem = op.load_problem("01_reach")
waypoints = np.array([problem.start] * 4)  # (4, 7), rad
waypoints[1, 0] += 0.5
waypoints[2, :2] += [0.8, 0.3]
waypoints[3, :2] += [1.0, 0.1]

for deviation in (0.0, 0.02, 0.1):
    run = op.retime(problem, waypoints, deviation=deviation)
    print(f"deviation {deviation:.2f} rad: {run}")
    assert run.verified
