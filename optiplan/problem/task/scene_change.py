"""How the steps of a task change the scene: what is held goes with its link, what is released stays where it is."""

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.problem.task.steps import Attach, ChangeTool, Detach, Event, TaskStep
from optiplan.robot.mounting import FixedFrame
from optiplan.robot.robot import Robot

Body = TypeVar("Body", Obstacle, Attachment)


def scene_after(scene: Scene, action: Event, robot: Robot, q: Array, t: float = 0.0) -> Scene:
    """Return the scene after an event at q (n,) and time t, s: X_LO = X_WL(q)^-1 X_WO, or X_WO = X_WL(q) X_LO.

    What moves is where it is at that time: X_WO = M(t) X with the pose X that it states. What is released onto it goes
    on from there with the same motion. A tool is on its link, or in its rack, as it states.

    Raises:
        ValueError: the object is not there to be taken, or is not held.
    """
    if isinstance(action, ChangeTool):
        scene = scene if action.leaves is None else action.leaves.off(scene)
        return scene if action.takes is None else action.takes.on(scene)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    if isinstance(action, Attach):
        body = _named(scene.obstacles, action.body)
        X_WL = data.oMf[robot.model.getFrameId(action.link, pin.FrameType.BODY)]
        X_WO = body.X_WO if body.motion is None else body.motion.pose(t) * body.X_WO
        held = held_body(body, action, X_WL.actInv(X_WO))
        return replace(
            scene,
            obstacles=tuple(one for one in scene.obstacles if one.name != body.name),
            attached=(*scene.attached, held),
        )
    held = _named(scene.attached, action.body)
    X_WL = data.oMf[robot.model.getFrameId(held.link, pin.FrameType.BODY)]
    X_WO, motion = X_WL * held.X_LO, None
    if isinstance(action, Detach) and action.mover is not None:
        motion = action.mover.motion
        X_WO = motion.pose(t).actInv(X_WO)
    return replace(
        scene,
        obstacles=(*scene.obstacles, Obstacle(held.name, held.shape, X_WO, None, motion)),
        attached=tuple(one for one in scene.attached if one.name != held.name),
    )


def held_body(body: Obstacle | Attachment, action: Attach, X_LO: pin.SE3) -> Attachment:
    """Return a body as it is held at X_LO in the frame of the link that takes it."""
    weight = action.mass, action.centre, action.inertia
    return Attachment(body.name, body.shape, action.link, X_LO, action.touch, None, *weight, action.framed)


def scene_during(scene: Scene, step: TaskStep) -> Scene:
    """Return the scene with the contacts allowed that a step allows."""
    return scene if step.allowed <= scene.allowed else replace(scene, allowed=scene.allowed | step.allowed)


def scene_at_start(scene: Scene, steps: Iterable[TaskStep]) -> Scene:
    """Return the scene with the contacts allowed that the first step of an arm, or of an alternative, allows."""
    first: dict[str, TaskStep] = {}
    for step in steps:
        before = first.get(step.arm)
        another = before and before.option and step.option and before.option[0] == step.option[0]
        if before is None or (another and before.option != step.option):
            first[step.arm] = step
            scene = scene_during(scene, step)
    return scene


def carrying(robot: Robot, scene: Scene) -> Robot:
    """Return the robot with the masses, and the frames, of what the scene says it holds, and no others."""
    payload = tuple((held.link, held.inertia_in_link()) for held in scene.attached if held.mass)
    own = tuple(one for one in robot.mounting.frames if not one.held)
    frames = own + tuple(FixedFrame(held.name, held.link, held.X_LO, True) for held in scene.attached if held.framed)
    if not payload and not robot.mounting.payload and len(frames) == len(own) == len(robot.mounting.frames):
        return robot
    return robot.mounted(replace(robot.mounting, payload=payload, frames=frames))


def columns(robot: Robot, joints: Iterable[str]) -> list[int]:
    """Return the places of joints in a configuration of the robot."""
    return [robot.joint_names.index(name) for name in joints]


def standing(robot: Robot, joints: Iterable[str], q: Array) -> Robot:
    """Return the robot with all joints but these standing still where they are in q (n,)."""
    moving = set(joints)
    held = {name: float(value) for name, value in zip(robot.joint_names, np.asarray(q), strict=True)}
    return robot.holding({name: value for name, value in held.items() if name not in moving})


def _named(bodies: Iterable[Body], name: str) -> Body:
    found = [body for body in bodies if body.name == name]
    if not found:
        raise ValueError(f"there is no '{name}'")
    return found[0]
