"""Time a path of your own within the robot's limits, and have the motion proved.

Without a deviation the path is kept and the motion stops at every corner. With one, corners are rounded within it and
the motion runs through. Then the verifier judges samples of a motion from elsewhere.

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

# The verifier also judges motions of other programs: as arrays, or as the path of a CSV (t, then a column a joint).
t = np.linspace(0, 1.2, 241)  # s
s = t / t[-1]
share = 10 * s**3 - 15 * s**4 + 6 * s**5
goal = problem.goal[0].q
for label, times in (("in 1.2 s", t), ("in 0.6 s", t / 2)):
    report = op.verify(problem, (times, problem.start + share[:, None] * (goal - problem.start)))
    refused = ", ".join(f"{check.name} of {check.place}" for check in report.failures)
    print(f"samples of a motion {label}:", "verified" if report.verified else f"refused for {refused}")
