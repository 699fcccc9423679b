"""`planners` and `robots`: what there is to choose from, a line each."""

import html

from optiplan.config.document import read_yaml, validate
from optiplan.planners.registry import FAMILIES, PLANNERS
from optiplan.resources import robots_dir
from optiplan.robot.robot import robot_names
from optiplan.robot.spec import RobotSpec


class Listing(dict[str, str]):
    """Names, each with a line about it; printed as a table."""

    def __repr__(self) -> str:
        """A line a name."""
        width = max(map(len, self), default=0)
        return "\n".join(f"{name:{width}}  {line}" for name, line in self.items())

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows = (f"<tr><th>{html.escape(name)}</th><td>{html.escape(line)}</td></tr>" for name, line in self.items())
        return f"<table>{''.join(rows)}</table>"


def planners() -> Listing:
    """The planners by name, each with what it does; `optiplan planners NAME` shows the options of one.

    Example:
        >>> import optiplan as op
        >>> "trajopt" in op.planners()
        True
    """
    ordered = sorted(PLANNERS.values(), key=lambda entry: FAMILIES.index(entry.family))
    return Listing({entry.name: f"{entry.family}: {entry.summary}" for entry in ordered})


def robots() -> Listing:
    """The bundled robots by name, each with its groups of joints, tool frame and named configurations.

    Example:
        >>> import optiplan as op
        >>> "panda" in op.robots()
        True
    """
    found = {name: validate(RobotSpec, read_yaml(robots_dir() / name / "robot.yaml")) for name in robot_names()}
    return Listing({name: _line(spec) for name, spec in found.items()})


def _line(spec: RobotSpec) -> str:
    parts = {
        "groups": ", ".join(spec.groups),
        "tool frame": spec.tool_frame or "the last link",
        "configurations": ", ".join((*spec.configurations, *spec.configurations_deg)),
    }
    return "; ".join(f"{key} {value}" for key, value in parts.items() if value)
