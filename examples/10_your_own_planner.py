"""Write a planner of your own in thirty lines and hold it against the others, before the same verifier.

This one tries detours: straight from the start to a random configuration near the middle, and on to the goal.
`op.retime` times each and has it proved; the quickest that is verified is the answer.

Run it: python examples/10_your_own_planner.py
"""

import time

import numpy as np

import optiplan as op


def detours(problem: op.Problem, seconds: float, seed: int = 0) -> tuple[op.Run | None, int]:
    """The quickest verified detour that is found within some seconds, or None, and how many were tried."""
    random = np.random.default_rng(seed)
    goal = problem.goal[0].q  # (n,), rad
    middle = (problem.start + goal) / 2
    best, tried, end = None, 0, time.perf_counter() + seconds
    while time.perf_counter() < end:
        tried += 1
        try:
            run = op.retime(problem, [problem.start, random.normal(middle, 0.5), goal])
        except op.InputError:  # outside the limits, or in collision
            continue
        if run.verified and (best is None or run.duration < best.duration):
            best = run
    return best, tried


pillar = op.Cylinder("pillar", radius=0.05, length=1.2, position=(0.37, 0.25, 0.6))
problem = op.Problem("panda", start="ready", goal=[1.2, 0.3, 0.2, -1.6, 0.1, 2.0, 0.5], scene=[pillar], name="pillar")
mine, tried = detours(problem, seconds=3)
print(f"{'detours':11} {mine} ({tried} tried)")
for planner in ("quintic", "rrtconnect", "trajopt"):
    print(f"{planner:11} {op.plan(problem, planner, budget=3)}")
