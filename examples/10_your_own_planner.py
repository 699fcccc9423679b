"""Write a planner of your own in thirty lines and compare it with the others, under the same verifier.

This one tries detours: straight from the start to a random configuration near the middle, and on to the goal.
`op.retime` times each and has it proved; the quickest that is verified is the answer.

Run it: python examples/10_your_own_planner.py
"""

import numpy as np

import optiplan as op


class Detours(op.Planner):
    """The quickest detour found within the budget."""

    def plan(self, problem, budget, progress):
        """Try until the budget is over."""
        random = np.random.default_rng(problem.seed)
        goal = problem.goal[0].q  # (n,), rad
        middle = (problem.start + goal) / 2
        best, tried = None, 0
        while not budget.over:
            progress("detours", 1.0 - budget.remaining / budget.seconds)
            tried += 1
            try:
                run = op.retime(problem, [problem.start, random.normal(middle, 0.5), goal])
            except op.InputError:  # outside the limits, or in collision
                continue
            if run.verified and (best is None or run.duration < best.duration):
                best = run
        if best is None:
            return op.PlanResult(failure=op.Failure("no-path", f"none of {tried} detours is free"))
        return op.PlanResult(best.trajectory, info={"tried": tried})


pillar = op.Cylinder("pillar", radius=0.05, length=1.2, position=(0.37, 0.25, 0.6))
problem = op.Problem("panda", start="ready", goal=[1.2, 0.3, 0.2, -1.6, 0.1, 2.0, 0.5], scene=[pillar], name="pillar")
for planner in (Detours(), "quintic", "rrtconnect", "trajopt"):
    run = op.plan(problem, planner, budget=3)
    print(f"{run.planner:11} {run}")
