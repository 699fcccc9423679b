"""Check of tools: the TCP and the mass that each part of a motion is judged by, and where tools are changed."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import PoseError, pose_error
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.steps import PARKED, ChangeTool, TaskStep
from optiplan.problem.task.timeline import mismatch, part_problem, steps_in_time
from optiplan.problem.tools.tool import MountedTool
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check
from optiplan.verify.statements import repeated, step_place, tool

_ROUNDING = 1e-9
"""m, rad and share of a mass: what the sum of transforms and inertias may be off."""


def tool_checks(problem: Problem, trajectory: Trajectory) -> list[Check]:
    """Return the check `tool` of a problem with tools; none without.

    In every part of the motion the robot that the other checks use has the TCP of each tool as stated, X_LT, and
    carries the mass of the mounted one and of what is held, and no other; the bodies of the mounted tool are on its
    link, and those of the others in their racks or nowhere. At a change the link is where the tool is parked, within
    2 mm and 0.01 rad.
    """
    if not problem.tools or (problem.task and mismatch(problem, trajectory)):
        return []
    places: list[tuple[float, float, float, str]] = []
    wrong: list[tuple[float, str]] = []
    covers = [tool(one.name) for one in problem.tools]
    mounted = _mounted(problem.tools)
    for k, (step, scene, begin) in enumerate(_scenes(problem, trajectory)):
        wrong += [(begin, words) for words in _not_as_stated(problem, scene, mounted)]
        if step is None or not isinstance(step.action, ChangeTool):
            continue
        covers.append(f"{step_place(k)}.tool")
        wrong += [(begin, words) for words in _wrong_change(step, step.action, mounted)]
        places += [(*off, begin, step.words) for off in _off_racks(problem.robot, step.action, trajectory(begin))]
        mounted = step.action.takes
        after = scene_after(scene, step.action, problem.robot, trajectory(begin))
        wrong += [(begin, words) for words in _not_as_stated(problem, after, mounted)]
    return [_summed(places, wrong, tuple(covers), len(problem.tools))]


def _summed(
    places: Sequence[tuple[float, float, float, str]],
    wrong: Sequence[tuple[float, str]],
    covers: tuple[str, ...],
    count: int,
) -> Check:
    detail = f"{count} {'tool' if count == 1 else 'tools'}, TCP and mass as stated in every part of the motion"
    if wrong:
        time, words = wrong[0]
        return Check("tool", "exact", False, time=time, detail=words, covers=covers)
    if not places:
        return Check("tool", "exact", True, detail=detail, covers=covers)
    share = [max(position / PARKED[0], angle / PARKED[1]) for position, angle, *_ in places]
    position, angle, time, words = places[int(np.argmax(share))]
    detail = f"{detail}; farthest from a rack: {1e3 * position:.3g} mm and {angle:.3g} rad"
    return Check("tool", "exact", max(share) <= 1.0, position, PARKED[0], "m", time, words, detail, covers=covers)


def _scenes(problem: Problem, trajectory: Trajectory) -> Iterator[tuple[TaskStep | None, Scene, float]]:
    """Yield steps with the scene before each and the time; without a task the scene alone."""
    if not problem.task:
        yield None, problem.scene, 0.0
        return
    for step, scene, begin, _ in steps_in_time(problem, trajectory):
        yield step, scene, begin


def _mounted(tools: Iterable[MountedTool]) -> MountedTool | None:
    return next((one for one in tools if one.mounted), None)


def _not_as_stated(problem: Problem, scene: Scene, mounted: MountedTool | None) -> Iterator[str]:
    robot = part_problem(problem, scene).robot if problem.task else problem.robot
    for name in repeated(scene):
        yield f"there are two bodies called '{name}'"
    held = {one.name: one for one in scene.attached}
    parked = {one.name: one for one in scene.obstacles}
    for one in problem.tools:
        if not _same(_in_link(robot, one), one.X_LT):
            yield f"the TCP of '{one.name}' is not where the tool states it"
        for body in one.bodies:
            if one is mounted and (body.name not in held or not _same(held[body.name].X_LO, body.X_LO)):
                yield f"'{body.name}' of the mounted tool is not on '{one.link}' as stated"
            elif one is not mounted and body.name in held:
                yield f"'{body.name}' is on '{one.link}', though '{one.name}' is not mounted"
            elif one is not mounted and one.X_WP is not None:
                if body.name not in parked or not _same(parked[body.name].X_WO, one.X_WP * body.X_LO):
                    yield f"'{body.name}' is not in its rack"
    heavy = sum(one.inertia_in_link().mass for one in scene.attached)
    if abs(robot.mounting.mass - heavy) > _ROUNDING * (1.0 + heavy):
        yield f"the robot carries {robot.mounting.mass:.6g} kg of {heavy:.6g} kg in hand"


def _wrong_change(step: TaskStep, action: ChangeTool, mounted: MountedTool | None) -> Iterator[str]:
    if action.leaves is not mounted:
        yield f"{step.words} leaves a tool that is not mounted"


def _off_racks(robot: Robot, action: ChangeTool, q: Array) -> Iterator[PoseError]:
    """Yield how far the link is from the rack of each tool that is changed."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    for one, X_WP in action.racks:
        yield pose_error(data.oMf[robot.model.getFrameId(one.link, pin.FrameType.BODY)], X_WP)


def _in_link(robot: Robot, one: MountedTool) -> pin.SE3:
    """Return the pose X_LT of the TCP in its link, of the model."""
    frames = robot.model.frames
    link = frames[robot.model.getFrameId(one.link, pin.FrameType.BODY)]
    tip = frames[robot.frame_id(one.name)]
    if tip.parentJoint != link.parentJoint:
        return pin.SE3(np.eye(3), np.full(3, np.inf))
    return link.placement.actInv(tip.placement)


def _same(X: pin.SE3, other: pin.SE3) -> bool:
    return bool(np.abs(X.homogeneous - other.homogeneous).max() <= _ROUNDING)


def tool_scope(problem: Problem, trajectory: Trajectory) -> tuple[str, ...]:
    """Return what the verdict is about besides: which tool is mounted when, and what it may touch."""
    if not problem.tools or (problem.task and mismatch(problem, trajectory)):
        return ()
    first = _mounted(problem.tools)
    said = [f"{'none' if first is None else _heavy(first)} at first"]
    for step, _, begin in _scenes(problem, trajectory):
        if step is not None and isinstance(step.action, ChangeTool):
            takes = step.action.takes
            said.append(f"{'none' if takes is None else _heavy(takes)} from {begin:.3f} s")
    later = [body for one in problem.tools if one is not first for body in one.bodies]
    links = set(problem.robot.link_geometry)
    free = sorted({" – ".join(sorted((body.name, link))) for body in later for link in body.touch & links})
    touch = (f"contacts of tools allowed, not checked: {', '.join(free)}",) if free else ()
    return (f"tool: {'; '.join(said)}", *touch)


def _heavy(one: MountedTool) -> str:
    mass = one.weight.mass
    return f"{one.name} of {mass:g} kg" if mass else one.name
