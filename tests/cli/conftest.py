"""Problems of the command line's tests, small enough to plan in a blink, and a way to run commands in this process."""

import json

import pytest

from optiplan.cli.main import run as run_command
from tests.small_problems import NO_WAY, QUICK


@pytest.fixture
def free(tmp_path):
    """A problem with nothing in the way of the straight motion."""
    path = tmp_path / "free.yaml"
    path.write_text(QUICK)
    return path


@pytest.fixture
def shut_in(tmp_path):
    """A problem without a solution, whose search does not end by itself."""
    path = tmp_path / "shut-in.yaml"
    path.write_text(NO_WAY)
    return path


@pytest.fixture
def optiplan(capfd):
    """Runs a command: exit code, stdout, stderr."""

    def command(*arguments):
        capfd.readouterr()
        code = run_command([str(argument) for argument in arguments])
        return (code, *capfd.readouterr())

    return command


@pytest.fixture
def run(optiplan, free, tmp_path):
    """The folder of a stored run of `free`."""
    assert optiplan("plan", free, "--out", tmp_path / "run")[0] == 0
    return tmp_path / "run"


@pytest.fixture
def optiplan_json(optiplan):
    """Runs a command with --json: exit code and the one object that it printed."""

    def command(*arguments):
        code, out, _ = optiplan(*arguments, "--json")
        assert out.count("\n") == 1
        return code, json.loads(out, parse_constant=pytest.fail)

    return command
