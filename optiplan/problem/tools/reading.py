"""Read the tools of a problem file, checked against the robot and the scene."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from optiplan.config.simple_yaml import Place
from optiplan.geometry.pose import pose_of
from optiplan.geometry.scene import Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.problem.builder import Compiler
from optiplan.problem.tools.tool import NONE, MountedTool, ToolBody, at_first
from optiplan.robot.frames import frame_names, link_names
from optiplan.robot.mounting import FixedFrame
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan.problem.schema.tools import ToolSpec
    from optiplan.problem.task.steps import ChangeTool


def read_tools(compiler: Compiler, robot: Robot, scene: Scene) -> tuple[MountedTool, ...]:
    """Return the valid tools, whose names and those of their bodies are unlike all others."""
    taken = dict.fromkeys(link_names(robot.model), "a link of the robot")
    taken |= dict.fromkeys(frame_names(robot.model), "a frame of the robot") | dict.fromkeys(scene.names, "a body")
    found = []
    for place, name, spec in compiler.tools:
        if name == NONE or name in taken:
            what = "the name of no tool" if name == NONE else f"already the name of {taken[name]}"
            compiler.report(place, f"'{name}', {what}", "a name of its own")
            continue
        taken[name] = "a tool"
        links = link_names(robot.model)
        for at, link in [(("link",), spec.link), *((("touch", i), one) for i, one in enumerate(spec.touch))]:
            if link not in links:
                compiler.unknown((*place, *at), "link", link, links)
        bodies = _bodies(compiler, (place, name, spec), taken)
        if spec.link in links and bodies is not None:
            parked = None if spec.parked is None else pose_of(spec.parked)
            found.append(MountedTool(name, spec.link, pose_of(spec.tcp), bodies, parked, name == compiler.mounted_tool))
    compiler.sound_tools = compiler.sound_tools and len(found) == len(compiler.tools)
    mounted, names = compiler.mounted_tool, [tool.name for tool in found]
    if compiler.sound_tools and mounted is not None and mounted not in names:
        compiler.unknown(("tool",), "tool", mounted, names)
        compiler.sound_tools = False
    return tuple(found)


def _bodies(
    compiler: Compiler, stated: "tuple[Place, str, ToolSpec]", taken: dict[str, str]
) -> tuple[ToolBody, ...] | None:
    place, name, spec = stated
    bodies: list[ToolBody] = []
    right, names = True, frozenset(spec.bodies_of(name))
    for k, (own, one) in enumerate(zip(spec.bodies_of(name), spec.shapes, strict=True)):
        at = (*place, "shapes", k)
        if own in taken and (own != name or own in {body.name for body in bodies}):
            compiler.report((*at, "name"), f"'{own}', which is already the name of {taken[own]}", "a name of its own")
            right = False
        taken.setdefault(own, "a body of a tool")
        shape = compiler.shape((*at, "shape"), one.shape)
        if shape is not None:
            bodies.append(ToolBody(own, shape, spec.link, pose_of(one.pose), names - {own} | set(spec.touch)))
        right = right and shape is not None
    if not right or spec.mass is None:
        return tuple(bodies) if right else None
    try:
        weight = _weight(spec, spec.mass, bodies)
    except ValueError as error:
        found = f"{spec.mass:g} kg of '{name}', of which a shape {error}"
        compiler.report((*place, "mass"), found, "`centre` and `inertia` beside the mass")
        return None
    return (replace(bodies[0], mass=spec.mass, weight=weight), *bodies[1:])


def _weight(spec: "ToolSpec", mass: float, bodies: list[ToolBody]) -> pin.Inertia:
    """Return the spatial inertia in the frame of the link: as stated, or of the bodies filled with one density.

    Raises:
        ValueError: a shape encloses no volume, or is an open mesh.
    """
    from optiplan.geometry.mass_properties import mass_properties

    if spec.centre is not None and spec.inertia is not None:
        return pin.Inertia(mass, np.array(spec.centre), np.diag(spec.inertia))
    filled = pin.Inertia.Zero()
    for body in bodies:
        even = mass_properties(build_geometry(body.shape))
        filled += body.X_LO.act(pin.Inertia(even.volume, even.centre, even.volume * even.moments))
    even_inertia = pin.Inertia(mass, filled.lever, (mass / filled.mass) * filled.inertia)
    centre = even_inertia.lever if spec.centre is None else np.array(spec.centre)
    moments = even_inertia.inertia if spec.inertia is None else np.diag(spec.inertia)
    return pin.Inertia(mass, centre, moments)


class ToolsInUse:
    """The tools of a problem, and what the robot has in hand, while its steps are read.

    Attributes:
        by_name: all tools.
        now: the tool that is mounted; None: none is.
        held: objects that are held, with the link that holds each.
    """

    def __init__(self, tools: tuple[MountedTool, ...], scene: Scene) -> None:
        self.by_name: Mapping[str, MountedTool] = {tool.name: tool for tool in tools}
        self.now = self.first = next((tool for tool in tools if tool.mounted), None)
        self.held = {one.name: FixedFrame(one.name, one.link, one.X_LO, True) for one in scene.attached}

    def change(self, name: str) -> "ChangeTool":
        """Change to a tool, or to `none`."""
        from optiplan.problem.task.steps import ChangeTool

        before, self.now = self.now, self.by_name.get(name)
        return ChangeTool(before, self.now)

    def take(self, name: str, link: str) -> None:
        """Note that a link holds an object; where in the link is not known before it is planned."""
        self.held[name] = FixedFrame(name, link, pin.SE3.Identity(), True)

    def seen(self, robot: Robot) -> Robot:
        """Return the robot with the frames that there are now, and the TCP of the tool as its tool frame."""
        links = set(link_names(robot.model))
        tools = () if self.now is None else (self.now.frame,)
        held = [one for one in self.held.values() if one.link in links]
        return _framed(robot, (*tools, *held), self.now)

    def all_tools(self, robot: Robot, scene: Scene) -> Robot:
        """Return the robot as it is at first, with the frames of all tools and of what goals are about in a scene."""
        tools = [tool.frame for tool in self.by_name.values()]
        held = [FixedFrame(one.name, one.link, one.X_LO, True) for one in scene.attached if one.framed]
        return _framed(robot, (*tools, *held), self.first)

    def at_first(self, scene: Scene) -> Scene:
        """Return a scene with the first tool on its link and the others in their racks."""
        return at_first(scene, self.by_name.values())


def _framed(robot: Robot, frames: tuple[FixedFrame, ...], tool: MountedTool | None) -> Robot:
    if not frames:
        return robot
    framed = robot.mounted(replace(robot.mounting, frames=frames))
    return framed if tool is None else framed.with_tool(tool.name)


def as_frames(scene: Scene, names: Collection[str]) -> Scene:
    """Return a scene whose objects of these names are frames of the robot while they are held."""
    if not any(one.name in names for one in scene.attached):
        return scene
    attached = [replace(one, framed=True) if one.name in names else one for one in scene.attached]
    return replace(scene, attached=tuple(attached))


def without_tools(robot: Robot) -> Robot:
    """Return a robot without tools, and with its own tool frame where it had that of a tool."""
    bare = robot.mounted(replace(robot.mounting, frames=()))
    own = bare.model.existFrame(bare.tool_frame)
    return bare if own else replace(bare, tool_frame=bare.reference.tool_frame)
