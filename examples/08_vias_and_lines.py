"""Pass points without stopping, and lead the tool along a straight line.

Run it: python examples/08_vias_and_lines.py
"""

import numpy as np
import pinocchio as pin

import optiplan as op

table = op.Box("table", size=(0.9, 1.4, 0.04), position=(0.65, 0, -0.02))
down = (3.14159, 0, 0)
problem = op.Problem(
    "panda",
    start="ready",
    goal=[-1.2, 0.2, 0.1, -1.9, 0.1, 2.0, 0.6],
    vias=[
        op.ViaPoint(op.Pose((0.45, 0.3, 0.55), rpy=down), tolerance=1e-3),
        op.ViaPoint([0.2, 0.1, -0.1, -1.9, 0.1, 2.0, 0.9]),
    ],
    scene=[table],
    name="past-two-points",
)
run = op.plan(problem, "spline", {"degree": 5})
print(run)

problem = op.load_problem("25_line")  # a UR5
run = op.plan(problem, "line", {"speed": 0.25, "acceleration": 1.0})  # m/s, m/s²
print(run)

robot, data = problem.robot, problem.robot.model.createData()
points = []  # of the tool, m
for q in run.trajectory(np.linspace(0, run.duration, 201)):
    pin.framesForwardKinematics(robot.model, data, q)
    points.append(data.oMf[robot.model.getFrameId(robot.tool_frame)].translation.copy())
way = points[-1] - points[0]
off = np.cross(np.array(points) - points[0], way / np.linalg.norm(way))
print(f"the tool moves {np.linalg.norm(way):.3f} m, at most {np.linalg.norm(off, axis=1).max():.1e} m off the line")
