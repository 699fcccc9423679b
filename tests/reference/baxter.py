"""The arm that the Baxter report calculates with, as a robot: seven lengths, x to the right, y along the arm, z up."""

from pathlib import Path

from optiplan.robot.robot import Robot, load_robot
from tests.reference.entries import entry

NAMES = ("S0", "S1", "E0", "E1", "W0", "W1", "W2")


def report_arm(folder: Path, lower: list[float], upper: list[float]) -> Robot:
    """Joint by joint: where it is in the one before, and about which axis it turns; the tool is at the end of l6."""
    size = entry("sclerp.baxter.geometry")["links"]
    steps = [(0.0, size["l0"]), (size["l1"], 0.0), (size["l2"], 0.0), (0.0, -size["l23"])]
    steps += [(size["l4"], 0.0), (0.0, -size["l45"]), (size["l6"], 0.0)]
    axes = ("0 0 1", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0")
    parts = ['<link name="base"/>']
    for i, (name, (y, z), axis) in enumerate(zip(NAMES, steps, axes, strict=True)):
        ends = f'<parent link="{NAMES[i - 1] + "_link" if i else "base"}"/><child link="{name}_link"/>'
        limit = f'<limit lower="{lower[i]}" upper="{upper[i]}" velocity="2" effort="50"/>'
        place = f'<origin xyz="0 {y} {z}"/><axis xyz="{axis}"/>'
        parts += [f'<joint name="{name}" type="revolute">{ends}{place}{limit}</joint>', f'<link name="{name}_link"/>']
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    (folder / "robot.yaml").write_text(
        "version: 1\nname: report_arm\nurdf: arm.urdf\ntool_frame: W2_link\ncollision: none\n"
    )
    return load_robot(str(folder / "robot.yaml"))
