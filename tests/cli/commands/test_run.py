"""`optiplan run`: verdict first, exit codes, stored runs, and Ctrl-C as the proved stop."""

import io
import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from rich.console import Console

from optiplan.cli.printing.executed import show_execution
from optiplan.execution.drivers.csv_file import FileDriver

SLOW = ["--rate", "100", "--patience", "0.1"]
"""As a busy machine keeps it."""


def test_a_motion_is_planned_and_run(free, optiplan_json, tmp_path):
    table = tmp_path / "motion.csv"
    code, done = optiplan_json("run", free, "--driver", "file", "--to", table, "--override", "0.8", *SLOW)
    assert code == done["exit_code"] == (0 if done["phase"] == "done" else 4)
    assert (done["name"], done["driver"], done["rate"], done["override"]) == ("free", "file", 100.0, 0.8)
    assert done["lateness"]["max"] >= 0.0
    assert table.exists() == (done["phase"] == "done")
    written = str(table) + ("" if table.exists() else ".partial")
    assert done["report"]["file"] == written
    show_execution(Console(file=(shown := io.StringIO())), done)
    assert f"written: {written}\n" in shown.getvalue()


def test_a_stored_run_is_run_in_the_simulation(free, optiplan, tmp_path):
    folder = tmp_path / "run"
    assert optiplan("plan", free, "--out", folder)[0] == 0
    code, out, _ = optiplan("run", folder, "--engine", "ideal", *SLOW)
    if code == 0:  # the machine had 0.1 s for us at all times
        assert out.startswith("done in ")
        assert "free · planar2r · driver sim at 100 Hz\n" in out
    else:
        assert out.startswith("stopped at ")
    assert "tracking error" in out
    assert "contacts        none" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--driver", "simm"], "unknown driver 'simm'; choose from: file, ros2_control, sim, ur_rtde (did you mean"),
        (["--engine", "bullet"], "engine: found the str 'bullet'; expected one of: mujoco, own, ideal"),
        (["--driver", "file", "--host", "robot"], "expected an option of 'file': path, rate"),
        (["--driver", "ur_rtde"], "an arm of 6 joints"),
        (["--driver", "file", "--to", "x.csv", "--patience", "3"], "patience: found the float 3.0"),
        (["--override", "2"], "'--override'"),
        (["--override", "0"], "--override: at 0 the robot stands for ever; expected more, or --view"),
        (["--deviation", "0"], "'--deviation': expected a number above 0, rad or m"),
        (["--rate", "1e9"], "rate: found the float 1000000000.0; expected 30 to 2000 Hz"),
    ],
)
def test_what_cannot_be_is_2(free, optiplan, arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = optiplan("run", free, *arguments)
    assert code == 2
    assert words in err


def test_a_driver_without_an_option_of_a_rate_is_run_at_that_rate(free, optiplan_json, tmp_path, monkeypatch):
    class Own(FileDriver):
        def __init__(self, run):
            super().__init__(run, path=tmp_path / "motion.csv")

    monkeypatch.setattr("optiplan.execution.drivers.csv_file.FileDriver", Own)
    code, done = optiplan_json("run", free, "--driver", "file", "--rate", "50")
    assert (code, done["rate"]) == (0, 50.0)


def test_an_option_of_the_file_is_told_with_its_line(free, optiplan):
    for option in ("nonsense: 3", "goals: -2"):
        free.write_text(free.read_text().replace("planner: quintic", f"planner: {{name: quintic, {option}}}"))
        code, _, err = optiplan("run", free)
        assert code == 2
        assert err.startswith(f"{free}:7: planner.{option.partition(':')[0]}: ")
        free.write_text(free.read_text().replace(f"planner: {{name: quintic, {option}}}", "planner: quintic"))


def test_no_motion_is_3(shut_in, optiplan, optiplan_json):
    code, _, err = optiplan("run", shut_in, "--budget", "0.5")
    assert code == 3
    assert "no motion to run" in err
    code, told = optiplan_json("run", shut_in, "--budget", "0.5")
    assert code == told["exit_code"] == 3
    assert "no motion to run" in told["error"]


def test_a_stored_run_has_its_planner(free, optiplan, tmp_path):
    assert optiplan("plan", free, "--out", tmp_path / "run")[0] == 0
    for flag, value in (("--planner", "quintic"), ("--budget", "3")):
        code, _, err = optiplan("run", tmp_path / "run", flag, value)
        assert code == 2
        assert f"{flag}: goes with a problem, not with the folder of a run" in err


def test_ctrl_c_stops_along_the_path(free, tmp_path):
    """And the program says where, and ends with 130."""
    table = tmp_path / "motion.csv"
    command = [sys.executable, "-m", "optiplan", "run", str(free), "--driver", "file", "--to", str(table), "--json"]
    process = subprocess.Popen([*command, "--override", "0.02", *SLOW], stdout=subprocess.PIPE, text=True)
    partial = tmp_path / "motion.csv.partial"
    began = time.monotonic()
    while not (partial.exists() and partial.stat().st_size > 20_000) and time.monotonic() < began + 60.0:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60.0)
    assert process.returncode == 130
    done = json.loads(out)
    assert (done["phase"], done["reason"], done["exit_code"]) == ("stopped", "Ctrl-C", 130)
    rows = np.loadtxt(partial, delimiter=",", skiprows=1)
    assert np.abs(rows[-1, 3:5]).max() == 0.0  # at rest
