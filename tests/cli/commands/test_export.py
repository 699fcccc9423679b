import json

import numpy as np
import pytest


@pytest.fixture
def run(optiplan, free, tmp_path):
    assert optiplan("plan", free, "--out", tmp_path / "run")[0] == 0
    return tmp_path / "run"


def test_a_motion_is_written_beside_its_run_and_verified_again(optiplan, run, free):
    code, out, _ = optiplan("export", run, "--to", "csv", "--rate", "1000")
    assert code == 0
    assert f"written: {run / 'motion.csv'}" in out
    assert "verified; " in out
    assert "quintic" in out
    rows = np.genfromtxt(run / "motion.csv", delimiter=",", names=True)
    assert np.diff(rows["t"]).max() <= 1e-3 + 1e-9
    assert optiplan("verify", free, run / "motion.csv")[0] == 0


def test_a_cycle_is_kept_exactly(optiplan, run):
    assert optiplan("export", run, "--to", "csv", "--rate", "250", "--cyclic")[0] == 0
    rows = np.genfromtxt(run / "motion.csv", delimiter=",", names=True)
    assert np.diff(rows["t"]) == pytest.approx(0.004, abs=1e-12)


def test_messages_of_ros_go_where_they_are_told(optiplan, run, tmp_path):
    code, out, _ = optiplan("export", run, "--to", "ros", "--out", tmp_path / "new" / "message.json")
    assert code == 0
    assert str(tmp_path / "new" / "message.json") in out
    assert json.loads((tmp_path / "new" / "message.json").read_text())["points"]


def test_a_motion_that_is_not_verified_is_not_written(optiplan, run):
    motion = json.loads((run / "trajectory.json").read_text())
    pieces = motion["pieces"]
    pieces["breakpoints"] = (0.2 * np.array(pieces["breakpoints"])).tolist()
    c = np.array(pieces["coefficients"])
    pieces["coefficients"] = (c * 5.0 ** np.arange(c.shape[1])[:, None]).tolist()
    (run / "trajectory.json").write_text(json.dumps({"joint_names": motion["joint_names"], "pieces": pieces}))
    code, out, err = optiplan("export", run, "--to", "csv")
    assert (code, out) == (4, "")
    assert "not verified; nothing was written" in err
    assert not (run / "motion.csv").exists()
    code, out, _ = optiplan("export", run, "--to", "csv", "--unverified")
    assert code == 4
    assert "NOT verified" in out
    assert (run / "motion.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "krl"], "expected one of: csv, json, npz, ros, urscript"),
        (["--to", "csv", "--rate", "0"], "a number of samples a second"),
        (["--to", "urscript"], "of urscript: one of the six joints"),
    ],
)
def test_bad_input_ends_with_2_and_writes_nothing(optiplan, run, arguments, words):
    before = sorted(run.iterdir())
    code, _, err = optiplan("export", run, *arguments)
    assert code == 2
    assert words in err
    assert sorted(run.iterdir()) == before


def test_a_run_without_a_motion_ends_with_3(optiplan, shut_in, tmp_path):
    optiplan("plan", shut_in, "--budget", "1", "--out", tmp_path / "none")
    code, _, err = optiplan("export", tmp_path / "none", "--to", "csv")
    assert code == 3
    assert "has no motion" in err
