"""Move an obstacle and plan again, starting from the motion found before.

The old motion is verified on the new problem first. If it holds, the answer is at least as good; if
not, `info["warm_start"]` says "refused" and the new motion stands alone.

Run it: python examples/07_move_an_obstacle.py
"""

import optiplan as op

goal = [1.2, 0.3, 0.2, -1.6, 0.1, 2.0, 0.5]  # rad
pillar = op.Cylinder("pillar", radius=0.05, length=1.2, position=(0.45, 0.25, 0.6))
floor = op.HalfSpace("floor", offset=-0.01)
problem = op.Problem("panda", start="ready", goal=goal, scene=[pillar, floor], name="pillar")

before = op.plan(problem, budget=3)
print("before:         ", before)

for distance in (0.3, -0.1):  # m along x: out of the way, then into it
    moved = problem.with_scene(problem.scene.moved("pillar", x=distance))
    again = op.plan(moved, budget=3, warm_start=before)
    print(f"moved by {distance:+.2f} m:", again, f"(the old motion: {again.info['warm_start']})")
    assert again.verified
