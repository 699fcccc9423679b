"""Read a path of the tool, checked: its points, its curve, and that its events and its speed go with them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue
from optiplan.geometry.pose import pose_of
from optiplan.problem.builder import Compiler
from optiplan.problem.schema.seam import POINT_COLUMNS, SeamPointSpec, SeamSpec
from optiplan.problem.seams.actions import PathEvent, SeamPath
from optiplan.problem.seams.building import OPPOSITE, SeamShape
from optiplan.problem.seams.coverage import CoverSpec, cover
from optiplan.problem.task.csv_rows import LocatedRow, RowsOf, read_rows
from optiplan.robot.robot import Robot

_SAME = 1e-6
"""m: points that are nearer are one."""

_ROWS = RowsOf(SeamPointSpec, POINT_COLUMNS, "points", least=2)
_STRAIGHT = 1e-3
"""Sine below which an axis along the path leaves no side to weave or tilt to."""


def read_points(file: Path) -> list[LocatedRow[SeamPointSpec]]:
    """Return the points of a CSV file, one a row, whose first row names the columns (`POINT_COLUMNS`).

    Raises:
        InputError: it cannot be read, or its rows are no points; with line and column.
    """
    return read_rows(file, _ROWS)


def with_points(path: dict[str, Any], base: Path) -> dict[str, Any]:
    """Return a `path` of a problem file with its points as a list; files are relative to `base`.

    Points of a CSV file, or those that cover a patch.

    Raises:
        InputError: as `read_points`.
    """
    if "cover" in path:
        found = covering(CoverSpec.model_validate(path["cover"]), base)
        path = {key: value for key, value in path.items() if key != "cover"} | {"curve": "spline"}
    elif isinstance(path["points"], str):
        found = [one.row for one in read_points(base / path["points"])]
    else:
        return path
    return {**path, "points": [one.model_dump(mode="json", exclude_none=True) for one in found]}


def covering(spec: CoverSpec, base: Path) -> list[SeamPointSpec]:
    """Return the points that cover a patch.

    Raises:
        ValueError: as `cover`.
    """
    points, inward = (np.round(values, 9).tolist() for values in cover(spec, base))
    return [SeamPointSpec(position=tuple(p), axis=tuple(n)) for p, n in zip(points, inward, strict=True)]


def read_path(
    compiler: Compiler, robot: Robot, place: Place, spec: SeamSpec, joints: tuple[str, ...]
) -> SeamPath | None:
    """Return a path of these joints; None where there are issues, which go to the compiler."""
    count = len(compiler.issues)
    frame = compiler.frame(robot, place, spec.frame)
    reader = _SeamReader(compiler, place, spec)
    points = reader.points()
    shape = reader.shape(points) if points else None
    if frame is None or shape is None or len(compiler.issues) > count:
        return None
    try:
        curve = shape.curve()
    except ValueError as error:
        reader.report(0, "points", f"points of no curve: {error}", "other points")
        return None
    if curve.corners and not spec.ramp:
        found = f"{len(curve.corners)} exact corners, the first {curve.corners[0]:.4g} m along the path"
        expected = "`blend: …`, m, which rounds them, or `ramp: …`, m, within which the tool stops there"
        compiler.report(place, found, expected)
        return None
    if curve.corners and (spec.lead or spec.side):
        compiler.report(place, "lead or side with exact corners, where they would jump", "`blend: …`, m")
        return None
    stops = np.array([0.0, *curve.corners, curve.length])
    events = tuple(PathEvent(_snapped(one.path, stops), one.do) for one in sorted(spec.at, key=lambda one: one.path))
    for k, one in enumerate(spec.at):
        if one.path > curve.length + _SAME:
            found = f"{one.path:g} m, beyond the end"
            compiler.report((*place, "at", k, "path"), found, f"at most {curve.length:.6g} m, the length of the path")
    tolerance = spec.tolerance
    limits = tolerance.position, tolerance.orientation
    whole = SeamPath(joints, frame, curve, spec.speed, spec.speed_within, spec.ramp, spec.cone or 0.0, *limits, events)
    return whole if len(compiler.issues) == count else None


def _snapped(at: float, stops: Array) -> float:
    """Return the end or corner, m, that a length is at but for rounding; else the length itself."""
    nearest = float(stops[np.abs(stops - at).argmin()])
    return nearest if abs(nearest - at) <= _SAME else at


class _SeamReader:
    """Reports issues of points where they stand: in the problem file, or in a CSV file."""

    def __init__(self, compiler: Compiler, place: Place, spec: SeamSpec) -> None:
        self.compiler, self.place, self.spec = compiler, place, spec
        self.file = str(compiler.base / spec.points) if isinstance(spec.points, str) else None
        self._lines: list[int] = []

    def report(self, k: int, key: str, found: str, expected: str) -> None:
        """Record an issue of point k."""
        if self.file is None:
            self.compiler.report((*self.place, "points", k, key), found, expected)
        else:
            self.compiler.issues.append(Issue(self.file, self._lines[k], key, found, expected))

    def points(self) -> Sequence[SeamPointSpec]:
        """Return the points, different from one to the next; none where they cannot be read."""
        found: Sequence[SeamPointSpec]
        if self.spec.cover is not None:
            try:
                return covering(self.spec.cover, self.compiler.base)
            except ValueError as error:
                self.compiler.report((*self.place, "cover"), str(error), "a patch of a mesh that can be covered so")
                return []
        if self.file is None:
            found = [one for one in self.spec.points or () if isinstance(one, SeamPointSpec)]
        else:
            try:
                rows = read_points(Path(self.file))
            except InputError as error:
                self.compiler.issues.extend(error.issues)
                return []
            found, self._lines = [one.row for one in rows], [one.line for one in rows]
        p = np.array([one.position for one in found], float)
        for k in np.flatnonzero(np.linalg.norm(np.diff(p, axis=0), axis=1) < _SAME).tolist():
            self.report(k + 1, "position", f"the place of point {k + 1}", "a place of its own")
        return found

    def shape(self, points: Sequence[SeamPointSpec]) -> SeamShape | None:
        """Return what the curve is made of, if all points have an axis."""
        spec, count = self.spec, len(self.compiler.issues)
        axes = np.array([self._axis(k, one) for k, one in enumerate(points)])
        turned = [one.rpy is not None or one.quaternion is not None for one in points]
        given = any(turned) and spec.free_axis is None
        for k in np.flatnonzero(~np.array(turned)).tolist() if given else ():
            self.report(k, "position", "no rotation, which other points have", "a rotation, or `free_axis: z`")
        cosines = (axes[1:] * axes[:-1]).sum(axis=1)
        for k in np.flatnonzero(cosines < OPPOSITE).tolist():
            self.report(k + 1, "axis", "an axis nearly opposite to the one before", "points between the two")
        headings = np.array([pose_of(one).rotation[:, 0] for one in points]) if given else None
        p = np.array([one.position for one in points], float)
        if spec.lead or spec.side or spec.weave is not None:
            along = np.diff(p, axis=0)
            along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _SAME)
            sines = np.linalg.norm(np.cross(along, axes[:-1]), axis=1)
            for k in np.flatnonzero(sines < _STRAIGHT).tolist():
                self.report(k, "axis", "an axis along the path", "one across it, which lead, side or weave need")
        if len(self.compiler.issues) > count:
            return None
        through = {k: np.array(one.through, float) for k, one in enumerate(points) if one.through is not None}
        if 0 in through or (through and spec.curve == "spline"):
            self.report(min(through), "through", "an arc to this point", "a point after the first, with `curve: line`")
            return None
        weave = None if spec.weave is None else (spec.weave.amplitude, spec.weave.length)
        smooth = spec.curve == "spline" or spec.cover is not None
        return SeamShape(p, through, smooth, spec.blend or 0.0, axes, headings, spec.lead, spec.side, weave)

    def _axis(self, k: int, point: SeamPointSpec) -> Array:
        if point.rpy is not None or point.quaternion is not None:
            return np.asarray(pose_of(point).rotation[:, 2])
        said = self.spec.axis if point.axis is None else point.axis
        if said is None:
            self.report(k, "axis", "nothing", "an axis of this point or of the path, or a rotation")
            return np.array([0.0, 0.0, -1.0])
        axis = np.array(said, float)
        return axis / float(np.linalg.norm(axis))
