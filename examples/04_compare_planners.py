"""Give one problem to several planners and compare their motions.

All have the same goals and the same budget, and one verifier judges them all. A planner that finds nothing says why.

Run it: python examples/04_compare_planners.py [--view]
"""

import sys

import optiplan as op

problem = op.load_problem("03_table")
runs = [op.plan(problem, planner, budget=3) for planner in ("trajopt", "rrtconnect", "prm", "quintic")]

print(f"{'planner':12} {'duration':>9} {'planned in':>10} {'clearance':>10}  verdict")
for run in runs:
    if run.trajectory is None:
        print(f"{run.planner:12} {'–':>9} {run.timings['plan']:>8.2f} s {'–':>10}  {run.failure.detail}")
        continue
    clearance = f"{1e3 * run.metrics.clearance:.2f} mm"
    verdict = "verified" if run.verified else "not verified"
    print(f"{run.planner:12} {run.duration:>7.3f} s {run.timings['plan']:>8.2f} s {clearance:>10}  {verdict}")

if "--view" in sys.argv:
    op.view(*runs)  # all of them play side by side
