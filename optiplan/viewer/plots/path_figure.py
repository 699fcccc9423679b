"""The path of the tool in space and seen along the axes, with tool frames along it and outlines of the obstacles."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from optiplan.arrays import Array
from optiplan.figure_style import AXES, line_style, sheet
from optiplan.geometry.scene import Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.viewer.plots.runs import PlottedRun
from optiplan.viewer.surfaces import body_triangles

PLANES = ((0, 1), (0, 2), (1, 2))
NAMES = "xyz"
FRAME = 0.07
"""Length of a frame's axes, in shares of what is shown."""
ROOM = 0.12
"""Free room on either side of the paths, in shares of their largest extent."""
FLAT = 1e-9
"""m: thinner outlines are lines, which have no area to fill."""


def draw_path(runs: Sequence[PlottedRun], frames: int) -> Any:
    """The figure: a colour a run, `frames` tool frames along each path, evenly in time (x red, y green, z blue)."""
    figure = sheet(6.6)
    space = figure.add_subplot(2, 2, 1, projection="3d")
    planes = [figure.add_subplot(2, 2, place) for place in (2, 3, 4)]
    paths = [run.curves.X_WT[:, :3, 3] for run in runs]
    box = _box(np.concatenate(paths))
    size = FRAME * float(box[1, 0] - box[0, 0])
    for k, (run, path) in enumerate(zip(runs, paths, strict=True)):
        space.plot(*path.T, label=run.legend, **line_style(k))
        _draw_ends(space, path, line_style(k)["color"])
        X_WT = _frames(run, frames)
        _draw_frames(space, X_WT, size, (0, 1, 2))
        for panel, plane in zip(planes, PLANES, strict=True):
            panel.plot(*path[:, plane].T, label=run.legend, **line_style(k))
            _draw_ends(panel, path[:, plane], line_style(k)["color"])
            _draw_frames(panel, X_WT, size, plane)
    for panel, plane in zip(planes, PLANES, strict=True):
        _lay_out(panel, runs, plane, box)
    space.set(xlabel="x, m", ylabel="y, m", zlabel="z, m", xlim=box[:, 0], ylim=box[:, 1], zlim=box[:, 2])
    space.set_box_aspect((1.0, 1.0, 1.0))
    space.locator_params(nbins=4)
    robot = runs[0].problem.robot
    names = ", ".join(dict.fromkeys(run.problem.name for run in runs))
    figure.suptitle(f"{names}: path of {robot.tool_frame} of {robot.name}; ring: start, dot: end", fontsize=9)
    figure.legend(*space.get_legend_handles_labels(), loc="outside lower center", ncols=min(3, len(runs)))
    return figure


def _frames(run: PlottedRun, count: int) -> Array:
    """Tool frames (count, 4, 4) at even times, both ends included."""
    times = np.linspace(0.0, run.trajectory.duration, count)
    return ToolKinematics(run.problem.robot).evaluate(run.trajectory(times))[0]


def _draw_frames(panel: Any, X_WT: Array, size: float, axes: tuple[int, ...]) -> None:
    """Triads with axes of `size`, m, seen in these axes of the world."""
    for X in X_WT:
        for column, colour in enumerate(AXES):
            ends = np.stack([X[:3, 3], X[:3, 3] + size * X[:3, column]])[:, axes]
            panel.plot(*ends.T, color=colour, linewidth=1.0, solid_capstyle="round", gid="frame")


def _draw_ends(panel: Any, path: Array, colour: str) -> None:
    panel.plot(*path[:1].T, "o", color=colour, fillstyle="none", markersize=7)
    panel.plot(*path[-1:].T, "o", color=colour, markersize=5)


def _lay_out(panel: Any, runs: Sequence[PlottedRun], plane: tuple[int, int], box: Array) -> None:
    """Outlines of the obstacles of the first run's problem behind the paths, and equal scales."""
    for outline in outlines(runs[0].problem.scene, plane):
        panel.fill(*outline.T, facecolor="#8d98a033", edgecolor="#8d98a0", linewidth=0.7, zorder=0, gid="obstacle")
    a, b = plane
    panel.set(xlabel=f"{NAMES[a]}, m", ylabel=f"{NAMES[b]}, m", xlim=box[:, a], ylim=box[:, b])
    panel.set_aspect("equal")


def _box(points: Array) -> Array:
    """Lower and upper corner (2, 3), m, of what is shown: a cube about all points with some room."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = (0.5 + ROOM) * max(float((high - low).max()), 1e-3)
    return np.stack([0.5 * (low + high) - half, 0.5 * (low + high) + half])


def outlines(scene: Scene, plane: tuple[int, int]) -> Iterator[Array]:
    """Convex outlines (k, 2), m, of the obstacles in two coordinates of the world; half-spaces have none."""
    for obstacle in scene.obstacles:
        if obstacle.shape.endless:
            continue
        vertices = body_triangles(build_geometry(obstacle.shape)).vertices
        X_WO = obstacle.X_WO
        points = (vertices @ X_WO.rotation.T + X_WO.translation)[:, plane]
        if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] > FLAT:
            yield points[ConvexHull(points).vertices]
