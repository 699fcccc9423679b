"""Your own constraint: a CasADi expression of the robot's state, held and checked at samples.

Run it: python examples/13_your_own_constraint.py
"""

import optiplan as op

problem = op.Problem("panda", start="ready", goal=op.Pose((0.4, 0.4, 0.5), rpy=(3.141592653589793, 0, 0)))

# The tool points down, and the elbow stays low: `k` is the state of the robot at one instant.
level = op.Expression("level", lambda k: k.pose("tool").R[2, 2], upper=-0.999)
elbow = op.Expression("low elbow", lambda k: k.pose("panda_link4").p[2], upper=0.68)

run = op.plan(problem.with_constraints(level, elbow), budget=5.0)
print(run)
for check in run.report.checks:
    if check.name.endswith("constraint"):
        print(f"{check.name}: {check.worst:.4f}, limit {check.limit:g}; {check.detail}")
assert run.verified
