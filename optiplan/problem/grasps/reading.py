"""Read the ends of an approach that are sets: grasps of an object, places in a region."""

from collections.abc import Collection

import numpy as np

from optiplan.arrays import Array
from optiplan.config.simple_yaml import Place
from optiplan.geometry.scene import Scene
from optiplan.problem.builder import Compiler
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.grasps.antipodal import graspable, grasps, gripper_in_frame, least_width
from optiplan.problem.grasps.places import unbounded
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.schema import AXES, RegionSpec
from optiplan.problem.schema.task import GraspsSpec
from optiplan.robot.robot import Robot

_ACROSS = 1e-6
"""Cosine below which two directions are square to each other."""


def grasp_ends(
    compiler: Compiler, robot: Robot, stated: tuple[Place, GraspsSpec, Array], scene: Scene, moved: Collection[str]
) -> tuple[PoseGoal, ...]:
    """Return the grasps of an object, poses of the gripper's frame in the world; none, and an issue, if it has none.

    Args:
        compiler: to whom errors go.
        robot: as it is in this step.
        stated: where the grasps are in the file, what the file has of them, the direction (3,) of the approach.
        scene: where the object is as the file puts it.
        moved: objects that the task has taken before this step.
    """
    place, spec, along = stated
    frame = compiler.frame(robot, place, spec.frame)
    body = next((one for one in scene.obstacles if one.name == spec.object), None)
    if body is None:
        compiler.unknown((*place, "object"), "object", spec.object, [one.name for one in scene.obstacles])
        return ()
    wrong = ""
    if body.name in moved:
        wrong, right = (
            f"'{body.name}', which moves before",
            "an object that is where the file puts it; else `any_of` poses",
        )
    elif not graspable(body.shape):
        wrong, right = f"'{body.name}', {type(body.shape).__name__.lower()}", "a box or a cylinder; else `any_of` poses"
    elif least_width(body.shape) > spec.opening:
        wrong, right = f"'{body.name}', {least_width(body.shape):g} m wide", f"at most the opening, {spec.opening:g} m"
    if wrong:
        compiler.report((*place, "object"), wrong, right)
        return ()
    closing = np.eye(3)[AXES.index(spec.closing)]
    if abs(float(closing @ along)) > _ACROSS:
        compiler.report((*place, "closing"), f"{spec.closing}, not square to `along`", "an axis square to `along`")
        return ()
    X_GF = gripper_in_frame(along, closing).inverse()
    found = grasps(body.shape, spec.opening, spec.depth, spec.turns)
    return () if frame is None else tuple(PoseGoal(frame, body.X_WO * X_OG * X_GF) for X_OG in found)


def ending_region(compiler: Compiler, robot: Robot, place: Place, spec: RegionSpec) -> RegionGoal | None:
    """Return a region in which a line may end; None, and an issue, where it has no bound along an axis."""
    region = compiler.region(robot, place, spec)
    if region is not None and (endless := unbounded(region)):
        compiler.report((*place, "along"), f"no bound {endless}", "a bound along each axis, m, where a line ends")
        return None
    return region
