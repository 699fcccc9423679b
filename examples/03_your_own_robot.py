"""Plan for a robot of your own, from nothing but its URDF.

The URDF does not state which pairs of links need no check: OptiPlan finds them. Nor does it have limits of acceleration
and jerk: they are given here. The robot's notes list every assumption.

Run it: python examples/03_your_own_robot.py
"""

from pathlib import Path

import optiplan as op

robot = op.Robot.from_urdf(
    Path(__file__).parent / "my_arm.urdf",
    tool_frame="tool0",
    limits={"acceleration": 8.0, "jerk": 80.0},  # rad/s², rad/s³
    configurations={"folded": [0.0, -1.8, 2.2]},
)
print(robot)
for note in robot.notes:
    print("  assumed:", note)

post = op.Cylinder("post", radius=0.05, length=0.9, position=(0.5, 0.0, 0.45))
problem = op.Problem(robot, start=[-0.9, -0.4, 0.6], goal=[0.7, -0.3, 0.5], scene=[post], name="around-the-post")
run = op.plan(problem, budget=5)
print(run)
assert run.verified
