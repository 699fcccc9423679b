"""What every adapter needs: the question from standard input, the answer to standard output."""

import json
import os
import sys
import xml.etree.ElementTree as ET

import numpy as np

Question = dict
_STDOUT = os.dup(1)
os.dup2(2, 1)  # what libraries print is no answer


def question() -> Question:
    """The problem: see README.md."""
    return json.load(sys.stdin)


def answer(**parts: object) -> None:
    """Write the one answer."""
    with os.fdopen(_STDOUT, "w") as file:
        file.write(json.dumps(parts) + "\n")


def refuse(why: str) -> None:
    """Answer that there is no plan, and end."""
    answer(failure=why)
    sys.exit(0)


def locked_urdf(asked: Question) -> str:
    """The URDF with joints that are not planned fixed where they stand; turned ones only at 0."""
    root = ET.fromstring(asked["urdf"])
    for joint in root.findall("joint"):
        name = joint.get("name")
        if joint.get("type") == "fixed" or name in asked["joints"]:
            continue
        value, axis = asked["locked"].get(name, 0.0), joint.find("axis")
        if value and joint.get("type") != "prismatic":
            refuse(f"joint {name} stands at {value} rad: only sliding joints are moved by this adapter")
        origin = joint.find("origin")
        origin = ET.SubElement(joint, "origin", xyz="0 0 0", rpy="0 0 0") if origin is None else origin
        along = np.array([float(x) for x in (axis.get("xyz") if axis is not None else "1 0 0").split()])
        place = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
        shift = rotation(origin.get("rpy", "0 0 0")) @ along * value
        origin.set("xyz", " ".join(map(repr, map(float, place + shift))))
        joint.set("type", "fixed")
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    return ET.tostring(root, encoding="unicode")


def rotation(rpy: str) -> np.ndarray:
    """Rotation matrix of a URDF's roll, pitch, yaw: Rz(y) Ry(p) Rx(r)."""
    (cr, cp, cy), (sr, sp, sy) = (f([float(x) for x in rpy.split()]) for f in (np.cos, np.sin))
    return (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )


def rolled_out(steps: np.ndarray, period: float) -> dict:
    """A controller's configurations (k, n), one each `period` in s, as `samples` of their quadratic B-spline.

    Halfway between two steps it has their mean and their difference / period; from there to the next halfway point the
    acceleration is the difference of two commands / period, so that what the commands keep, the motion keeps. The ends
    are met at rest.
    """
    q = np.concatenate([steps[:1], steps, steps[-1:]])
    return {
        "times": (period * np.arange(len(q) - 1)).tolist(),
        "positions": ((q[1:] + q[:-1]) / 2).tolist(),
        "velocities": (np.diff(q, axis=0) / period).tolist(),
    }
