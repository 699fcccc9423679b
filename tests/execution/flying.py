"""A ball that flies through the way of a robot, and executions beside it."""

import time

import numpy as np

import optiplan as op
from optiplan.collision.kept_models import collision_model

DT, PERIOD, BEGIN = 1e-3, 20, 0.1


def flying(run, place=0.75, speed=1.0, seed=0):
    """A ball that is at the tool when the robot is at a share of its path: position at time t, and velocity."""
    rng = np.random.default_rng(seed)
    tool = run.problem.robot.fk(run.trajectory(place * run.duration)).matrix[:3, 3]
    direction = rng.normal(size=3)
    velocity = speed * direction / np.linalg.norm(direction)
    return lambda t: tool + (t - place * run.duration) * velocity, velocity


def clearance(run, q, position):
    """Distance of the moving links from the ball, m, by coal."""
    scene = op.Scene([op.Sphere("ball", radius=0.06, position=tuple(position))])
    contacts = collision_model(run.problem.robot, scene).contacts(q, 10.0)
    return min(one.distance for one in contacts if "ball" in (one.pair.name_a, one.pair.name_b))


def executed(run, policy, ball, velocity, most=4.0, late=0.0, clearance_of=0.0):
    """Execute beside a ball that is seen from BEGIN on, every plan there `late` s after it was asked for.

    Returns the executor, the ticks, and the least distance from the ball, m.
    """
    executor, ticks, least = op.Executor(run, policy=policy, clearance=clearance_of), [], np.inf
    planning = executor._planning
    if planning is not None:
        answer = planning.answer
        planning.answer = lambda law, now: (
            answer(law, now) if planning._asked is not None and now >= planning._asked[0].since + late else None
        )
    while executor.time < most and executor.status.phase != "done":
        if executor.time >= BEGIN - 1e-9 and len(ticks) % PERIOD == 0:
            seen = op.Sphere("ball", radius=0.06, position=tuple(ball(executor.time)))
            executor.update_scene({"ball": seen}, {"ball": tuple(velocity)})
            while planning is not None and planning._asked is not None and not planning._done and not planning.lost:
                time.sleep(1e-3)
        ticks.append(executor.tick(DT))
        if executor.time > BEGIN and len(ticks) % 10 == 0:
            least = min(least, clearance(executor.run, ticks[-1].q, ball(executor.time)))
    if planning is not None:
        del planning.answer
    executor.close()
    return executor, ticks, least
