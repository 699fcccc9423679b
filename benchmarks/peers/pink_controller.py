"""pin-pink: its differential inverse kinematics as a controller, rolled out from the start to the goal.

Needs: pip install pin-pink==4.4.0 daqp. Task: its PostureTask at the goal configuration, the first; `pose` (0 by
default) is the cost of a FrameTask, for the pose of the model's last frame there, beside the posture's 1. Limits:
position, velocity, and acceleration while the quadratic program can keep it. Obstacles and self-collision: its
SelfCollisionBarrier over the `pairs` nearest pairs (10 by default; 0: no avoidance), `clearance` apart (0.002 m by
default). The motion is the commands' own, at their own pace.

A controller does not search: it stands still where barriers and tasks balance, and that is a failure here.
"""

import time

import numpy as np
import pinocchio as pin
from common import answer, question, refuse, rolled_out
from hulls import geometry
from pink import Configuration, solve_ik
from pink.barriers import SelfCollisionBarrier
from pink.exceptions import NoSolutionFound
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask

STEP = 0.01
"""s between two commands."""
RATE = 3.0
"""1/s: error and barrier decay so. Above acceleration / velocity limit (3.4 for the Panda) it could not brake."""
ARRIVED = 2e-4
"""rad: the last step goes from there to the goal, at 2 rad/s² and not more."""
PROGRESS = 1e-3
"""rad: the error, at its largest joint, must sink by that within `PATIENCE` steps, or the controller stands still."""
PATIENCE = 100
EVERY = 10
"""Steps between two waypoints, for `timing=ours`."""
SHARE = 0.8


def controller(asked, model, shapes, order):
    """The tasks and constraints, and the goal, of the first of the goals."""
    settings, goal = asked["settings"], pin.neutral(model)
    goal[order] = asked["goals"][0]
    model.lowerPositionLimit[order], model.upperPositionLimit[order] = asked["lower"], asked["upper"]
    model.velocityLimit[order] = asked["velocity"]
    acceleration = np.zeros(model.nv)
    acceleration[order] = asked["acceleration"]
    pose = float(settings.get("pose", 0.0))
    frame = FrameTask(model.frames[-1].name, pose, pose, gain=RATE * STEP)
    frame.set_target_from_configuration(Configuration(model, model.createData(), goal))
    posture = PostureTask(cost=1.0, gain=RATE * STEP)
    posture.set_target(goal)
    pairs = min(int(settings.get("pairs", 10)), len(shapes.collisionPairs))
    barrier = SelfCollisionBarrier(pairs, RATE, 0.0, float(settings.get("clearance", 0.002)))
    limits = [ConfigurationLimit(model), VelocityLimit(model), AccelerationLimit(model, acceleration)]
    return [frame, posture], limits, [barrier] if pairs else [], goal


def roll(asked, model, shapes, order):
    """Configurations (k, n) at each step, the goal last."""
    end = time.perf_counter() + SHARE * asked["budget"]
    tasks, limits, barriers, goal = controller(asked, model, shapes, order)
    q = pin.neutral(model)
    q[order] = asked["start"]
    near = {"collision_model": shapes, "collision_data": shapes.createData()} if barriers else {}
    state = Configuration(model, model.createData(), q, **near)
    steps, errors = [q[order]], [np.abs(q - goal).max()]
    while errors[-1] > ARRIVED:
        if time.perf_counter() > end:
            refuse("the controller has not arrived within the budget")
        speed = command(state, tasks, limits, barriers)
        if speed is None:
            refuse(f"after {len(steps) * STEP:.2f} s no command keeps apart what is near")
        limits[-1].set_last_integration(speed, STEP)
        state.update(pin.integrate(model, state.q, speed * STEP))
        steps.append(state.q[order])
        errors.append(np.abs(state.q - goal).max())
        if min(errors) > min(errors[:-PATIENCE], default=np.inf) - PROGRESS:
            refuse(f"the controller stands still after {len(steps) * STEP:.2f} s, {errors[-1]:.2g} rad off")
    return np.array([*steps, goal[order]])


def command(state, tasks, limits, barriers):
    """The next velocity. Limits of acceleration contradict the others at times: then without them."""
    for kept in (limits, limits[:-1]):
        try:
            return solve_ik(state, tasks, STEP, "daqp", limits=kept, barriers=barriers)
        except NoSolutionFound:
            continue
    return None


def main():
    """Answer one question."""
    asked = question()
    model, shapes = geometry(asked)
    order = [model.joints[model.getJointId(name)].idx_q for name in asked["joints"]]
    began = time.perf_counter()
    steps = roll(asked, model, shapes, order)
    if asked["settings"].get("timing") == "ours":
        points = np.concatenate([steps[:-1:EVERY], steps[-1:]])
        return answer(waypoints=points.tolist(), seconds=time.perf_counter() - began)
    return answer(samples=rolled_out(steps, STEP), seconds=time.perf_counter() - began)


main()
