"""`Tool` for construction in Python, checked by the schema of problem files."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from optiplan.config.document import plain
from optiplan.errors import described, wrong_argument
from optiplan.geometry.pose import Pose, Values, checked, place_data
from optiplan.geometry.poses import pose_to_data
from optiplan.geometry.scene import Obstacle
from optiplan.geometry.shapes import shape_data
from optiplan.problem.schema.tools import ToolSpec
from optiplan.records import dataclass


@dataclass(frozen=True, eq=False, repr=False)
class Tool:
    """A tool that a link carries: a TCP, with bodies and a mass of its own; the URDF stays as it is.

    Its TCP is a frame of the robot of the tool's name, and the tool frame while the tool is mounted.

    Attributes:
        name: of its own, unlike all links, frames and bodies.
        link: that carries it.
        tcp: pose of the TCP in the frame of the link.
        shapes: bodies, their poses in the frame of the link: `op.Box(…)` and its like.
        mass: of the whole tool, kg; None: no mass.
        centre: of mass, (3,) in the frame of the link, m; None: that of the bodies filled evenly.
        inertia: (3,) moments [ixx, iyy, izz] about that centre along the axes of the link, kg m²; None: likewise.
        touch: names of links that its bodies may touch, besides its own.
        parked: pose of the link in the world at which the tool is taken from its rack and left there; None: no rack.

    Raises:
        InputError: a TCP farther than 3 m, a mass without bodies, moments that no body has.

    Example:
        >>> import optiplan as op
        >>> bit = op.Cylinder("bit", radius=0.01, length=0.1, position=(0, 0, 0.05))
        >>> op.Tool("driver", "panda_link8", tcp=op.Pose((0, 0, 0.1)), shapes=[bit], mass=0.4)
        Tool: driver, on panda_link8, 1 body, 0.4 kg
    """

    name: str
    link: str
    tcp: Pose | None = None
    shapes: Sequence[Obstacle] = ()
    mass: float | None = None
    centre: Values | None = None
    inertia: Values | None = None
    touch: Sequence[str] = ()
    parked: Pose | None = None

    def __post_init__(self) -> None:
        for name in ("shapes", "touch"):
            if not isinstance(value := getattr(self, name), Iterable):
                raise wrong_argument("Tool", name, described(value), "a list")
        checked(ToolSpec, self.to_data(), "Tool", {})

    def to_data(self) -> dict[str, Any]:
        """Return the tool as a problem file says it, without its name."""
        said = {"tcp": self.tcp, "parked": self.parked}
        places = {key: place_data(pose, "Tool", key) for key, pose in said.items() if pose is not None}
        stated: dict[str, Any] = {"link": self.link, **places}
        stated |= {"shapes": [_body(one, f"shapes[{k}]") for k, one in enumerate(self.shapes)]}
        stated |= {"mass": self.mass, "centre": self.centre, "inertia": self.inertia, "touch": list(self.touch)}
        return {key: plain(value) for key, value in stated.items() if value is not None}

    def __repr__(self) -> str:
        """Return name, link, number of bodies and mass in one line."""
        count = len(self.shapes)
        bodies = f"{count} {'body' if count == 1 else 'bodies'}"
        return f"Tool: {self.name}, on {self.link}, {bodies}{'' if self.mass is None else f', {self.mass:g} kg'}"


def _body(body: Any, argument: str) -> dict[str, Any]:
    if not isinstance(body, Obstacle):
        raise wrong_argument("Tool", argument, described(body), "a body, such as op.Box(…)")
    return {"name": body.name, "shape": shape_data(body.shape), "pose": pose_to_data(body.X_WO)}


def tools_data(tools: Any) -> dict[str, Any]:
    """`tools:` of a file."""
    if isinstance(tools, Mapping):
        return {name: tool.to_data() if isinstance(tool, Tool) else plain(tool) for name, tool in tools.items()}
    if not isinstance(tools, Sequence) or not all(isinstance(tool, Tool) for tool in tools):
        raise wrong_argument("Problem", "tools", described(tools), "a list of op.Tool(…)")
    names = [tool.name for tool in tools]
    if twice := [name for name in names if names.count(name) > 1]:
        raise wrong_argument("Problem", "tools", f"two tools called '{twice[0]}'", "a name of its own for each")
    return {tool.name: tool.to_data() for tool in tools}


def tool_data(tool: Any) -> Any:
    """`tool:` of a file: a name of `tools`, or a tool."""
    if isinstance(tool, str | Mapping):
        return plain(tool)
    if isinstance(tool, Tool):
        return {**tool.to_data(), "name": tool.name}
    raise wrong_argument("Problem", "tool", described(tool), "a name of `tools`, or op.Tool(…)")
