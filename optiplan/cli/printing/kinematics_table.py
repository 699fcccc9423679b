"""Print pose, Jacobians, measures and singularities of `optiplan kinematics`."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from optiplan.arrays import Array, finite_or_none
from optiplan.geometry.poses import pose_to_data
from optiplan.kinematics.jacobians import analytic_jacobian
from optiplan.kinematics.manipulability import ROWS, JacobianRows, ellipsoids, manipulability_measures
from optiplan.kinematics.mecanum import WHEELS, wheel_matrix
from optiplan.kinematics.singularities import NAMES, singularity_model
from optiplan.kinematics.symbolic.text import LEGEND, symbolic_text
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.robot import Robot
from optiplan.verify.report import jsonable

SINGULAR = 1e-9
"""A singular value of the full Jacobian (lengths in m) below this is rounding: the rank is lost."""
NEAR = 1e-3
"""A factor of the determinant, without unit, up to this is called singular, as in `optiplan ik`."""
COLUMNS = 7
"""Joints side by side, so that a table is at most 80 columns wide."""
WIDTH = 78
GEOMETRIC = ("vx", "vy", "vz", "wx", "wy", "wz")
UNITS = ("m", "m²", "")
"""Of the factors shoulder, elbow and wrist."""


def describe(robot: Robot, q: Array, velocity: Array | None = None) -> dict[str, Any]:
    """Return the `kinematics --json` output for the tool frame at q (n,), and at joint velocities (n,) if given."""
    X_WF, J = frame_pose(robot, q, robot.tool_frame), geometric_jacobian(robot, q, robot.tool_frame)
    analytic, reason = _analytic(robot, q)
    rank = int((np.linalg.svd(J, compute_uv=False) > SINGULAR).sum())
    outside = robot.limits.outside(q)
    data: dict[str, Any] = {
        "robot": robot.name,
        "group": robot.group,
        "frame": robot.tool_frame,
        "joint_names": robot.joint_names,
        "q": q,
        "configuration": next((name for name, known in robot.configurations.items() if np.array_equal(known, q)), None),
        "outside_limits": [name for name, out in zip(robot.joint_names, outside, strict=True) if out],
        "pose": {
            "matrix": X_WF.homogeneous,
            "rpy": pin.rpy.matrixToRpy(X_WF.rotation),
            **pose_to_data(X_WF),
        },
        "geometric_jacobian": J,
        "analytic_jacobian": analytic,
        "analytic_jacobian_reason": reason,
        "rank": rank,
        "measures": {part: _measures(J[ROWS[part]]) for part in get_args(JacobianRows)},
        "ellipsoids": {part: _ellipsoid(J[ROWS[part]]) for part in ("translation", "rotation")},
        "singularities": _singularities(robot, q),
    }
    wheels = wheel_matrix(robot, q)
    if wheels is not None:
        data["wheels"] = {"names": WHEELS, "rates_per_joint_velocity": wheels}
    if velocity is not None:
        rpy_rates = None if analytic is None else analytic[3:] @ velocity
        data["velocity"] = {"joints": velocity, "twist": J @ velocity, "rpy_rates": rpy_rates}
        if wheels is not None:
            data["velocity"]["wheel_rates"] = wheels @ velocity
    ready: dict[str, Any] = jsonable(data)
    return ready


def describe_formulas(robot: Robot) -> dict[str, Any]:
    """Return the additional output of `kinematics --symbolic --json`."""
    text = symbolic_text(robot, robot.tool_frame)
    names = list(robot.joint_names)
    return {
        "symbolic": {
            "frame": robot.tool_frame,
            "legend": LEGEND,
            "joint_names": names,
            "pose": text.pose,
            "geometric_jacobian": text.jacobian,
        }
    }


def _analytic(robot: Robot, q: Array) -> tuple[Array | None, str | None]:
    try:
        return analytic_jacobian(robot, q, robot.tool_frame), None
    except ValueError as error:
        return None, str(error)


def _measures(J: Array) -> dict[str, float | None]:
    """Return the measures of the rows J (m, n); the condition number is None where the rank is lost."""
    found = manipulability_measures(J[None])
    asada, smallest = float(found.asada[0]), float(found.smallest[0])
    return {
        "yoshikawa": float(found.yoshikawa[0]),
        "asada": asada,
        "condition": 1.0 / asada if smallest > SINGULAR else None,
        "smallest": smallest,
    }


def _ellipsoid(J: Array) -> dict[str, Any]:
    found = ellipsoids(J[None])
    force = list(map(finite_or_none, found.force[0]))
    return {"axes": found.axes[0].T, "velocity": found.velocity[0], "force": force}


def _singularities(robot: Robot, q: Array) -> dict[str, Any] | None:
    model = singularity_model(robot)
    if model is None:
        return None
    found = model.factors(q[None])
    factors = zip(NAMES, (found.shoulder, found.elbow, found.wrist), found.sines[0], strict=True)
    return {
        name: {"factor": float(value[0]), "relative": float(sine), "singular": bool(abs(sine) <= NEAR)}
        for name, value, sine in factors
    }


def show(console: Console, data: Mapping[str, Any]) -> None:
    """Print the result of `describe`, pose and verdict first."""
    n = len(data["joint_names"])
    q = ", ".join(f"{value:.6g}" for value in data["q"])
    name = f"{data['configuration']} " if data["configuration"] else ""
    _say(console, f"{data['robot']} · frame {data['frame']} · at {name}[{q}]")
    _show_verdict(console, data, min(6, n))
    pose = data["pose"]
    _say(console, f"position x, y, z: {_list(pose['position'])} m")
    _say(console, f"roll, pitch, yaw: {_list(pose['rpy'])} rad, about the fixed axes x, y, z")
    _say(console, f"quaternion x, y, z, w: {_list(pose['quaternion'])}")
    _table(console, "pose", ("", "x", "y", "z", "position"), [["", *row] for row in pose["matrix"]])
    joints = [f"q{k}" for k in range(1, n + 1)]
    _wide(console, "geometric Jacobian", GEOMETRIC, joints, data["geometric_jacobian"])
    if data["analytic_jacobian"] is None:
        _say(console, f"analytic Jacobian: {data['analytic_jacobian_reason']}", "yellow")
    else:
        rates = data["analytic_jacobian"][3:]
        _wide(console, "analytic Jacobian, beside vx, vy, vz", ("roll", "pitch", "yaw"), joints, rates)
    _show_measures(console, data)
    _show_rates(console, data, joints)
    _say(console, f"q: {', '.join(data['joint_names'])}; rad, m for sliding joints", "dim")
    _say(console, "Jacobians in the axes of the base; full: with lengths in m; Asada: 1 / condition", "dim")


def _show_verdict(console: Console, data: Mapping[str, Any], most: int) -> None:
    named = [name for name, found in (data["singularities"] or {}).items() if found["singular"]]
    condition = data["measures"]["full"]["condition"]
    lost = data["rank"] < most
    word = f"singular{': ' * bool(named)}{', '.join(named)}" if lost or named else "regular"
    number = "" if condition is None else f" · condition {condition:.4g}"
    _say(console, f"{word} · rank {data['rank']} of {most}{number}", "red" if lost or named else "green")
    if data["outside_limits"]:
        _say(console, f"outside the limits of: {', '.join(data['outside_limits'])}", "yellow")


def _show_measures(console: Console, data: Mapping[str, Any]) -> None:
    keys = ("yoshikawa", "asada", "condition", "smallest")
    rows = [[part, *(_word(found[key]) for key in keys)] for part, found in data["measures"].items()]
    _table(console, "manipulability", ("", "Yoshikawa", "Asada", "condition", "least s"), rows)
    rows = []
    for part, found in data["ellipsoids"].items():
        for axis, speed, force in zip(found["axes"], found["velocity"], found["force"], strict=True):
            rows.append([part, *axis, _word(speed), "endless" if force is None else _word(force)])
    _table(console, "ellipsoids, half axes", ("", "x", "y", "z", "velocity", "force"), rows)
    if data["singularities"] is not None:
        found = zip(data["singularities"].items(), UNITS, strict=True)
        rows = [[name, f"{one['factor']:.4g} {unit}".strip(), _word(one["relative"])] for (name, one), unit in found]
        _table(console, "singularities", ("", "factor of det J", "0 is singular"), rows)


def _show_rates(console: Console, data: Mapping[str, Any], joints: Sequence[str]) -> None:
    if "wheels" in data:
        matrix = data["wheels"]["rates_per_joint_velocity"]
        used = [k for k in range(len(joints)) if any(row[k] for row in matrix)]
        rows = [[name, *(row[k] for k in used)] for name, row in zip(data["wheels"]["names"], matrix, strict=True)]
        _table(console, "wheel rates per unit velocity", ("", *(joints[k] for k in used)), rows)
    if "velocity" in data:
        moving = data["velocity"]
        _say(console, f"velocity of the tool: {_list(moving['twist'][:3])} m/s, {_list(moving['twist'][3:])} rad/s")
        if moving["rpy_rates"] is not None:
            _say(console, f"rates of roll, pitch, yaw: {_list(moving['rpy_rates'])} rad/s")
        if "wheel_rates" in moving:
            words = zip(data["wheels"]["names"], moving["wheel_rates"], strict=True)
            _say(console, "wheels: " + ", ".join(f"{name} {_word(rate)}" for name, rate in words) + " rad/s")


def show_formulas(console: Console, symbolic: Mapping[str, Any]) -> None:
    """Print every nonzero element on lines of its own: rotation, position, then the columns of the Jacobian."""
    names = ", ".join(f"q{k} {name}" for k, name in enumerate(symbolic["joint_names"], 1))
    _say(console, f"frame {symbolic['frame']}; {symbolic['legend']}")
    _say(console, names, "dim")
    _say(console, "pose: rotation R, position x, y, z")
    for i, row in enumerate(symbolic["pose"][:3], 1):
        for j, text in enumerate(row[:3], 1):
            _formula(console, f"R{i}{j}", text)
    for name, row in zip("xyz", symbolic["pose"], strict=False):
        _formula(console, name, row[3])
    _say(console, "geometric Jacobian: rows vx, vy, vz, wx, wy, wz; columns q1, q2, …")
    for k, _ in enumerate(symbolic["joint_names"]):
        for name, row in zip(GEOMETRIC, symbolic["geometric_jacobian"], strict=True):
            _formula(console, f"{name},q{k + 1}", row[k])
    _say(console, "all other elements are 0", "dim")


def _formula(console: Console, name: str, text: str) -> None:
    if text == "0":
        return
    start = f"  {name:<6}= "
    lines = textwrap.wrap(text, WIDTH - len(start), break_long_words=False, break_on_hyphens=False)
    for k, line in enumerate(lines):
        console.print((start if k == 0 else " " * len(start)) + line, markup=False, soft_wrap=True)


def _wide(
    console: Console, title: str, names: Sequence[str], joints: Sequence[str], matrix: Sequence[Sequence[float]]
) -> None:
    """A matrix, in as many tables as its columns need."""
    for first in range(0, len(joints), COLUMNS):
        part = slice(first, first + COLUMNS)
        rows = [[name, *row[part]] for name, row in zip(names, matrix, strict=True)]
        _table(console, title if first == 0 else "", ("", *joints[part]), rows)


def _table(console: Console, title: str, headings: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    table = Table(box=None, pad_edge=False, padding=(0, 1), collapse_padding=True, header_style="dim")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            *(cell if isinstance(cell, str) else f"{cell + 0.0:.4f}".replace("-0.0000", "0.0000") for cell in row)
        )
    if title:
        console.print(title, style="bold", markup=False)
    console.print(table, markup=False)


def _list(values: Sequence[float]) -> str:
    return ", ".join(_word(value) for value in values)


def _word(value: float | None) -> str:
    """Six digits; a rounding beside zero is zero."""
    if value is None:
        return "–"
    return "0" if abs(value) < 1e-12 else f"{value:.6g}"


def _say(console: Console, text: str, style: str | None = None) -> None:
    console.print(text, style=style, markup=False)
