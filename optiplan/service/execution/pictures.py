"""Small pictures for lists: the scene with its robot at the start, and the way of the tools through it."""

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.run_data.curves import tool_points
from optiplan.viewer.thumbnail import thumbnail

SIZE = (288, 180)
"""px."""
POINTS = 60
"""Of a path."""
PATH = "#1769aa"


def scene_picture(problem: Problem, trajectory: Trajectory | None = None) -> str:
    """An SVG of a problem and, if there is one, of a motion: each tool's path, with a dot where it ends."""
    paths: list[Array] = []
    if trajectory is not None and trajectory.joint_names == problem.robot.joint_names:
        Q = trajectory(np.linspace(0.0, trajectory.duration, POINTS))
        paths = list(tool_points(problem.robot, Q).values())
    picture = thumbnail(problem, size=SIZE, also=np.concatenate(paths) if paths else None)
    drawn = []
    for path in paths:
        at = picture.project(path)
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in at)
        drawn.append(f'<polyline points="{points}" fill="none" stroke="{PATH}" stroke-width="2.2"/>')
        drawn.append(f'<circle cx="{at[-1, 0]:.1f}" cy="{at[-1, 1]:.1f}" r="4" fill="{PATH}"/>')
    width, height = SIZE
    image = f'<image href="{picture.address}" width="{width}" height="{height}"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">{image}{"".join(drawn)}</svg>'
