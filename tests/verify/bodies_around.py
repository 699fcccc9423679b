"""Problems of a robot among bodies at random places."""

import numpy as np

import optiplan as op


def among_bodies(name, count, seed):
    """A robot at its first configuration among random boxes, balls, cylinders and capsules that it does not touch."""
    rng, robot = np.random.default_rng(seed), op.load_robot(name)
    home = next(iter(robot.configurations))
    problem, bodies = op.Problem(robot, home, home), []
    while len(bodies) < count:
        place = {"position": rng.uniform([-0.7, -0.7, 0.0], [0.7, 0.7, 1.1]), "rpy": rng.uniform(-3.0, 3.0, 3)}
        body = (
            op.Box(f"body{len(bodies)}", size=rng.uniform(0.04, 0.2, 3), **place),
            op.Sphere(f"body{len(bodies)}", radius=rng.uniform(0.03, 0.1), position=place["position"]),
            op.Cylinder(f"body{len(bodies)}", radius=0.04, length=rng.uniform(0.05, 0.4), **place),
            op.Capsule(f"body{len(bodies)}", radius=0.04, length=rng.uniform(0.05, 0.4), **place),
        )[len(bodies) % 4]
        try:
            problem = problem.with_scene([*bodies, body])
        except op.InputError:
            continue
        bodies.append(body)
    return problem
