"""Compute a tool pose and a clearance, then plan many problems side by side.

Run it: python examples/16_ask_and_plan_many.py
"""

import numpy as np

import optiplan as op


def main():
    """Compute poses and clearances, then plan."""
    problem = op.load_problem("02_shelf")
    robot = problem.robot

    named = dict(zip(robot.joint_names, problem.start, strict=True))  # a dictionary by joint works like a list
    print(f"the tool at the start: {np.round(robot.fk(named).position, 3)} m")
    twist = robot.jacobian(named) @ np.full(robot.n, 0.1)
    print(f"its velocity at 0.1 rad/s of every joint: {np.round(twist[:3], 3)} m/s")

    above = op.Pose((0.4, 0.25, 0.5), rpy=(np.pi, 0.0, 0.0))
    ends = op.ik(robot, above, all=True, scene=problem.scene)
    print(f"{len(ends)} free configurations there; the nearest keeps {1e3 * problem.clearance(ends[0]):.0f} mm")
    print(f"with straight joints: {problem.is_free(np.zeros(robot.n))}")

    problems = [problem.with_goal(end) for end in ends[:3]]
    for k, run in enumerate(op.plan_many(problems, budget=5.0, workers=2), 1):
        print(f"end {k}: {run}")


if __name__ == "__main__":  # the processes of plan_many import this file
    main()
