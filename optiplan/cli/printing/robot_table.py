"""Print a robot for `optiplan robots show`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console

from optiplan.cli.output import plain_table
from optiplan.config.messages import some
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_survey import OFTEN
from optiplan.robot.self_collision.pairs import count_reasons, reasons_in_words
from optiplan.verify.report import jsonable

FEW = {"joints": 12, "groups": 4, "configurations": 4, "pairs": 12, "notes": 8}
"""What is printed of each where not all is asked for."""

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
        "touching_pairs": robot.survey.often_touching(robot.allowed),
        "collision_samples": robot.survey.samples,
        "notes": robot.notes,
    }
    ready: dict[str, Any] = jsonable(data)
    return ready


def show_robot(console: Console, data: Mapping[str, Any], full: bool = True) -> None:
    """Print the result of `describe`: all of it, or what fits on a page."""
    console.print(f"{data['name']} · tool frame {data['tool_frame']} · {data['source']}", markup=False, soft_wrap=True)
    table = plain_table(("joint",), LIMITS)
    for joint in _some(data["joints"], "joints", full):
        table.add_row(joint["name"], *(_number(joint[key]) for key in LIMITS))
    _show_touching(console, data)
    console.print(table, markup=False)
    _left_out(console, data["joints"], "joints", full)
    console.print("limits in rad, rad/s, rad/s², rad/s³, N·m (m and N for sliding joints)", style="dim")
    for name, joints in _some(list(data["groups"].items()), "groups", full):
        planned = " (planned)" if name == data["group"] else ""
        console.print(f"group {name}{planned}: {', '.join(joints)}", markup=False)
    if data["dh"] is not None:
        _show_dh(console, data["dh"])
    for name, q in _some(list(data["configurations"].items()), "configurations", full):
        console.print(f"configuration {name}: [{', '.join(f'{value:.6g}' for value in q)}]", markup=False)
    if full:
        _show_links(console, data)
    else:
        counted = f"joints locked: {len(data['locked'])}, links with bodies: {len(data['links'])}"
        console.print(f"{counted}, frames: {len(data['frames'])} (all of them: --full)", style="dim")
    _show_pairs(console, data, full)
    for note in _some(data["notes"], "notes", full):
        console.print(f"note: {note}", style="yellow", markup=False, soft_wrap=True)
    _left_out(console, data["notes"], "notes", full)


def _show_links(console: Console, data: Mapping[str, Any]) -> None:
    """Print locked joints, links with their geometry, and frames."""
    for name, value in data["locked"].items():
        console.print(f"locked {name}: {value:.6g}", markup=False)
    links = ", ".join(
        f"{link} ({_geometry(kind, data['over_cover'].get(link))})" for link, kind in data["links"].items()
    )
    console.print(f"links and their collision geometry: {links}", markup=False)
    console.print(f"frames: {', '.join(data['frames'])}", markup=False)
    if data["links_without_geometry"]:
        console.print(f"links without geometry: {', '.join(data['links_without_geometry'])}", markup=False)


def _show_touching(console: Console, data: Mapping[str, Any]) -> None:
    """Print the pairs that are checked and touch often, and what allows them."""
    pairs = data["touching_pairs"]
    if not pairs:
        return
    rates = {tuple(pair["links"]): pair["collision_rate"] for pair in data["collision_rates"]}
    words = some([f"{a} – {b} ({rates[a, b]:.0%})" for a, b in pairs], FEW["pairs"])
    console.print(f"checked, though they touch in more than {OFTEN:.0%} of configurations:", style="yellow")
    console.print(f"  {words}", style="yellow", markup=False, soft_wrap=True)
    cure = "where they are built so: `robots init --allow-pairs touching`, or `allowed_collisions` in the robot.yaml"
    console.print(f"  {cure}", style="yellow", markup=False, soft_wrap=True)


def _some(values: Sequence[Any], key: str, full: bool) -> Sequence[Any]:
    return values if full else values[: FEW[key]]


def _left_out(console: Console, values: Sequence[Any], key: str, full: bool) -> None:
    """Say how many there are more."""
    if not full and len(values) > FEW[key]:
        console.print(f"and {len(values) - FEW[key]} more {key} (--full)", style="dim")


def _show_pairs(console: Console, data: Mapping[str, Any], full: bool) -> None:
    """Print pairs of links that joints move: why one is not checked, if so, and how often it touches."""
    reasons = {tuple(pair["links"]): pair["reason"] for pair in data["allowed_pairs"]}
    counted = reasons_in_words(count_reasons(reasons))
    console.print(f"pairs of links: {len(data['checked_pairs'])} checked; {counted}", markup=False, soft_wrap=True)
    table = plain_table(("pair", ""), (f"touches in {data['collision_samples']} samples",))
    touching = [tuple(pair) for pair in data["touching_pairs"]]
    known = [pair for pair in [*data["collision_rates"], *data["allowed_pairs"]] if pair["collision_rate"] is not None]
    known.sort(key=lambda pair: (tuple(pair["links"]) not in touching, -pair["collision_rate"], pair["links"]))
    for pair in _some(known, "pairs", full):
        word = reasons.get(tuple(pair["links"]), "checked")
        table.add_row(" – ".join(pair["links"]), word, f"{pair['collision_rate']:.1%}")
    if known:
        console.print(table, markup=False)
    _left_out(console, known, "pairs", full)


def _geometry(kind: str, over_cover: float | None) -> str:
    """Return the geometry used for a link, and how far it reaches beyond the link's meshes."""
    beyond = "" if over_cover is None or kind == "mesh" else f", at most {over_cover * 1e3:.2g} mm beyond its mesh"
    return f"{kind.replace('_', ' ')}{beyond}"


def _show_dh(console: Console, table: Mapping[str, Any]) -> None:
    console.print(f"Denavit–Hartenberg table, {table['convention']} convention, in m and degrees:", markup=False)
    shown = plain_table(("link", "joint"), ("theta", "d", "a", "alpha"))
    for row in table["rows"]:
        angles = {key: f"{math.degrees(row[key]):.6g}" for key in ("theta", "alpha")}
        lengths = {key: f"{row[key]:.6g}" for key in ("d", "a")}
        cells = angles | lengths
        for joint, key in (("revolute", "theta"), ("prismatic", "d")):
            if row["joint"] == joint:
                cells[key] = "q" if row[key] == 0 else f"q + {cells[key]}".replace("+ -", "- ")
        shown.add_row(row["name"], row["joint"] or "fixed", *(cells[key] for key in ("theta", "d", "a", "alpha")))
    console.print(shown, markup=False)


def _number(value: float | None) -> str:
    return "endless" if value is None else f"{value:.6g}"
