"""Plan two arms as one robot of 14 joints, then a mobile base with its arm as one robot of nine.

Run it: python examples/09_many_joints.py
"""

import optiplan as op

baxter = op.load_problem("18_baxter_dual")
run = op.plan(baxter, budget=4)
print(run)
closest = next(check for check in run.report.checks if check.name == "collision")
print("  both arms against each other, themselves and the scene:", closest.detail)

whole = op.load_robot("delbot", group="all")  # mecanum base and arm
print(whole)
circle = op.Problem(whole, start="home", goal="home", name="large-circle")
run = op.plan(circle, "circle", {"radius": 0.5, "plane": "xy", "speed": 0.2})
print(run)
base = run.trajectory(run.duration / 2)[:2] - circle.start[:2]
print("  half way round the base has moved by", base.round(3), "m")
