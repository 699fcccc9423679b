"""Collision models kept for the next question about the same robot in the same scene."""

import threading

import numpy as np

from optiplan.collision.bodies_and_pairs import same_standing_body
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot

_MOST = 2
"""Models kept of each kind: with obstacles that move, planners ask about those that stand still, too."""

_LARGE = 5000
"""Pairs above which a planner's model is not kept: it takes memory, and building it is little beside planning."""

_kept = threading.local()


def collision_model(robot: Robot, scene: Scene) -> CollisionModel:
    """The model of this robot in this scene, for this thread alone.

    Loading a problem, the proof of a motion and that of the next ask about the same. Where obstacles of the last scene
    have moved, what does not depend on their places is kept.
    """
    models: list[CollisionModel] = getattr(_kept, "models", [])
    found = next((model for model in models if _is_of(model, robot, scene)), None)
    if found is None:
        moved = (model.with_obstacles_moved(scene) for model in models if model.robot is robot)
        found = next((model for model in moved if model is not None), None) or CollisionModel(robot, scene)
        _kept.models = [found, *models][:_MOST]
    return found


def kept_planning_model(robot: Robot, scene: Scene) -> CollisionModel:
    """The `planning_model` of this robot in this scene, for this thread alone: one of the last asked for, or a new one.

    A start or goal that changes needs no other, and neither does the next planner. Its answers depend on no question
    asked before; what `place` and `distances_at` leave behind is for the caller's next line only.
    """
    from optiplan.collision.native_model import planning_model  # here: the verifier must not load the core

    models: list[CollisionModel] = getattr(_kept, "planning", [])
    found = next((model for model in models if _is_of(model, robot, scene)), None)
    if found is None:
        found = planning_model(robot, scene, collision_model(robot, scene))
        _kept.planning = [found, *models][:_MOST] if len(found.pairs) <= _LARGE else []
    return found


def _is_of(model: CollisionModel, robot: Robot, scene: Scene) -> bool:
    """Whether the model is of this very robot, in this scene or one of the same content."""
    return model.robot is robot and (model.scene is scene or _equal(model.scene, scene))


def _equal(a: Scene, b: Scene) -> bool:
    """Whether two scenes hold the same obstacles at the same places; scenes with attached objects: are the same."""
    if a.attached or b.attached or a.allowed != b.allowed or len(a.obstacles) != len(b.obstacles):
        return False
    return all(
        one is other
        or (same_standing_body(one, other) and np.array_equal(one.X_WO.homogeneous, other.X_WO.homogeneous))
        for one, other in zip(a.obstacles, b.obstacles, strict=True)
    )
