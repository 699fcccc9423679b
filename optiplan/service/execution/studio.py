"""What the studio draws and asks: a problem without runs, a configuration, the branches of an inverse kinematics."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, finite_or_none
from optiplan.collision.kept_models import collision_model
from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue
from optiplan.geometry.poses import pose_from_data
from optiplan.kinematics.ik.solve import answer
from optiplan.problem.goals_and_vias import GoalEnd, JointGoal, PoseGoal
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import Move, StraightLine
from optiplan.robot.frames import frame_names, frame_pose
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.runs import Poses
from optiplan.viewer.scene import build_scene

MOST_BRANCHES = 16
"""Ghosts drawn at a time."""


def studio_scene(problem: Problem, motion: Trajectory | None = None) -> dict[str, Any]:
    """What the viewer draws of a problem, with its joints and obstacles as things to move.

    Args:
        problem: the problem.
        motion: a motion of it, which the scene then has as its run.

    Returns:
        `scene` as `SceneData.to_dict`; `joints`: name, unit, and limits, null where there is none; `start`: (n,);
        `tool`: its pose at the start; `handles`: poses of the file that can be dragged, see `_handles`; `problem`:
        the problem as data, all defaults filled in; `hash`.
    """
    limits = problem.robot.limits
    joints = [
        {
            "name": name,
            "unit": problem.robot.unit("position", j),
            "lower": finite_or_none(low),
            "upper": finite_or_none(high),
        }
        for j, (name, low, high) in enumerate(zip(problem.robot.joint_names, limits.lower, limits.upper, strict=True))
    ]
    return {
        "scene": build_scene(problem, [] if motion is None else [("motion", motion, None)]).to_dict(),
        "joints": joints,
        "start": problem.start.tolist(),
        "tool": _tool(problem, problem.start),
        "handles": list(_handles(problem)),
        "problem": dict(problem.source),
        "hash": problem.hash,
    }


def posed(problem: Problem, q: Array) -> dict[str, Any]:
    """Where the bodies and the tool are at q (n,), and which bodies touch there.

    Raises:
        InputError: q has another number of values than the robot joints, or one that is not finite.
    """
    _check(problem, q)
    model = collision_model(problem.robot, problem.scene)
    touching = [[contact.pair.name_a, contact.pair.name_b] for contact in model.contacts(q, 0.0)]
    return {"poses": _flat(problem, q), "tool": _tool(problem, q), "touching": touching}


def branches(
    problem: Problem, pose: Sequence[float], near: Sequence[float] | None, frame: str | None = None
) -> dict[str, Any]:
    """All configurations that put a frame at a pose (x, y, z, qx, qy, qz, qw), nearest to `near` (n,) first.

    Args:
        problem: the problem, at its start.
        pose: of the frame in the world; position in m.
        near: (n,), rad or m; None: the start.
        frame: of the robot; None: its tool frame.

    Returns:
        `branches`: `q`, `branch`, `within_limits`, `touching` and `poses` of each; `reason`: why none is within limits.

    Raises:
        InputError: the pose or `near` is none, or the robot has no such frame.
    """
    given = np.asarray(pose, float)
    if not np.isfinite(given).all() or np.linalg.norm(given[3:]) < 1e-6:
        raise InputError([Issue("request", None, "pose", "numbers that are no pose", "m, and a quaternion x, y, z, w")])
    given[3:] /= np.linalg.norm(given[3:])
    q = problem.start if near is None else np.asarray(near, float)
    _check(problem, q)
    if frame is not None and frame not in (known := frame_names(problem.robot.model)):
        raise InputError([Issue("request", None, "frame", f"unknown frame '{frame}'", choices(frame, known))])
    found = answer(problem.robot, frame or problem.robot.tool_frame, pin.XYZQUATToSE3(given), q)
    model = collision_model(problem.robot, problem.scene)
    shown = [
        {
            "q": solution.q.tolist(),
            "branch": solution.branch,
            "within_limits": bool(solution.within_limits),
            "touching": bool(model.collides(solution.q)),
            "poses": _flat(problem, solution.q),
        }
        for solution in found.solutions[:MOST_BRANCHES]
    ]
    return {"branches": shown, "reason": found.reason}


def _handles(problem: Problem) -> Iterator[dict[str, Any]]:
    """Poses that the file names: `path` of keys to it, `label`, `pose` in the world, `joints`, `frame`, `moves`.

    `joints`: whether the file has joint values there; the pose is then the tool's. Those of a task have none, and their
    paths count its steps as `problem.source` does. `frame`: whose pose it is; None where the robot lacks it at the
    start, or does not move all joints that carry it in that step. `moves`: indices of the joints whose values may stand
    there instead; none where only a pose may.
    """
    several = (problem.source.get("goal") or {}).get("any_of")
    for k, end in enumerate(problem.goal):
        label = f"goal, {k + 1} of several" if several else "goal"
        yield from _end(problem, end, ["goal", "any_of", k] if several else ["goal"], label)
    for k, via in enumerate(problem.vias):
        yield from _end(problem, via.at, ["via", k], f"via {k + 1}")
    for k, step in enumerate(problem.source.get("task") or ()):
        frame, moves = _moved_in(problem, k + 1)
        for kind, stated in step.items():
            if isinstance(stated, Mapping):
                for one in _poses(stated, ["task", k, kind], step.get("name") or f"step {k + 1}"):
                    yield one | {"joints": False, "frame": frame, "moves": moves if kind == "move" else []}


def _end(problem: Problem, end: GoalEnd, path: list[str | int], label: str) -> Iterator[dict[str, Any]]:
    robot, about = problem.robot, {"label": label, "moves": list(range(problem.robot.n))}
    if isinstance(end, JointGoal):
        yield about | {"path": path, "pose": _tool(problem, end.q), "joints": True, "frame": robot.tool_frame}
    elif isinstance(end, PoseGoal):
        pose: list[float] = pin.SE3ToXYZQUAT(end.X_WG).tolist()
        yield about | {"path": [*path, "pose"], "pose": pose, "joints": False, "frame": _known(robot, end.frame)}


def _moved_in(problem: Problem, number: int) -> tuple[str | None, list[int]]:
    """Return the frame whose pose a step states, see `_handles`, and the indices of the joints that it moves."""
    names = problem.robot.joint_names
    for step in problem.task:
        action = step.action
        if step.number != number or not isinstance(action, Move | StraightLine):
            continue
        for end in action.ends if isinstance(action, StraightLine) else action.goal:
            if isinstance(end, PoseGoal):
                carried = _joints_to(problem.robot, end.frame) <= set(action.joints)
                moves = [names.index(joint) for joint in action.joints]
                return _known(problem.robot, end.frame) if carried else None, moves
    return None, []


def _poses(stated: Mapping[str, Any], path: list[str | int], label: str) -> Iterator[dict[str, Any]]:
    found = [([*path, "pose"], label, stated.get("pose"))]
    found += [
        ([*path, "any_of", k], f"{label}, {k + 1} of several", one) for k, one in enumerate(stated.get("any_of") or ())
    ]
    for where, words, pose in found:
        if isinstance(pose, Mapping) and "position" in pose:
            known = {key: pose[key] for key in ("position", "rpy", "quaternion") if pose.get(key) is not None}
            yield {"path": where, "label": words, "pose": pin.SE3ToXYZQUAT(pose_from_data(known)).tolist()}


def _known(robot: Robot, frame: str) -> str | None:
    return frame if robot.model.existFrame(frame) else None


def _joints_to(robot: Robot, frame: str) -> set[str]:
    """Return the planned joints that move a frame."""
    if not robot.model.existFrame(frame):
        return set()
    carried_by = robot.model.supports[robot.model.frames[robot.frame_id(frame)].parentJoint]
    return {robot.model.names[joint] for joint in carried_by} & set(robot.joint_names)


def _check(problem: Problem, q: Array) -> None:
    if q.shape != (problem.robot.n,) or not np.isfinite(q).all():
        found = f"{q.size} values" if np.isfinite(q).all() else "values that are not finite"
        expected = f"{problem.robot.n} finite values, rad or m"
        raise InputError([Issue("request", None, "q", found, expected)])


def _flat(problem: Problem, q: Array) -> list[list[float]]:
    """Poses of the joints (bodies, 7)."""
    rows: list[list[float]] = Poses(problem).of(q[None])[0][0].tolist()
    return rows


def _tool(problem: Problem, q: Array) -> list[float]:
    pose: list[float] = pin.SE3ToXYZQUAT(frame_pose(problem.robot, q, problem.robot.tool_frame)).tolist()
    return pose
