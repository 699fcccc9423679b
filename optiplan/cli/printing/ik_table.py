"""Print the solutions of `optiplan ik`."""

import math
import re
from collections.abc import Mapping
from typing import Any

import pinocchio as pin
from rich.console import Console
from rich.table import Table

from optiplan.kinematics.ik.solve import Answer
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot


def describe(robot: Robot, frame: str, answer: Answer, every: bool) -> dict[str, Any]:
    """Return the `ik --json` output: all solutions, or the best within limits; else `reason` and `nearest`."""
    chosen = answer.solutions if every else [s for s in answer.solutions[:1] if s.within_limits]
    solutions = [
        {
            "q": s.q.tolist(),
            "branch": s.branch,
            "within_limits": s.within_limits,
            "error": max(s.error),
            "singular": list(s.singular),
            "images": [values.tolist() for values in s.images],
        }
        for s in chosen
    ]
    data: dict[str, Any] = {"frame": frame, "joint_names": list(robot.joint_names), "solutions": solutions}
    if answer.nearest is not None:
        miss = answer.nearest
        X_WF = frame_pose(robot, miss.nearest, frame)
        data["reason"] = answer.reason
        data["nearest"] = {
            "pose": [*X_WF.translation.tolist(), *pin.rpy.matrixToRpy(X_WF.rotation).tolist()],
            "q": miss.nearest.tolist(),
            "position_error": miss.position_error,
            "orientation_error": miss.orientation_error,
        }
    return data


def show(console: Console, data: Mapping[str, Any]) -> None:
    """Print the result of `describe`."""
    if data["solutions"]:
        _show_solutions(console, data)
    if "nearest" in data:
        nearest = data["nearest"]
        console.print(f"no solution within limits: {data['reason']}", style="red", markup=False, soft_wrap=True)
        console.print(f"nearest pose: {','.join(f'{value:.6g}' for value in nearest['pose'])}", markup=False)
        console.print(f"  at q: [{', '.join(f'{value:.6g}' for value in nearest['q'])}]", markup=False, soft_wrap=True)


def _show_solutions(console: Console, data: Mapping[str, Any]) -> None:
    solutions = data["solutions"]
    table = Table(box=None, pad_edge=False, padding=(0, 1), collapse_padding=True, header_style="dim")
    table.add_column("branch")
    for k, _ in enumerate(data["joint_names"], 1):
        table.add_column(f"q{k}", justify="right", no_wrap=True)
    table.add_column("images", justify="right")
    for s in solutions:
        branch = re.sub("shoulder |elbow |wrist ", "", s["branch"]) + "*" * bool(s["singular"])
        count = str(math.prod(map(len, s["images"]))) if s["within_limits"] else "[yellow]outside[/]"
        table.add_row(branch, *(f"{value:.4f}" for value in s["q"]), count)
    console.print(table)
    lines = [
        f"q: {', '.join(data['joint_names'])}; rad, m for sliding joints; frame {data['frame']}",
        f"branch: shoulder, elbow, wrist; error at most {max(s['error'] for s in solutions):.1g} m and rad",
        "images: how many configurations within the limits are the same up to whole turns; outside: none",
    ]
    singular = sorted({name for s in solutions for name in s["singular"]})
    if singular:
        lines.append(f"*: singular ({', '.join(singular)}); a joint may be free there, and q is one representative")
    for line in lines:
        console.print(line, style="dim", markup=False, soft_wrap=True)
