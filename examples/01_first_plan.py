"""Plan the first example and print the verdict.

Run it: python examples/01_first_plan.py
"""

import optiplan as op

problem = op.load_problem("01_reach")
run = op.plan(problem, budget=5)
print(problem)
print(run)
assert run.verified
