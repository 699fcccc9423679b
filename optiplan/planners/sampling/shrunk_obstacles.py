"""A path between thinner obstacles: not free yet, but near a free one, where free ones are hard to find."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.geometry.scene import Box, Capsule, Cylinder, Scene, Shape, Sphere
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.local_searches import improved_path
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.ompl_space import Ends
from optiplan.planners.sampling.search import Search, Searcher
from optiplan.planners.sampling.shortcutting import shorten

_DEPTH = 0.02  # m; an optimiser moves a path out of obstacles that deep
_LEAST = 1e-3  # m: least thickness that remains
_ATTEMPTS, _LOCAL = 60, 12  # shortcuts and local searches


def thinned(scene: Scene, depth: float = _DEPTH) -> Scene:
    """Return the scene with every obstacle smaller by `depth`, m, on all sides; meshes and half-spaces stay."""
    obstacles = (replace(body, shape=_thinned(body.shape, depth)) for body in scene.obstacles)
    return replace(scene, obstacles=tuple(obstacles))


def among_thinner(model: CollisionModel, depth: float = _DEPTH) -> CollisionModel:
    """Return the planner's model of the same bodies between obstacles that are `thinned` by `depth`, m."""
    scene = thinned(model.scene, depth)
    return planning_model(model.robot, scene, model.with_obstacles_reshaped(scene), error=model.error)


def _thinned(shape: Shape, depth: float) -> Shape:
    def less(length: float, by: float) -> float:
        return max(length - by, min(length, _LEAST))

    match shape:
        case Box((x, y, z)):
            return replace(shape, size=(less(x, 2 * depth), less(y, 2 * depth), less(z, 2 * depth)))
        case Sphere(radius) | Capsule(radius, _):
            return replace(shape, radius=less(radius, depth))
        case Cylinder(radius, length):
            return replace(shape, radius=less(radius, depth), length=less(length, 2 * depth))
    return shape


def through_thinner(repair: Callable[[Array], Array | None]) -> Searcher:
    """Return a `Searcher` that finds a path between thinner obstacles and repairs it.

    A narrow place that is wider by a few centimetres is found soon. Source: Saha, Latombe, Chang and Prinz, "Finding
    narrow passages with probabilistic roadmaps: the small-step retraction method", Autonomous Robots 19, 2005.

    Args:
        repair: moves waypoints (k, n) out of the obstacles; None when it cannot. The result is proved here.
    """

    def search(check: MotionCheck, ends: Ends, budget: Budget, seed: int, *, patience: float) -> Search:
        thinner = check.among(among_thinner(check.model))
        if thinner.native is None:
            found = kpiece(thinner, ends, budget, seed, patience=patience)
        else:
            found = rrt_connect(thinner, ends, budget, seed, patience=patience / ALTERNATE_RATIO)
        if found.path is None:
            return found
        rng = np.random.default_rng(seed)
        shortened = shorten(thinner, found.path, check.limits.velocity, rng.uniform(size=(_ATTEMPTS, 3)), budget)
        improved = improved_path(thinner, shortened, rrt_connect, budget, rng, _LOCAL)
        cheaper = not np.array_equal(improved, shortened)
        for path in (improved, shortened) if cheaper else (shortened,):  # a cheaper one may be too deep in obstacles
            if check.polyline_free(path):
                return replace(found, path=path)
            repaired = repair(path)
            if repaired is not None and check.polyline_free(repaired):
                return replace(found, path=repaired)
        return replace(found, path=None, impatient=not budget.over)

    return search
