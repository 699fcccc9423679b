"""Problems of the command line's tests, small enough to plan in a blink, and a way to run commands in this process."""

import json

import pytest

from optiplan.cli.main import run

FREE = """\
version: 1
name: free
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [-0.5, 1.2]}
scene: {obstacles: [{name: far, shape: {sphere: 0.1}, pose: {position: [-1, 0.18, 1]}}]}
planner: quintic
"""

SHUT_IN = """\
version: 1
name: shut-in
robot: planar2r
start: {joints: [0.9, 0.5]}
goal: {joints: [-1.5708, 0]}
scene:
  obstacles:
    - {name: ceiling, shape: {box: [3.0, 0.1, 0.04]}, pose: {position: [0, 0.2, 0.75]}}
planner: rrtconnect
"""


@pytest.fixture
def free(tmp_path):
    """A problem with nothing in the way of the straight motion."""
    path = tmp_path / "free.yaml"
    path.write_text(FREE)
    return path


@pytest.fixture
def shut_in(tmp_path):
    """A problem without a solution, whose search does not end by itself."""
    path = tmp_path / "shut-in.yaml"
    path.write_text(SHUT_IN)
    return path


@pytest.fixture
def optiplan(capfd):
    """Runs a command: exit code, stdout, stderr."""

    def command(*arguments):
        capfd.readouterr()
        code = run([str(argument) for argument in arguments])
        return (code, *capfd.readouterr())

    return command


@pytest.fixture
def optiplan_json(optiplan):
    """Runs a command with --json: exit code and the one object that it printed."""

    def command(*arguments):
        code, out, _ = optiplan(*arguments, "--json")
        assert out.count("\n") == 1
        return code, json.loads(out, parse_constant=pytest.fail)

    return command
