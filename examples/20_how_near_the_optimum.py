"""How much shorter could a motion be at best? A proved bound that counts the obstacles.

Run it: python examples/20_how_near_the_optimum.py
"""

import optiplan as op

problem = op.load_problem("12_planar")
run = op.plan(problem, budget=5.0)
bound = op.bound(problem, budget=2.0, motion=run)

print(f"the motion takes {run.duration:.3f} s")
print(bound.words(run.duration))
print(f"without obstacles the bound would be {bound.alone:.3f} s")
for seconds, proved in bound.history:
    print(f"  after {seconds:.2f} s: no motion is shorter than {proved:.3f} s")
