"""`optiplan bound`."""

import json

import pytest

from optiplan.cli.main import run


def test_a_bound_is_printed_with_how_far_a_run_is_from_the_optimum(tmp_path, capsys):
    assert run(["plan", "12_planar", "--budget", "3", "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    assert run(["bound", "12_planar", "--run", str(tmp_path / "run"), "--budget", "1"]) == 0
    said = capsys.readouterr().out
    assert "% from the optimum, proved: no motion is shorter than" in said
    assert run(["bound", "12_planar", "--budget", "0.5", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["seconds"] >= found["alone"] > 0.0
    assert found["gap"] is None


def test_a_run_without_a_motion_is_refused(tmp_path, capsys, shut_in):
    assert run(["plan", str(shut_in), "--planner", "quintic", "--out", str(tmp_path / "run")]) == 3
    assert run(["bound", str(shut_in), "--run", str(tmp_path / "run"), "--budget", "0.5"]) == 2
    assert "run: a run without a motion; expected one with a motion" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["bound", "08_pose"], ["plan", "08_pose", "--bound", "5"]])
def test_what_no_bound_is_known_of_is_bad_input_and_named_by_its_file(command, capsys):
    assert run(command) == 2
    assert "08_pose.yaml: goal: found a goal" in capsys.readouterr().err
