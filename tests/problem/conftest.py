from pathlib import Path

import pytest

ARM = Path(__file__).parent / "arm" / "robot.yaml"

PROBLEM = f"""\
version: 1
robot: {ARM}
start: {{joints: [0, 0]}}
goal: {{joints: [1, 0.5]}}
scene:
  obstacles:
    - name: ball
      shape: {{sphere: 0.1}}
      pose: {{position: [0, 2, 0]}}
  attached: []
  allowed_collisions: []
seed: 0
"""


@pytest.fixture(scope="session")
def arm() -> Path:
    """A robot file: two planned joints about z, links of 0.5 m along x, a locked finger."""
    return ARM


@pytest.fixture
def write(tmp_path):
    """Write a problem file in which one text stands for another; returns its path."""

    def write(old: str = "", new: str = "") -> Path:
        assert old in PROBLEM
        path = tmp_path / "case.yaml"
        path.write_text(PROBLEM.replace(old, new, 1))
        return path

    return write
