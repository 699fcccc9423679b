"""Print a robot for `optiplan robots show`."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pairs import count_reasons, reasons_in_words
from optiplan.verify.report import jsonable

LIMITS = ("lower", "upper", "velocity", "acceleration", "jerk", "torque")


def describe(robot: Robot) -> dict[str, Any]:
    """Return the `robots show --json` output; infinite limits are null."""
    limits = {name: getattr(robot.limits, name) for name in LIMITS}
    joints = [
        {"name": joint} | {key: column[i] for key, column in limits.items()}
        for i, joint in enumerate(robot.joint_names)
    ]
    rates, allowed = robot.survey.rates, robot.allowed
    checked = sorted(pair for pair in rates if pair not in allowed)
    data = {
        "name": robot.name,
        "source": str(robot.source),
        "group": robot.group,
        "groups": robot.groups,
        "tool_frame": robot.tool_frame,
        "joints": joints,
        "dh": None if robot.dh is None else asdict(robot.dh),
        "locked": robot.locked,
        "followers": {name: asdict(mimic) for name, mimic in robot.followers.items()},
        "massless_links": robot.massless_links,
        "configurations": robot.configurations,
        "frames": [frame.name for frame in robot.model.frames[1:]],
        "links": robot.link_geometry,
        "over_cover": robot.over_cover,
        "links_without_geometry": robot.bare_links,
        "checked_pairs": checked,
        "allowed_pairs": [
            {"links": links, "reason": reason, "collision_rate": rates.get(links)}
            for links, reason in sorted(allowed.items())
        ],
        "collision_rates": [{"links": links, "collision_rate": rates[links]} for links in checked],
        "collision_samples": robot.survey.samples,
        "notes": robot.notes,
    }
    ready: dict[str, Any] = jsonable(data)
    return ready


def show_robot(console: Console, data: Mapping[str, Any]) -> None:
    """Print the result of `describe`."""
    console.print(f"{data['name']} · tool frame {data['tool_frame']} · {data['source']}", markup=False, soft_wrap=True)
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("joint")
    for heading in LIMITS:
        table.add_column(heading, justify="right")
    for joint in data["joints"]:
        table.add_row(joint["name"], *(_number(joint[key]) for key in LIMITS))
    console.print(table)
    console.print("limits in rad, rad/s, rad/s², rad/s³, N·m (m and N for sliding joints)", style="dim")
    for name, joints in data["groups"].items():
        planned = " (planned)" if name == data["group"] else ""
        console.print(f"group {name}{planned}: {', '.join(joints)}", markup=False)
    if data["dh"] is not None:
        _show_dh(console, data["dh"])
    for name, q in data["configurations"].items():
        console.print(f"configuration {name}: [{', '.join(f'{value:.6g}' for value in q)}]", markup=False)
    for name, value in data["locked"].items():
        console.print(f"locked {name}: {value:.6g}", markup=False)
    links = ", ".join(
        f"{link} ({_geometry(kind, data['over_cover'].get(link))})" for link, kind in data["links"].items()
    )
    console.print(f"links and their collision geometry: {links}", markup=False)
    console.print(f"frames: {', '.join(data['frames'])}", markup=False)
    if data["links_without_geometry"]:
        console.print(f"links without geometry: {', '.join(data['links_without_geometry'])}", markup=False)
    _show_pairs(console, data)
    for note in data["notes"]:
        console.print(f"note: {note}", style="yellow", markup=False, soft_wrap=True)


def _show_pairs(console: Console, data: Mapping[str, Any]) -> None:
    """Print every pair of links that joints move: why it is not checked, if so, and how often it touches."""
    reasons = {tuple(pair["links"]): pair["reason"] for pair in data["allowed_pairs"]}
    counted = reasons_in_words(count_reasons(reasons))
    console.print(f"pairs of links: {len(data['checked_pairs'])} checked; {counted}", markup=False, soft_wrap=True)
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading, side in (("pair", "left"), ("", "left"), (f"touches in {data['collision_samples']} samples", "right")):
        table.add_column(heading, justify="right" if side == "right" else "left")
    for pair in sorted(
        [*data["collision_rates"], *data["allowed_pairs"]],
        key=lambda pair: (-(pair["collision_rate"] or 0.0), pair["links"]),
    ):
        if pair["collision_rate"] is not None:
            word = reasons.get(tuple(pair["links"]), "checked")
            table.add_row(" – ".join(pair["links"]), word, f"{pair['collision_rate']:.1%}")
    console.print(table)


def _geometry(kind: str, over_cover: float | None) -> str:
    """Return the geometry used for a link, and how far it reaches beyond the link's meshes."""
    beyond = "" if over_cover is None or kind == "mesh" else f", at most {over_cover * 1e3:.2g} mm beyond its mesh"
    return f"{kind.replace('_', ' ')}{beyond}"


def _show_dh(console: Console, table: Mapping[str, Any]) -> None:
    console.print(f"Denavit–Hartenberg table, {table['convention']} convention, in m and degrees:", markup=False)
    shown = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("link", "joint"):
        shown.add_column(heading)
    for heading in ("theta", "d", "a", "alpha"):
        shown.add_column(heading, justify="right")
    for row in table["rows"]:
        angles = {key: f"{math.degrees(row[key]):.6g}" for key in ("theta", "alpha")}
        lengths = {key: f"{row[key]:.6g}" for key in ("d", "a")}
        cells = angles | lengths
        for joint, key in (("revolute", "theta"), ("prismatic", "d")):
            if row["joint"] == joint:
                cells[key] = "q" if row[key] == 0 else f"q + {cells[key]}".replace("+ -", "- ")
        shown.add_row(row["name"], row["joint"] or "fixed", *(cells[key] for key in ("theta", "d", "a", "alpha")))
    console.print(shown)


def _number(value: float | None) -> str:
    return "endless" if value is None else f"{value:.6g}"
