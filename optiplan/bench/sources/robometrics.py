"""Problems of robometrics files: sets by name, obstacles by kind, poses with the quaternion's w first."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from optiplan.bench.sources.base import Found, Place
from optiplan.bench.suite.schema import SET_NAME
from optiplan.config.document import Document, read_yaml
from optiplan.errors import InputError, Issue

_SHAPES = ("cuboid", "cylinder", "sphere", "capsule")


def robometrics_file(place: Place) -> Iterator[Found]:
    """Every problem of the file: the goal is the pose that it gives, reached by any inverse kinematics.

    A problem holds `start` (joints), `goal_pose` {frame, position_xyz, quaternion_wxyz} and `obstacles`
    {kind: {name: {pose [x, y, z, qw, qx, qy, qz], dims | radius, height}}}; its `goal_ik` is not read. The robot is the
    shipped `panda` unless the suite names one.

    Raises:
        InputError: the file is of another form, has a set whose name no folder can have, or holds bodies of a kind
            other than cuboid, cylinder, sphere, capsule.
    """
    path = place.path("robometrics")
    if not path.is_file():
        raise place.refuse("robometrics", f"no file {path}", "a YAML file of robometrics problems")
    document = read_yaml(path)
    sets = document.data
    if not isinstance(sets, Mapping) or not all(isinstance(items, list) for items in sets.values()):
        raise _refused(document, "the file", "sets of problems: {name: [problem, …]}")
    for name in sets:
        if not re.match(SET_NAME, name):
            raise _refused(document, f"a set called '{name}'", "names without / and \\ that begin with no dot")
    robot = place.robot() or "panda"
    for name, set_name, (index, item) in place.chosen({k: list(enumerate(items)) for k, items in sets.items()}):
        try:
            data = _converted(item, robot)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            expected = "start, goal_pose and obstacles as robometrics writes them"
            raise _refused(document, f"{name}[{index}]: {type(error).__name__} {error}", expected) from None
        origin = {"file": str(path.resolve()), "set": name, "index": index}
        yield Found(f"{index:04d}", set_name, data, path.resolve().parent, origin)


def _refused(document: Document, found: str, expected: str) -> InputError:
    return InputError([Issue(str(document.path), None, "problems", found, expected)])


def _converted(item: Mapping[str, Any], robot: str) -> dict[str, Any]:
    goal = item["goal_pose"]
    w, x, y, z = (float(value) for value in goal["quaternion_wxyz"])
    pose = {"frame": goal["frame"], "position": _floats(goal["position_xyz"]), "quaternion": [x, y, z, w]}
    obstacles = [
        _obstacle(kind, name, body)
        for kind, bodies in (item["obstacles"] or {}).items()  # a key with nothing behind it has none
        for name, body in (bodies or {}).items()
    ]
    return {
        "version": 1,
        "robot": robot,
        "start": {"joints": _floats(item["start"])},
        "goal": {"pose": pose},
        "scene": {"obstacles": obstacles},
    }


def _obstacle(kind: str, name: str, body: Mapping[str, Any]) -> dict[str, Any]:
    if kind not in _SHAPES:
        raise ValueError(f"body '{name}' of kind '{kind}'; known are {', '.join(_SHAPES)}")
    shape: dict[str, Any] = {"box": _floats(body["dims"])} if kind == "cuboid" else {"sphere": body.get("radius")}
    if kind in ("cylinder", "capsule"):
        shape = {kind: {"radius": float(body["radius"]), "length": float(body["height"])}}
    *position, w, x, y, z = (
        _floats(body["pose"]) if "pose" in body else [*_floats(body["position"]), 1.0, 0.0, 0.0, 0.0]
    )
    return {"name": str(name), "shape": shape, "pose": {"position": position, "quaternion": [x, y, z, w]}}


def _floats(values: Any) -> list[float]:
    return [float(value) for value in values]
