"""Replan while things change: a board moves, the goal moves, and the robot is already on its way.

Run it: python examples/12_replanning.py
"""

import time

import numpy as np

import optiplan as op

replanner = op.Replanner(op.load_problem("02_shelf"))


def planned(**change) -> tuple[op.Run, float]:
    """Plan with a change, and measure the seconds."""
    began = time.perf_counter()
    return replanner.plan(**change), time.perf_counter() - began


first, cold = planned()
print(f"the first plan: {first}")

raised, warm = planned(scene=replanner.problem.scene.moved("board", z=0.05))
print(f"the board 5 cm higher: {raised}; in {warm / cold:.0%} of the time")

pose = replanner.problem.goal[0].X_WG.homogeneous.copy()
pose[:3, 3] += [0.0, 0.03, 0.04]
nearby, warm = planned(goal=op.Pose.from_matrix(pose))
print(f"another goal: {nearby}; in {warm / cold:.0%} of the time")

# the robot follows that motion; after 0.2 s the board moves again, and a new motion continues from its state
state = nearby.trajectory.state(0.2)
on, warm = planned(start=state, scene=replanner.problem.scene.moved("board", z=-0.03))
step = max(np.abs(on.trajectory(0.0, order) - value).max() for order, value in enumerate((state.q, state.v, state.a)))
print(f"on the way: {on}; step of position, velocity and acceleration: {step:.0e}")
