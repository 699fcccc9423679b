"""Tools as planners and the verifier read them: a TCP, bodies and a mass, on a link or parked in the world."""

from collections.abc import Container, Iterable
from dataclasses import replace

import pinocchio as pin

from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.records import dataclass
from optiplan.robot.mounting import FixedFrame

NONE = "none"
"""Name of no tool: a step `tool: none` leaves the one that is mounted."""


@dataclass(frozen=True, eq=False, repr=False)
class ToolBody(Attachment):
    """A body of a tool on its link; the first one has the mass of the whole tool.

    Attributes:
        weight: spatial inertia of the whole tool in the frame of the link; None: of another body, or no mass.
    """

    weight: pin.Inertia | None = None

    def inertia_in_link(self) -> pin.Inertia:
        """Return the spatial inertia of the whole tool in the frame of the link; zero of its other bodies."""
        return pin.Inertia.Zero() if self.weight is None else self.weight


@dataclass(frozen=True, eq=False, repr=False)
class ParkedBody(Obstacle):
    """A body of a tool that is parked, an obstacle."""


@dataclass(frozen=True, eq=False)
class MountedTool(ReadOnlyPoses):
    """A tool as it is on its link.

    Attributes:
        name: of the tool and of the frame of its TCP.
        link: that carries it.
        X_LT: pose of the TCP in the frame of the link.
        bodies: on the link.
        mounted: whether it is on its link at first.
        X_WP: pose of the link in the world at which the tool is taken from its rack and left there; None: it has none,
            and is nowhere while it is not on the link.
    """

    name: str
    link: str
    X_LT: pin.SE3
    bodies: tuple[ToolBody, ...] = ()
    X_WP: pin.SE3 | None = None
    mounted: bool = False

    @property
    def frame(self) -> FixedFrame:
        """The frame of its TCP."""
        return FixedFrame(self.name, self.link, self.X_LT)

    @property
    def weight(self) -> pin.Inertia:
        """Its spatial inertia in the frame of the link."""
        return self.bodies[0].inertia_in_link() if self.bodies else pin.Inertia.Zero()

    def parked(self) -> tuple[ParkedBody, ...]:
        """Return its bodies in the rack; none where it has no rack."""
        if self.X_WP is None:
            return ()
        return tuple(ParkedBody(body.name, body.shape, self.X_WP * body.X_LO) for body in self.bodies)

    def on(self, scene: Scene) -> Scene:
        """Return a scene with the tool on its link, and not in its rack."""
        there = self._elsewhere(scene)
        return replace(there, attached=(*there.attached, *self.bodies))

    def off(self, scene: Scene) -> Scene:
        """Return a scene with the tool in its rack, or nowhere."""
        there = self._elsewhere(scene)
        return replace(there, obstacles=(*there.obstacles, *self.parked()))

    def _elsewhere(self, scene: Scene) -> Scene:
        return stated_alone(scene, frozenset(body.name for body in self.bodies))


def at_first(scene: Scene, tools: Iterable[MountedTool]) -> Scene:
    """Return a scene with the tool that is mounted at first on its link and the others in their racks."""
    for tool in tools:
        scene = tool.on(scene) if tool.mounted else tool.off(scene)
    return scene


def stated_alone(scene: Scene, names: Container[str] | None = None) -> Scene:
    """Return a scene without the bodies of tools, which the tools state; of those `names` alone, if they are given."""

    def stays(one: Obstacle | Attachment) -> bool:
        return not isinstance(one, ParkedBody | ToolBody) or (names is not None and one.name not in names)

    return replace(
        scene, obstacles=tuple(filter(stays, scene.obstacles)), attached=tuple(filter(stays, scene.attached))
    )
