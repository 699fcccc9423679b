"""The program as a process: how fast it starts, how it ends on ctrl-C, what it writes where."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PROGRAM = [sys.executable, "-c", "from optiplan.cli.main import main; main()"]
HEAVY = (
    "pinocchio",
    "coal",
    "numpy",
    "scipy",
    "ompl",
    "toppra",
    "trimesh",
    "meshcat",
    "coacd",
    "qpsolvers",
)


def start(*arguments, **options):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*PROGRAM, *map(str, arguments)], env=environment, **pipes, **options)


@pytest.mark.parametrize("planner", ["rrtconnect", "trajopt"])
def test_ctrl_c_ends_at_once_and_leaves_nothing(shut_in, tmp_path, planner):
    process = start("plan", shut_in, "--planner", planner, "--budget", 60, "--out", tmp_path / "run")
    time.sleep(3.0)
    assert process.poll() is None, process.stderr.read()
    began = time.perf_counter()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=10)
    assert time.perf_counter() - began <= 0.5
    assert process.returncode == -signal.SIGINT  # a shell makes 130 of it
    assert (out, err) == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == ["shut-in.yaml"]


def test_no_plan_within_the_budget_is_exit_code_3(shut_in):
    process = start("plan", shut_in, "--budget", "1", "--json")
    out, err = process.communicate(timeout=30)
    data = json.loads(out)
    assert process.returncode == data["exit_code"] == 3
    assert "ceiling" in data["failure"]["witness"]["pair"]
    assert data["timings"]["plan"] < 3.0
    assert err == ""


def test_a_free_space_problem_takes_seconds_from_the_shell():
    """The promise is 2.5 s; the test allows for other tests at work beside it."""
    seconds = []
    for _ in range(3):
        began = time.perf_counter()
        process = start("plan", "01_reach")
        process.communicate(timeout=60)
        seconds.append(time.perf_counter() - began)
        assert process.returncode == 0
    assert min(seconds) < 5.0


@pytest.mark.parametrize("arguments", ["--help", "plan --help"])
def test_help_imports_nothing_heavy(arguments):
    code = (
        "import sys; from optiplan.cli.main import run; "
        f"assert run({arguments.split()!r}) == 0; "
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


@pytest.mark.parametrize("planner", ["quintic", "trajopt"])
def test_plan_imports_only_what_it_needs(planner):
    heavy = [name for name in HEAVY if name not in ("pinocchio", "coal", "numpy")]
    code = (
        "import sys; from optiplan.cli.main import run; "
        f"assert run(['plan', '01_reach', '--planner', {planner!r}]) == 0; "
        f"print([name for name in {[*heavy, 'casadi']!r} if name in sys.modules], file=sys.stderr)"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def test_a_reader_that_goes_away_is_no_error(free):
    process = start("plan", free)
    process.stdout.close()
    err = process.stderr.read()
    process.wait(timeout=30)
    assert "Traceback" not in err
