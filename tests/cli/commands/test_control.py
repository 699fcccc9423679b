"""`optiplan control`: verdict first, exit codes, log folders that `view` plays."""

import errno
import json

import pytest

from optiplan.cli.main import run

LOOP = """version: 1
robot: planar2r
start: {joints: [0.1, 0.2]}
reference:
  step: {joint: shoulder, by: 0.2, lasting: 0.5}
controller:
  computed_torque: {frequency: 5}
"""
FENCE = """scene:
  obstacles: [{name: fence, shape: {box: [0.05, 0.05, 0.05]}, pose: {position: [0.75, 0.35, 0]}}]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "loop.yaml"
    path.write_text(LOOP)
    return path


def test_it_runs_tells_and_keeps(file, tmp_path, capsys):
    assert run(["control", str(file), "--out", str(tmp_path / "log")]) == 0
    told = capsys.readouterr().out
    assert told.startswith("ran to its end")
    assert "step of shoulder: rise" in told
    names = {path.name for path in (tmp_path / "log").iterdir()}
    assert names == {"run.json", "trajectory.json", "log.npz", "error.svg", "limits.svg"}


def test_json_is_one_object(file, capsys):
    assert run(["control", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["clean"], told["exit_code"]) == (True, 0)
    assert told["execution"]["tracking"]["rms"][0] > 0.0
    assert told["step_response"]["shoulder"]["overshoot"] < 0.05


def test_bad_input_is_2_and_names_the_line(file, tmp_path, capsys):
    file.write_text(LOOP.replace("frequency: 5", "frequency: fast"))
    assert run(["control", str(file), "--out", str(tmp_path / "log")]) == 2
    assert "loop.yaml:7: controller.computed_torque.frequency:" in capsys.readouterr().err
    assert not (tmp_path / "log").exists()
    assert run(["control", "no_such_loop"]) == 2
    assert "panda_shelf" in capsys.readouterr().err


def test_contact_is_4(tmp_path, capsys):
    """The wrist of the Panda is asked to go through a post."""
    file = tmp_path / "loop.yaml"
    file.write_text("""version: 1
robot: panda
start: {configuration: ready}
scene:
  obstacles: [{name: post, shape: {cylinder: {radius: 0.03, length: 1}}, pose: {position: [0.25, 0.25, 0.5]}}]
reference: {step: {joint: panda_joint1, by: 1.2, lasting: 1.5}}
controller: {computed_torque: {frequency: 1}}
""")
    assert run(["control", str(file)]) == 4
    assert "contact: " in capsys.readouterr().out


def test_a_reference_that_cannot_be_planned_is_3(tmp_path, capsys):
    problem = tmp_path / "problem.yaml"
    problem.write_text("""version: 1
robot: planar2r
start: {joints: [0.1, 0.2]}
goal: {joints: [2.0, 0.2]}
planner: {name: quintic}
scene:
  obstacles: [{name: post, shape: {sphere: 0.1}, pose: {position: [0.49, 0.18, -0.48]}}]
""")
    file = tmp_path / "loop.yaml"
    text = "version: 1\nproblem: problem.yaml\nreference: {plan: {budget: 2}}\n"
    file.write_text(text + "controller: {computed_torque: {}}\n")
    log = tmp_path / "log"
    log.mkdir()
    for name in ("log.npz", "slack.svg"):
        (log / name).write_text("of another simulation")
    assert run(["control", str(file), "--out", str(log)]) == 3
    assert "no motion to follow: " in capsys.readouterr().out
    assert [path.name for path in log.iterdir()] == ["run.json"]
    assert run(["view", str(log), "--export", str(tmp_path / "page.html")]) == 0


def test_a_log_that_cannot_be_saved_is_told_all_the_same(file, tmp_path, capsys, monkeypatch):
    log = tmp_path / "log"
    assert run(["control", str(file), "--out", str(log)]) == 0
    earlier = {path.name: path.read_bytes() for path in log.iterdir()}
    capsys.readouterr()
    files = iter(range(9))

    def full(_):
        if next(files) >= 2:  # those of two files are on the disk
            raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setattr("os.fsync", full)
    assert run(["control", str(file), "--out", str(tmp_path / "log")]) == 2
    told = capsys.readouterr()
    assert told.out.startswith("ran to its end")
    assert "written" not in told.out
    assert "no space left on device" in told.err
    assert run(["control", str(file), "--out", str(tmp_path / "log"), "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert (told["clean"], told["exit_code"]) == (True, 2)
    assert "no space left on device" in told["error"]
    assert {path.name: path.read_bytes() for path in log.iterdir()} == earlier


def test_view_plays_a_log(file, tmp_path, capsys):
    assert run(["control", str(file), "--out", str(tmp_path / "log")]) == 0
    assert run(["view", str(tmp_path / "log"), "--export", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text()
    assert "computed_torque (own)" in page
    assert "executed" in page
