"""Collision models cached for the next query of the same robot in the same scene."""

import threading
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.bodies_and_pairs import same_scene, with_asked_checked
from optiplan.collision.model import CollisionModel
from optiplan.geometry.safety import Safety
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot

_MOST = 2
"""Models cached of each kind: with moving obstacles, planners also query the scene of the static ones."""

LARGE = 5000
"""Pairs above which a planner's model is not cached: it takes memory, and planning takes longer than building it."""

_kept = threading.local()


def collision_model(robot: Robot, scene: Scene) -> CollisionModel:
    """Return the model of this robot in this scene, for this thread alone.

    Loading a problem and proving its motions use the same model. If only obstacles have moved since the last scene, the
    model keeps all parts that do not depend on their places.
    """
    robot = with_asked_checked(scene.safety, robot)
    models: list[CollisionModel] = getattr(_kept, "models", [])
    found = next((model for model in models if _is_of(model, robot, scene)), None)
    if found is None:
        moved = (model.with_obstacles_moved(scene) for model in models if model.robot is robot)
        found = next((model for model in moved if model is not None), None) or CollisionModel(robot, scene)
        _kept.models = [found, *models][:_MOST]
    return found


def kept_planning_model(robot: Robot, scene: Scene, error: Array | None = None) -> CollisionModel:
    """Return the `planning_model` of this robot in this scene, for this thread alone: a recent one or a new one.

    Another start or goal, or another planner, needs no new model. Its results do not depend on earlier queries; the
    state after `place` and `distances_at` is valid only until the next query.
    """
    from optiplan.collision.native_model import planning_model  # here: the verifier must not load the core

    robot = with_asked_checked(scene.safety, robot)
    models: list[CollisionModel] = getattr(_kept, "planning", [])
    asked = error if error is not None and error.any() else None
    alike = [model for model in models if _is_of(model, robot, scene) and _same(model.error, asked)]
    found = next((model for model in alike if _same_safety(model.scene.safety, scene.safety)), None)
    if found is None:
        found = planning_model(robot, scene, collision_model(robot, scene), error=asked)
        _kept.planning = [found, *models][:_MOST] if len(found.pairs) <= LARGE else []
    return found


def touching_model(robot: Robot, scene: Scene) -> CollisionModel:
    """Return a model that says where bodies touch, of all pairs and whatever floors the scene has, for this thread.

    It asks the native core where that knows all shapes.
    """
    from optiplan.collision.native_model import planning_model  # here: the verifier must not load the core

    robot = with_asked_checked(scene.safety, robot)
    kept: list[tuple[Scene, CollisionModel]] = getattr(_kept, "touching", [])
    alike = ((known, model) for known, model in kept if model.robot is robot)
    found = next((model for known, model in alike if known is scene or same_scene(known, scene)), None)
    if found is None:
        bare = replace(scene, safety=None)
        found = planning_model(robot, bare, collision_model(robot, scene), passing=True)
        _kept.touching = [(scene, found), *kept][:_MOST]
    return found


def _same(one: Array | None, other: Array | None) -> bool:
    return np.array_equal(one, other) if one is not None and other is not None else one is other


def _same_safety(one: Safety | None, other: Safety | None) -> bool:
    return one is other or (one is not None and one.same_as(other))


def _is_of(model: CollisionModel, robot: Robot, scene: Scene) -> bool:
    """Return whether the model has this very robot, in this scene or one of the same content."""
    return model.robot is robot and (model.scene is scene or same_scene(model.scene, scene))
