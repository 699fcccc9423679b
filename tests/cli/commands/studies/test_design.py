"""`optiplan design`: the table, JSON, files, and study files that say nothing sensible."""

import errno
import json
import os
import re
import signal
import subprocess
import sys

import pytest

from optiplan.cli.output import handling
from tests.waiting import processor_seconds, wait_until

STUDY = """\
version: 1
name: elbow
robot: two_links
parameters:
  upper: {range: [0.2, 0.8], given: 0.3, unit: m}
changes:
  dh.rows.0.a: =upper
  dh.rows.1.a: =1 - upper
tasks:
  - {start: {joints: [0.1, 0.5]}, goal: {joints: [1.0, -0.5]}}
states: {count: 300}
maximise: [manipulability, reach_volume]
minimise: [cycle_time]
search: {population: 4, generations: 2}
proof: {budget: 0.5}
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "study.yaml").write_text(STUDY)
    return tmp_path / "study.yaml"


def test_a_front_is_found_proved_and_written(optiplan, study, tmp_path):
    code, out, _ = optiplan("design", str(study), "--out", str(tmp_path / "out"))
    assert code == 0
    assert "on the front" in out
    assert "given: verified in" in out
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"design.html", "front.pdf", "front.csv", "robot.yaml"}
    assert (tmp_path / "out" / "front.pdf").read_bytes().startswith(b"%PDF")
    page = (tmp_path / "out" / "design.html").read_text()
    assert 'id="d0-0"' in page
    assert 'id="given-0"' in page
    assert 'data-design="d0"' in page
    head, *rows = (tmp_path / "out" / "front.csv").read_text().splitlines()
    assert head.startswith("upper [m],reach_volume [m³],manipulability [1],cycle_time [s]")
    assert any("compromise" in row and row.endswith(",yes") for row in rows)
    assert optiplan("robots", "show", str(tmp_path / "out" / "robot.yaml"))[0] == 0


def test_json_of_a_study_that_asks_too_much(optiplan_json, study):
    study.write_text(STUDY + "require: {reach_volume: {least: 1000}}\n")
    code, data = optiplan_json("design", str(study))
    assert code == data["exit_code"] == 3
    assert data["front"] == []
    assert data["designs"] == 8


def test_a_study_that_no_design_meets_says_what_is_missed(optiplan, study, tmp_path):
    study.write_text(STUDY + "require: {reach_volume: {least: 1000}}\n")
    code, out, _ = optiplan("design", str(study), "--out", str(tmp_path / "out"))
    assert code == 3
    assert re.search(r"none meets .*; of the nearest one: reach_volume [\d.]+, required at least 1000", out)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"design.html", "front.pdf", "front.csv"}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("dh.rows.1.a: =1 - upper", "dh.rows.7.a: =1 - upper", ":8: changes.dh.rows.7.a: a place that the robot"),
        ("=1 - upper", "=1 - uper", ":8: changes.dh.rows.1.a: an unknown name in '=1 - uper'"),
        ("[0.2, 0.8]", "[0.8, 0.2]", ":5: parameters.upper.range: [0.8, 0.2]; expected lower < upper"),
        ("robot: two_links", "robot: panda", ":3: robot: 'panda', which is not given by a Denavit–Hartenberg table"),
        ("manipulability,", "manipulabilty,", "did you mean 'manipulability'?"),
        ("[cycle_time]", "[tip_over]", "tip_over without support"),
        ("joints: [1.0, -0.5]", "joints: [1.0]", ":10: tasks"),
        ("dh.rows.0.a: =upper", "dh.rows.0.a: =upper / 0", ":7: changes.dh.rows.0.a: '=upper / 0'"),
        ("states: {count: 300}", "states: {cuont: 300}", "did you mean 'count'?"),
    ],
)
def test_a_bad_study_names_the_line(optiplan, study, old, new, words):
    assert old in STUDY
    study.write_text(STUDY.replace(old, new))
    code, _, err = optiplan("design", str(study))
    assert code == 2
    assert words in err
    assert "Traceback" not in err


def test_ctrl_c_keeps_what_was_found(study, tmp_path):
    study.write_text(STUDY.replace("generations: 2", "generations: 10000").replace("  - {start", "  # - {start"))
    study.write_text(study.read_text().replace("tasks:\n", "").replace("minimise: [cycle_time]\n", ""))
    command = [sys.executable, "-m", "optiplan", "design", str(study), "--out", str(tmp_path / "out"), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    wait_until(lambda: processor_seconds(process.pid) > 3.0)  # of which the beginning takes less than half
    process.send_signal(signal.SIGINT)
    data = json.loads(process.communicate(timeout=30)[0])
    assert process.returncode == data["exit_code"] == 130
    assert data["ended"] == "interrupted"
    assert data["designs"] > 1
    assert (tmp_path / "out" / "design.html").is_file()


def test_a_given_design_that_cannot_do_a_task_is_told_in_json(optiplan_json, study):
    far = "{pose: {position: [1.0, 0.0, 0.0], rpy: [0, 0, 0]}}"
    task = "tasks: [{start: {joints: [0.1, 0.5]}, goal: " + far + "}]\n"
    study.write_text(re.sub("tasks:\n.*\n", task, STUDY).replace("=1 - upper", "=0.9 - upper"))
    code, data = optiplan_json("design", str(study))
    assert code == data["exit_code"] == 3
    assert [proof["cycle_time"] for proof in data["proofs"]] == [None]


def test_ctrl_c_between_the_proofs_keeps_the_compromise(optiplan, study, tmp_path, monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("optiplan.api.studies.designing.prove_design", pressed)
    code, out, _ = optiplan("design", str(study), "--out", str(tmp_path / "out"))
    assert code == 130
    assert re.search(r"\(interrupted\): .* 0 of \d chosen designs verified", out)
    assert (tmp_path / "out" / "robot.yaml").is_file()
    assert optiplan("design", str(study), "--out", str(tmp_path / "out" / "design.html"))[0] == 2
    study.write_text(STUDY + "require: {reach_volume: {least: 1000}}\n")
    optiplan("design", str(study), "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out" / "robot.yaml").exists()
    (tmp_path / "out" / "robot.yaml").write_text("my own")
    code, _, err = optiplan("design", str(study), "--out", str(tmp_path / "out"))
    assert (code, (tmp_path / "out" / "robot.yaml").read_text()) == (2, "my own")
    assert "robot.yaml: out: a file that no earlier result left there" in err


def test_ctrl_c_waits_while_a_study_is_saved(optiplan, study, tmp_path, monkeypatch):
    def write(folder, *_):
        os.kill(os.getpid(), signal.SIGINT)
        raise OSError(errno.ENOSPC, "no space left on device", str(folder))

    monkeypatch.setattr("optiplan.api.studies.result_folder.write_together", write)
    seen = []
    with handling((signal.SIGINT,), lambda *_: seen.append("pressed")):
        code, out, err = optiplan("design", str(study), "--out", str(tmp_path / "out"))
    assert (code, seen) == (2, ["pressed"])
    assert "on the front" in out
    assert "not saved: " in err
    assert "no space left on device" in err


def test_ctrl_c_before_the_first_design_is_no_fault(optiplan, study, monkeypatch):
    def pressed(self, x):
        raise KeyboardInterrupt

    monkeypatch.setattr("optiplan.studies.search.DesignJudge.design", pressed)
    code, out, err = optiplan("design", str(study))
    assert (code, out) == (130, "")
    assert "interrupted: no design was measured" in err
