"""The page of workspaces: reached voxels of one or more robots in three dimensions, with the robots among them."""

import html
from collections.abc import Sequence
from itertools import pairwise
from string import Template
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.mimic_joints import coupling, screws
from optiplan.robot.robot import Robot
from optiplan.viewer.assets import asset
from optiplan.viewer.page import framed
from optiplan.viewer.scene import robot_parts
from optiplan.viewer.surfaces import base64_of
from optiplan.viewer.workspaces.values import LABELS, caption, mapped_values
from optiplan.workspace.reach import sampling_range
from optiplan.workspace.sampling import Workspace

SCRIPTS = ("packed.js", "scene/shapes.js", "scene/stage.js", "scene/camera.js", "scene/bodies.js", "workspace.js")
APART = 2.3
"""Distance of two robots that stand side by side, in units of the mean of their reaches."""


def render_workspaces(found: Sequence[Workspace]) -> str:
    """One page that shows all robots side by side, true to scale; nothing is loaded from elsewhere.

    A voxel that is pointed at tells its numbers, and the robot stands as it does in the most dexterous sample there.
    """
    names = ", ".join(one.robot.name for one in found)
    data = {
        "labels": LABELS,
        "robots": [_robot(one, offset) for one, offset in zip(found, _offsets(found), strict=True)],
    }
    title = f"Workspace of {names}"
    body = Template(asset("workspace.html")).substitute(title=html.escape(title))
    return framed(body, title, data, ("theme.css", "workspace.css"), SCRIPTS)


def best_samples(one: Workspace) -> Array:
    """Configurations (V, n) of the most dexterous free sample in each voxel; NaN where nothing was reached."""
    voxels, samples, size = one.voxels, one.samples, one.options.voxels
    free = np.flatnonzero(samples.free)
    cells = _cells(samples.position[free], one.reach.shoulder, voxels.edge, size)
    wanted = _cells(voxels.centres, one.reach.shoulder, voxels.edge, size)
    order = np.argsort(samples.values["yoshikawa"][free], kind="stable")  # the best is written last
    best = np.full((2 * size) ** 3, -1)
    best[cells[order]] = free[order]
    chosen = best[wanted]
    return np.where((chosen >= 0)[:, None], samples.q[chosen], np.nan)


def _cells(points: Array, shoulder: Array, edge: float, size: int) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Number of the cell of the cube around the reach sphere that each of points (k, 3) lies in."""
    cell = np.clip(np.floor((points - shoulder) / edge).astype(np.intp) + size, 0, 2 * size - 1)
    return np.asarray(np.ravel_multi_index(tuple(cell.T), (2 * size,) * 3))


def _offsets(found: Sequence[Workspace]) -> list[float]:
    """Where the robots' worlds stand along x, m."""
    offsets = [0.0]
    for before, after in pairwise(found):
        offsets.append(offsets[-1] + APART * 0.5 * (before.reach.largest + after.reach.largest))
    return offsets


def _robot(one: Workspace, offset: float) -> dict[str, Any]:
    robot, voxels = one.robot, one.voxels
    geometries, parts = robot_parts(robot)
    Q = best_samples(one)
    known = np.isfinite(Q).all(axis=1)
    return {
        "name": robot.name,
        "tool": robot.tool_frame,
        "caption": caption(one),
        "offset": offset,
        "shoulder": one.reach.shoulder.tolist(),
        "radius": one.reach.largest,
        "edge": voxels.edge,
        "points": base64_of(voxels.centres),
        "counts": base64_of(voxels.counts),
        "values": {name: base64_of(value) for name, value in mapped_values(one).items()},
        "geometries": geometries,
        "parts": parts,
        "tree": _tree(robot),
        "joints": list(robot.joint_names),
        "usual": _usual(robot).tolist(),
        "rows": base64_of(np.where(known, np.cumsum(known) - 1, -1)),
        "q": base64_of(Q[known]),
    }


def _usual(robot: Robot) -> Array:
    """The configuration that the robot is shown in at first: `ready`, its first named one, or the middle."""
    if robot.configurations:
        name = "ready" if "ready" in robot.configurations else next(iter(robot.configurations))
        return robot.configurations[name]
    lower, upper = sampling_range(robot)
    return np.asarray(np.clip(np.zeros(robot.n), lower, upper))


def _tree(robot: Robot) -> dict[str, Any]:
    """What poses the page's bodies: X_WJ = X_WP X_PJ exp([S] p_j), with the positions p = A q + b of all J joints.

    `parents` (J,) with 0 the world, `placements` X_PJ (J, 7), m and quaternion xyzw, `screws` S (J, 6) linear first,
    `coupling` A (J, n), `offset` b (J,).
    """
    model = robot.model
    A, b = coupling(model)
    return {
        "parents": [int(parent) for parent in list(model.parents)[1:]],
        "placements": [pin.SE3ToXYZQUAT(X).tolist() for X in list(model.jointPlacements)[1:]],
        "screws": screws(model).tolist(),
        "coupling": A.tolist(),
        "offset": b.tolist(),
    }
