"""A task of several steps: take a cube, put it elsewhere, in one proved motion with gripper events.

Run it: python examples/14_pick_and_place.py
"""

import optiplan as op

down = (3.14159265, 0, 0)
fingers = ["panda_leftfinger", "panda_rightfinger"]
scene = op.Scene(
    [
        op.Box("table", size=(0.8, 1.2, 0.04), position=(0.55, 0, -0.02)),
        op.Box("cube", size=(0.05, 0.05, 0.05), position=(0.5, 0.2, 0.026)),
    ]
)
task = (
    op.Task()
    .approach(op.Pose((0.5, 0.2, 0.03), rpy=down), distance=0.1)
    .attach("cube", link="panda_hand", touch=fingers, mass=0.1)
    .gripper("hand", [0.025], name="close")
    .retreat(0.1)
    .approach(op.Pose((0.5, -0.2, 0.031), rpy=down), distance=0.1)
    .gripper("hand", [0.04], name="open")
    .detach("cube")
    .retreat(0.1)
    .move("ready")
)
run = op.plan(op.Problem("panda", start="ready", task=task, scene=scene), budget=60.0)

print(run)
for segment in run.trajectory.segments:
    print(f"{segment.begin:6.3f} s  step {segment.step}: {segment.name}")
