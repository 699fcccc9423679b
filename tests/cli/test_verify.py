import json

import pytest


@pytest.fixture
def run(optiplan, free, tmp_path):
    """A stored run of `free`."""
    assert optiplan("plan", free, "--out", tmp_path / "run")[0] == 0
    return tmp_path / "run"


def change(run, **changes):
    path = run / "trajectory.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return path


def test_a_stored_run_is_verified_again(optiplan, free, run):
    code, out, err = optiplan("verify", free, run)
    assert code == 0
    assert out.endswith("verified\n")
    assert err == ""


def test_a_lone_trajectory_is_enough(optiplan_json, free, run):
    (run / "run.json").unlink()
    code, data = optiplan_json("verify", free, run / "trajectory.json")
    assert code == 0
    assert data["verified"] is True
    assert data["same_problem"] is None


def test_samples_are_not_what_is_judged(optiplan, free, run):
    change(run, q=[], v=[], a=[], t=[])
    assert optiplan("verify", free, run)[0] == 0


def test_another_problem_is_said(optiplan, optiplan_json, free, run):
    free.write_text(free.read_text().replace("[-0.5, 1.2]", "[-0.5, 1.1]"))
    code, out, err = optiplan("verify", free, run)
    assert code == 4
    assert "goal" in out
    assert "made from another problem" in err
    assert optiplan_json("verify", free, run)[1]["same_problem"] is False


def test_wrong_joint_order_is_refused(optiplan, free, run):
    change(run, joint_names=["elbow", "shoulder"])
    code, out, _ = optiplan("verify", free, run)
    assert code == 4
    assert "FAIL" in out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "broken JSON"),
        ("[]", "a JSON object"),
        ("{}", "pieces"),
        (
            '{"joint_names": ["shoulder", "elbow"], "pieces": {"breakpoints": [0, 1], "coefficients": [[[0, NaN]]]}}',
            "nan",
        ),
        ("\udc80", "JSON"),
    ],
)
def test_broken_trajectories_are_bad_input(optiplan, free, run, text, message):
    (run / "trajectory.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    code, out, err = optiplan("verify", free, run)
    assert (code, out) == (2, "")
    assert str(run / "trajectory.json") in err
    assert message in err


def test_missing_run_is_bad_input(optiplan, free, tmp_path):
    code, _, err = optiplan("verify", free, tmp_path / "nothing")
    assert code == 2
    assert "no such file" in err


def test_a_run_without_trajectory_is_not_verified(optiplan, free, run):
    record = json.loads((run / "run.json").read_text())
    record["failure"] = {"kind": "no-path", "detail": "walled in", "witness": {}}
    (run / "run.json").write_text(json.dumps(record))
    (run / "trajectory.json").unlink()
    code, out, _ = optiplan("verify", free, run)
    assert code == 4
    assert "walled in" in out
