"""VAMP: its RRT-Connect and its simplifying, on its own balls in the place of the robot's links, vectorised.

Needs Python 3.12 and vamp-planner 0.6.4 (README.md says how it was built). Only the robots that it was compiled for;
their joints stand in VAMP's order and their base where VAMP has it. Answers with waypoints: it times nothing. Settings:
`robot`, panda by default; `sampler`, halton by default.
"""

import time

import numpy as np
import vamp
from common import answer, question, refuse


def environment(asked):
    """The obstacles; cylinders, which VAMP has not, as the boxes around them."""
    found = vamp.Environment()
    for body in asked["obstacles"]:
        ((kind, value),) = body["shape"].items()
        pose = np.array(body["pose"])
        place, turned = pose[:3, 3].tolist(), euler(pose[:3, :3])
        if kind == "box":
            found.add_cuboid(vamp.Cuboid(place, turned, [x / 2 for x in value]))
        elif kind == "sphere":
            found.add_sphere(vamp.Sphere(place, value))
        elif kind == "cylinder":
            found.add_cuboid(vamp.Cuboid(place, turned, [value["radius"], value["radius"], value["length"] / 2]))
        else:
            refuse(f"a body of kind {kind}")
    return found


def euler(R):
    """Angles (x, y, z) of R = Rz(z) Ry(y) Rx(x)."""
    return [
        float(np.arctan2(R[2, 1], R[2, 2])),
        float(-np.arcsin(np.clip(R[2, 0], -1, 1))),
        float(np.arctan2(R[1, 0], R[0, 0])),
    ]


def main():
    """Answer one question."""
    asked = question()
    name = asked["settings"].get("robot", "panda")
    robot, planner, settings, simple = vamp.configure_robot_and_planner_with_kwargs(name, "rrtc")
    scene = environment(asked)
    sampler = getattr(robot, asked["settings"].get("sampler", "halton"))()
    sampler.skip(asked["seed"])
    start = np.array(asked["start"])
    goals = [np.array(goal) for goal in asked["goals"]]
    if not robot.validate(start, scene):
        refuse("the start touches something, as balls")
    goals = [goal for goal in goals if robot.validate(goal, scene)]
    if not goals:
        refuse("every goal touches something, as balls")
    began = time.perf_counter()
    found = planner(start, goals, scene, settings, sampler)
    if not found.solved:
        refuse("no path within its iterations")
    path = robot.simplify(found.path, scene, simple, sampler).path
    seconds = time.perf_counter() - began
    points = np.array(path.numpy(), float)
    points[0] = start  # its path has single precision
    points[-1] = min(goals, key=lambda goal: np.abs(goal - points[-1]).max())
    return answer(waypoints=points.tolist(), seconds=seconds)


main()
