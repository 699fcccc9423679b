"""The arm that the Baxter report calculates with, `robots/baxter_report`, without its joint limits."""

import re
from pathlib import Path

from optiplan.resources import robots_dir
from optiplan.robot.robot import Robot, load_robot

NAMES = ("S0", "S1", "E0", "E1", "W0", "W1", "W2")


def free_report_arm(folder: Path, limit: float) -> Robot:
    """Every joint turns from -limit to limit, rad."""
    text = (robots_dir() / "baxter_report" / "arm.urdf").read_text()
    text, count = re.subn(r'lower="[^"]+" upper="[^"]+"', f'lower="{-limit}" upper="{limit}"', text)
    assert count == len(NAMES)
    (folder / "arm.urdf").write_text(text)
    (folder / "robot.yaml").write_text(
        "version: 1\nname: free_report_arm\nurdf: arm.urdf\ntool_frame: W2_link\ncollision: none\n"
    )
    return load_robot(str(folder / "robot.yaml"))
