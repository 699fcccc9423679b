"""State a problem in Python alone: a robot by name, two boxes and a floor, a pose of the tool as the goal.

Run it: python examples/02_problem_in_python.py [--view]
"""

import sys

import optiplan as op

scene = op.Scene(
    [
        op.Box("shelf", size=(0.8, 0.3, 0.02), position=(0.5, 0.35, 0.4)),
        op.Box("crate", size=(0.2, 0.2, 0.3), position=(0.55, -0.1, 0.15)),
        op.HalfSpace("floor", offset=-0.01),
    ]
)
problem = op.Problem(
    "panda",
    start="ready",
    goal=op.Pose(position=(0.5, 0.3, 0.6), rpy=(3.14, 0, 0)),
    scene=scene,
    name="beside-the-crate",
)
run = op.plan(problem, budget=5)
print(run)

velocities = run.trajectory([0.0, 0.1, 0.2], 1)  # (3, 7), rad/s: the first derivative at three times
print("velocities at 0.2 s:", velocities[2].round(3), "rad/s")
print("proved clearance:", f"{1e3 * run.metrics.clearance:.2f} mm")

if "--view" in sys.argv:
    op.view(run)  # serves the page until ctrl-C
