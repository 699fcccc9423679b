"""Read reports: every check of a good motion, the fault of a bad one, and the reason of a planner that gave up.

Run it: python examples/06_read_a_report.py
"""

import optiplan as op

problem = op.load_problem("02_shelf")
good = op.plan(problem, "rrtconnect", budget=5)
print(good)
for check in good.report.checks:
    worst = "" if check.worst is None else f"{check.worst:.4g} of {check.limit:.4g} {check.unit} {check.place}"
    print(f"  {check.name:14} {check.kind:10} {worst}".rstrip())

print("\nThe same motion, a fifth quicker than its limits allow:")
report = op.verify(problem, good.trajectory.scaled(0.8 * good.duration))
assert not report.verified
for check in report.failures:
    print(f"  {check.name}: {check.worst:.4g} where {check.limit:.4g} {check.unit} is the limit, {check.place}")
    print(f"    at {check.time:.3f} s")

print("\nStraight through the shelf:")
failure = op.plan(problem, "quintic").failure
print(f"  {failure.kind}: {failure.detail}")
first, second = failure.witness["pair"]
print(f"  {first} and {second} meet near {[round(x, 3) for x in failure.witness['points'][0]]} m")
