"""Parts of a problem as the plain data of a problem file: the inverse of `builder.py`."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pinocchio as pin

from optiplan.config.document import plain
from optiplan.errors import described, options_argument, wrong_argument
from optiplan.geometry.pose import Pose, place_data
from optiplan.geometry.poses import pose_from_data, pose_to_data
from optiplan.geometry.safety import Safety
from optiplan.geometry.scene import Scene
from optiplan.geometry.shapes import shape_data
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.schema.joint_names import ends_of
from optiplan.problem.statement import end_data, is_configuration, is_several, via_point_data
from optiplan.problem.tools.tool import stated_alone
from optiplan.trajectory.state import State


def start_data(start: Any) -> Any:
    """`start:` of a file."""
    if isinstance(start, str | State | Mapping) or is_configuration(start):
        return end_data(start, "Problem", "start")
    expected = (
        "values of the joints (n,) or {joint: value}, op.State(q, v, a), or the name of a configuration of the robot"
    )
    raise wrong_argument("Problem", "start", described(start), expected)


def moving_start(start: Any, velocity: Any, acceleration: Any) -> dict[str, Any]:
    """`start:` of a file, with rates that were given beside it."""
    rates = {"velocity": velocity, "acceleration": acceleration}
    return {**start_data(start), **{key: plain(rate) for key, rate in rates.items() if rate is not None}}


def goal_data(goal: Any) -> dict[str, Any]:
    """`goal:` of a file: one end, or any one of several.

    Raises:
        InputError: not an end, or a joint goal with a tolerance that files cannot hold.
    """
    several = is_several(goal)
    ends = [
        end_data(end, "Problem", f"goal[{k}]" if several else "goal")
        for k, end in enumerate(goal if several else [goal])
    ]
    if not ends:
        raise wrong_argument("Problem", "goal", "an empty list", "at least one end")
    return ends[0] if len(ends) == 1 else {"any_of": ends}


def via_data(vias: Any, function: str = "Problem") -> list[dict[str, Any]]:
    """`via:` of a file; `function` is whose argument it is."""
    if not is_several(vias):
        expected = "a list of op.ViaPoint(…), op.Pose(…), configurations (n,) or names of them"
        raise wrong_argument(function, "vias", described(vias), expected)
    return [via_point_data(via, f"vias[{k}]") for k, via in enumerate(vias)]


def scene_data(scene: Any) -> Any:
    """`scene:` of a file; meshes keep their paths, poses their form of rotation."""
    if isinstance(scene, Mapping):
        return plain(scene)
    if not isinstance(scene, Scene):
        if isinstance(scene, str) or not isinstance(scene, Sequence):
            raise wrong_argument("Problem", "scene", described(scene), "op.Scene([…]) or a list of obstacles")
        scene = Scene(scene)
    scene = stated_alone(scene)
    obstacles = [
        {
            "name": body.name,
            "shape": shape_data(body.shape),
            "pose": _pose(body.X_WO, body.stated),
            **({} if body.motion is None else {"motion": body.motion.to_data()}),
        }
        for body in scene.obstacles
    ]
    attached = [
        {
            "name": held.name,
            "shape": shape_data(held.shape),
            "link": held.link,
            "pose": _pose(held.X_LO, held.stated),
            "touch": sorted(held.touch),
            **{key: plain(said) for key in ("mass", "centre", "inertia") if (said := getattr(held, key)) is not None},
        }
        for held in scene.attached
    ]
    allowed = sorted(sorted(pair) for pair in scene.allowed)
    return {"obstacles": obstacles, "attached": attached, "allowed_collisions": allowed}


def clearance_data(clearance: Any) -> Any:
    """`clearance:` of a file: a distance, or a `Safety`."""
    return clearance.to_data() if isinstance(clearance, Safety) else plain(clearance)


def path_constraint_data(constraints: Any, function: str = "Problem") -> list[dict[str, Any]]:
    """`path_constraints:` of a file; errors are about this argument of `function`."""
    if isinstance(constraints, Mapping | str) or not isinstance(constraints, Sequence):
        raise wrong_argument(function, "path_constraints", described(constraints), "a list of path constraints")
    return [_one_constraint_data(one, function, f"path_constraints[{k}]") for k, one in enumerate(constraints)]


def _one_constraint_data(one: Any, function: str, argument: str) -> dict[str, Any]:
    """One of `path_constraints:` of a file; where a constraint holds a pose, an `op.Pose` will do.

    Raises:
        InputError: no constraint, or one of values of other types, about this argument of a function.
    """
    from optiplan.problem.constraints.statements import KINDS

    if isinstance(one, Mapping):
        return dict(plain(one))
    kinds = tuple(KINDS.values())
    if not isinstance(one, kinds):
        expected = ", ".join(f"op.{kind.__name__}" for kind in kinds)
        raise wrong_argument(function, argument, described(one), f"one of: {expected}")
    poses = {
        name: pose_from_data(place_data(pose, function, f"{argument}.{name}"))
        for name, pose in vars(one).items()
        if isinstance(pose, Pose)
    }
    try:
        data: dict[str, Any] = plain({one.KEY: replace(one, **poses).to_data()})  # type: ignore[type-var]  # dataclasses
    except (AttributeError, TypeError, ValueError):
        words = f"one that is said by {', '.join(described(value) for value in vars(one).values())}"
        raise wrong_argument(function, argument, words, f"what op.{type(one).__name__} is made of") from None
    return data


def base_data(base: Any) -> Any:
    """`base:` of a file."""
    return plain(base) if isinstance(base, Mapping) else place_data(base, "Problem", "base")


def frames_data(frames: Any) -> Any:
    """`frames:` of a file."""
    return _mapping("frames", frames, "{name: {'position': (…), 'motion': {'polynomial': …}}}")


def limits_data(limits: Any) -> Any:
    """`limits:` of a file: fractions of the robot's own."""
    return _mapping("limits", limits, "fractions such as {'velocity': 0.5}")


def objective_data(objective: Any) -> Any:
    """`objective:` of a file."""
    if isinstance(objective, Objective):
        return {"time": objective.time, "jerk": objective.jerk} | objective.weights
    return _mapping("objective", objective, "op.Objective(time=…, jerk=…, …)")


def _mapping(argument: str, value: Any, expected: str) -> Any:
    if not isinstance(value, Mapping):
        raise wrong_argument("Problem", argument, described(value), expected)
    return plain(value)


def planner_data(planner: Any, options: Any) -> Any:
    """`planner:` of a file."""
    options_argument("Problem", options)
    if isinstance(planner, Mapping):
        return {**plain(planner), **plain(options or {})}
    return {"name": plain(planner), **plain(options or {})}


def _pose(X: pin.SE3, stated: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the pose in its original form, if that is still equal."""
    same = stated is not None and (pose_from_data(stated).homogeneous == X.homogeneous).all()
    return dict(plain(stated)) if same else pose_to_data(X)


_OF_TOOL = ("line", "retreat", "tour", "path")
"""Steps with a `frame` of their own."""


def tool_statements(data: Mapping[str, Any], own_tools: Container[str] = ()) -> list[dict[str, Any]]:
    """Return the mappings in a problem's data whose `frame` is the tool frame without one, to be changed in place.

    Args:
        data: of the problem, in one form: poses and regions of goal, vias and steps, grasps, lines by a vector,
            retreats, tours, paths and path constraints.
        own_tools: groups with a tool frame of their own; steps of these are left out.
    """
    from optiplan.problem.constraints.statements import KINDS

    found: list[Any] = []
    for place, end in ends_of({**data, "start": None}, ("move", "line", "approach")):
        if place[0] != "task" or str(data["task"][place[1]][place[2]].get("group")) not in own_tools:
            several = [one for one in end.get("all_of") or () if isinstance(one, Mapping) and "frame" not in one]
            poses = [one.get(key) for one in [end, *several] for key in ("pose", "region", "grasps")]
            found += [end] if place[2:4] == ("approach", "any_of") else poses
    constraints = list(data.get("path_constraints") or ())
    for step in (one for one in data.get("task") or () if isinstance(one, Mapping)):
        said = {kind: one for kind, one in step.items() if isinstance(one, Mapping)}
        if not any(str(one.get("group")) in own_tools for one in said.values()):
            found += [one for kind, one in said.items() if kind in _OF_TOOL and "pose" not in one]
            constraints += step.get("path_constraints") or ()
    of_frames = [kind for kind, one in KINDS.items() if "frame" in one.keys()]
    found += [one.get(kind) for one in constraints if isinstance(one, Mapping) for kind in of_frames]
    return [one for one in found if isinstance(one, dict)]
