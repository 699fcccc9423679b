"""Collision models kept for the next question about the same robot in the same scene."""

import threading

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot

_MOST = 2
_kept = threading.local()


def collision_model(robot: Robot, scene: Scene) -> CollisionModel:
    """The model of this robot in this scene, those very objects, for this thread alone.

    Loading a problem, the proof of a motion and that of the next ask about the same.
    """
    models: list[CollisionModel] = getattr(_kept, "models", [])
    found = next((model for model in models if model.robot is robot and model.scene is scene), None)
    if found is None:
        found = CollisionModel(robot, scene)
        _kept.models = [found, *models][:_MOST]
    return found
