"""What the figures show as CSV: a row a sample, and the limits with the exact extrema, a row a joint and quantity."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.viewer.plots.joint_figure import QUANTITIES, bounds, extrema_of
from optiplan.viewer.plots.runs import PlottedRun

TOOL = ("x", "y", "z", "qx", "qy", "qz", "qw", "speed", "turning")
"""Columns of the tool: position in the world, m, quaternion, speed, m/s, and angular speed, rad/s."""

LIMITS = ("run", "joint", "quantity", "unit", "lower", "upper", "least", "least_at", "largest", "largest_at")


def write_curves(runs: Sequence[PlottedRun], path: Path) -> None:
    """Write `run`, `t`, `<joint>.<quantity>` of every joint, and `tool.…`; numbers to the last digit."""
    names = runs[0].problem.robot.joint_names
    heads = [f"{joint}.{quantity}" for quantity in QUANTITIES for joint in names]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["run", "t", *heads, *(f"tool.{name}" for name in TOOL)])
        for run in runs:
            curves = run.curves
            table = np.column_stack([curves.t, *curves.joints, curves.torque, _tool(run)])
            writer.writerows([run.label, *row] for row in table.tolist())


def write_limits(runs: Sequence[PlottedRun], path: Path) -> None:
    """Write limits (nothing where there is none), exact extrema (of torques: refined samples) and their times."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(LIMITS)
        for run in runs:
            for quantity in QUANTITIES:
                for joint, name in enumerate(run.problem.robot.joint_names):
                    ends = ["" if np.isinf(value) else value for value in bounds(run, quantity, joint)]
                    in_unit = run.problem.robot.unit(quantity, joint)
                    writer.writerow([run.label, name, quantity, in_unit, *ends, *_extremes(run, quantity, joint)])


def _extremes(run: PlottedRun, quantity: str, joint: int) -> list[float]:
    """Least value and when, largest value and when."""
    e = extrema_of(run, quantity)
    return [float(x[joint]) for x in (e.low, e.t_low, e.high, e.t_high)]


def _tool(run: PlottedRun) -> Array:
    """Columns of `TOOL`, (k, 9); neighbouring quaternions have no jump of sign."""
    curves = run.curves
    quaternions = np.array([pin.Quaternion(X[:3, :3]).coeffs() for X in curves.X_WT])
    turned = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]) < 0.0
    signs = np.cumprod(np.concatenate([[1.0], np.where(turned, -1.0, 1.0)]))
    return np.column_stack([curves.X_WT[:, :3, 3], quaternions * signs[:, None], curves.speed, curves.turning])
