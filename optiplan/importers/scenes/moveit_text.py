"""MoveIt's `.scene` files, which RViz exports and `PlanningScene::loadGeometryFromStream` reads.

    NAME
    * ID                       one object, in the newer form with its pose and its number of subframes
    x y z / qx qy qz qw
    COUNT                      of shapes: kind, sizes, position, quaternion, colour each
    ...
    SUBFRAMES
    .

Source: `moveit_core/planning_scene/src/planning_scene.cpp`, `geometric_shapes::saveAsText`.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.errors import InputError, Issue
from optiplan.files import read_bytes
from optiplan.importers.scenes.imported import ImportedScene

END, OBJECT = ".", "*"


def read_moveit_scene(path: Path) -> ImportedScene:
    """Read a `.scene` file.

    Raises:
        InputError: a file that is cut off, a shape that is not known or has no size, or no number where one is meant;
            with its line.
    """
    lines = _Lines(path)
    scene = ImportedScene(path)
    lines.take("the name of the scene")
    while (line := lines.take("`* ID` of an object, or the closing `.`")) != END:
        if not line.startswith(OBJECT):
            raise lines.issue(repr(line), "`* ID` of an object, or the closing `.`")
        _object(lines, line.removeprefix(OBJECT).strip() or "object", scene)
    return scene


def _object(lines: "_Lines", name: str, scene: ImportedScene) -> None:
    newer = len(lines.peek().split()) == 3
    X_WO = lines.pose() if newer else pin.SE3.Identity()
    for _ in range(lines.whole("the number of shapes")):
        kind = lines.take("a kind of shape").lower()
        _shape(lines, kind, name, X_WO, scene)
    if newer:
        subframes = lines.whole("the number of subframes")
        for _ in range(subframes):
            lines.take("the name of a subframe")
            lines.pose()
        if subframes:
            scene.notes.append(f"left out: {subframes} subframes of {name}")


def _shape(lines: "_Lines", kind: str, name: str, X_WO: pin.SE3, scene: ImportedScene) -> None:
    if kind == "mesh":
        vertices, triangles = lines.wholes(2, "numbers of vertices and triangles")
        points = np.array([lines.numbers(3, "a vertex") for _ in range(vertices)]).reshape(-1, 3)
        faces = np.array([lines.wholes(3, "a triangle") for _ in range(triangles)], int).reshape(-1, 3)
        if not len(faces) or faces.max() >= len(points):
            raise lines.issue(f"a mesh of {name} with {len(faces)} triangles of {len(points)} vertices", "a whole mesh")
    elif kind in _SIZES:
        size = _sizes(lines, kind, name)
    else:
        raise lines.issue(f"the shape '{kind}'", f"one of: {', '.join([*_SIZES, 'mesh'])}")
    X_WS = X_WO * lines.pose()
    lines.numbers(4, "a colour")
    if kind == "mesh":
        scene.add(name, scene.mesh(name, points, faces), X_WS)
    elif kind == "box":
        scene.add(name, {"box": list(size)}, X_WS)
    elif kind == "sphere":
        scene.add(name, {"sphere": size[0]}, X_WS)
    elif kind == "plane":
        a, b, c, d = size
        length = float(np.linalg.norm([a, b, c]))
        X_SP = pin.SE3(np.eye(3), np.array([a, b, c]) * (-d / length**2))
        scene.add_half_space(name, X_WS * X_SP, (a, b, c))
        scene.notes.append(f"plane {name} became a half-space that is solid against its normal")
    else:
        if kind == "cone":
            scene.notes.append(f"cone {name} became the cylinder around it")
        scene.add(name, {"cylinder": {"radius": size[0], "length": size[1]}}, X_WS)


def _sizes(lines: "_Lines", kind: str, name: str) -> Sequence[float]:
    size = lines.numbers(_SIZES[kind], f"the sizes of a {kind}")
    found = f"{' '.join(f'{x:g}' for x in size)} of {name}"
    if kind == "plane" and np.dot(size[:3], size[:3]) == 0.0:
        raise lines.issue(f"the plane {found}", "a normal that is not 0 0 0")
    if kind != "plane" and min(size) <= 0.0:
        raise lines.issue(f"the sizes {found}, a {kind}", "numbers > 0, m")
    return size


_SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}


class _Lines:
    """The lines of a file, one after the other."""

    def __init__(self, path: Path) -> None:
        try:
            text = read_bytes(path).decode("utf-8", errors="replace")
        except OSError as error:
            found = error.strerror or str(error)
            raise InputError([Issue(str(path), None, "scene", found, "a readable .scene file")]) from error
        self._path = path
        self._lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
        self._at = 0

    def peek(self) -> str:
        """The next line; empty at the end."""
        return self._lines[self._at][1] if self._at < len(self._lines) else ""

    def take(self, expected: str) -> str:
        """The next line, which is then behind."""
        if self._at == len(self._lines):
            raise self.issue("the end of the file", expected)
        self._at += 1
        return self._lines[self._at - 1][1]

    def numbers(self, count: int, expected: str) -> Sequence[float]:
        """The numbers of the next line."""
        words = self.take(expected).split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != count or not np.isfinite(values).all():
            raise self.issue(f"'{' '.join(words)}'", f"{expected}: {count} numbers")
        return values

    def wholes(self, count: int, expected: str) -> Sequence[int]:
        """The whole numbers of the next line."""
        values = self.numbers(count, expected)
        if any(value != int(value) or value < 0 for value in values):
            found = " ".join(f"{value:g}" for value in values)
            raise self.issue(found, f"{expected}: {'a whole number' if count == 1 else 'whole numbers'}")
        return [int(value) for value in values]

    def whole(self, expected: str) -> int:
        """The whole number of the next line."""
        return self.wholes(1, expected)[0]

    def pose(self) -> pin.SE3:
        """A line x y z and a line with the quaternion x y z w."""
        position, quaternion = self.numbers(3, "a position"), np.array(self.numbers(4, "a quaternion x y z w"))
        length = float(np.linalg.norm(quaternion))
        if length == 0.0:
            raise self.issue("the quaternion 0 0 0 0", "one of length 1")
        return pin.SE3(pin.Quaternion(quaternion / length).toRotationMatrix(), np.array(position))

    def issue(self, found: str, expected: str) -> InputError:
        """An error at the line that was taken last."""
        number = self._lines[max(self._at - 1, 0)][0] if self._lines else None
        return InputError([Issue(str(self._path), number, "scene", found, expected)])
