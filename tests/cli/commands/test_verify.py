import json

import numpy as np
import pytest


def change(run, **changes):
    path = run / "trajectory.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return path


def test_a_stored_run_is_verified_again(optiplan, free, run):
    code, out, err = optiplan("verify", free, run)
    assert code == 0
    assert out.startswith("verified · free · planar2r")
    assert err == ""


def test_a_lone_trajectory_is_enough(optiplan_json, free, run):
    (run / "run.json").unlink()
    code, data = optiplan_json("verify", free, run / "trajectory.json")
    assert code == 0
    assert data["verified"] is True
    assert data["same_problem"] is None


@pytest.mark.parametrize("key", ["q", "v", "a"])
def test_samples_that_are_not_of_the_pieces_are_refused(optiplan, optiplan_json, free, run, key):
    """What other programs execute is `t, q, v, a`: a hundredth of a radian in one of them, and the pieces untouched."""
    stored = json.loads((run / "trajectory.json").read_text())
    stored[key][7][1] += 1e-2
    change(run, **{key: stored[key]})
    code, out, _ = optiplan("verify", free, run)
    assert code == 4
    assert out.startswith("not verified")
    check = next(c for c in optiplan_json("verify", free, run)[1]["report"]["checks"] if c["name"] == "samples")
    assert not check["passed"]
    assert (check["place"], check["time"]) == ("elbow", stored["t"][7])
    assert check["worst"] == pytest.approx(1e-2, rel=1e-3)


@pytest.mark.parametrize("changes", [{"t": [], "q": []}, {"t": [0.0, 1.0], "q": [[0, 0], [1, 1]], "v": [[0, 0]]}])
def test_samples_that_fit_no_pieces_are_refused(optiplan, free, run, changes):
    change(run, **{"v": None, "a": None, **changes})
    assert optiplan("verify", free, run)[0] == 4


def test_samples_that_end_early_are_refused(optiplan, free, run):
    stored = json.loads((run / "trajectory.json").read_text())
    change(run, **{key: stored[key][:-3] for key in "tqva"})
    code, out, _ = optiplan("verify", free, run)
    assert code == 4
    assert "expected 0 to" in " ".join(out.split())


def test_samples_are_held_against_the_pieces_at_their_times_alone_and_that_is_said(optiplan_json, free, run):
    stored = json.loads((run / "trajectory.json").read_text())
    change(run, **{key: [stored[key][0], stored[key][-1]] for key in "tqva"})
    code, data = optiplan_json("verify", free, run)
    assert code == 0
    words = f"2 samples, up to {stored['t'][-1]:.3g} s apart: held against the motion at their own times, not between"
    assert words in data["report"]["scope"]


def test_pieces_without_samples_are_enough(optiplan, free, run):
    stored = json.loads((run / "trajectory.json").read_text())
    (run / "trajectory.json").write_text(json.dumps({key: stored[key] for key in ("joint_names", "pieces")}))
    assert optiplan("verify", free, run)[0] == 0


def slower(run, stretch=1.02):
    """Samples of the run, a little slower, so that an interpolation does not pass the limits that it runs at."""
    stored = json.loads((run / "trajectory.json").read_text())
    powers = {"q": 0, "v": 1, "a": 2}
    scaled = {key: (np.array(stored[key]) / stretch**power).tolist() for key, power in powers.items()}
    return {"joint_names": stored["joint_names"], "t": [stretch * t for t in stored["t"]], **scaled}


@pytest.mark.parametrize(
    ("keys", "words"), [("q", "cubic spline"), ("qv", "quintic spline"), ("qva", "quintic polynomials")]
)
def test_samples_alone_are_verified_and_the_interpolation_is_said(optiplan, optiplan_json, free, run, keys, words):
    data = slower(run)
    path = run.parent / "elsewhere.json"
    path.write_text(
        json.dumps({"joint_names": data["joint_names"], "t": data["t"], **{key: data[key] for key in keys}})
    )
    code, found = optiplan_json("verify", free, path)
    assert (code, found["verified"]) == (0, True), found["report"]["checks"]
    assert words in found["interpolation"]
    assert words in " ".join(optiplan("verify", free, path)[1].split())


def test_samples_in_columns_are_verified(optiplan_json, free, run):
    """CSV with the joints in another order than the robot's."""
    data = slower(run)
    rows = [[t, q[1], q[0], v[1], v[0]] for t, q, v in zip(data["t"], data["q"], data["v"], strict=True)]
    lines = ["t, q_elbow, q_shoulder, v_elbow, v_shoulder", *(",".join(map(repr, row)) for row in rows)]
    path = run.parent / "motion.csv"
    path.write_text("\n".join(lines))
    code, found = optiplan_json("verify", free, path)
    assert (code, found["verified"]) == (0, True), found["report"]["checks"]
    rows[50][1] += 0.01
    path.write_text("\n".join([lines[0], *(",".join(map(repr, row)) for row in rows)]))
    assert optiplan_json("verify", free, path)[0] == 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "1: header"),
        ("x,a\n", "1: header"),
        ("t,shoulder,elbow\n0,0,0\n1,zwei,0\n", "3: row: could not convert"),
        ("t,shoulder,elbow\n0,0,0\n1,0\n", "3: row: 2 numbers"),
        ("t,shoulder,elbow\n0,0,0\n0,1,1\n", "t: times that are not finite or do not increase"),
        ("t,shoulder,elbow,v_shoulder\n0,0,0,0\n1,0,0,0\n", "1: header: v of shoulder"),
    ],
)
def test_broken_columns_are_bad_input(optiplan, free, tmp_path, text, message):
    path = tmp_path / "motion.csv"
    path.write_text(text)
    code, out, err = optiplan("verify", free, path)
    assert (code, out) == (2, "")
    assert message in err
    assert str(path) in err


def test_a_run_of_another_problem_is_not_verified(optiplan, optiplan_json, free, run):
    """Even where its motion would do: the hash is not the run's."""
    free.write_text(free.read_text() + "limits: {velocity: 1.0, torque: 0.99}\n")
    code, out, err = optiplan("verify", free, run)
    assert (code, err) == (4, "")
    assert out.startswith("not verified")
    assert "made from another problem" in " ".join(out.split())
    data = optiplan_json("verify", free, run)[1]
    assert (data["same_problem"], data["verified"]) == (False, False)
    assert [check["name"] for check in data["report"]["checks"] if not check["passed"]] == ["problem"]
    alone = run.parent / "alone.json"
    alone.write_text((run / "trajectory.json").read_text())
    assert optiplan("verify", free, alone)[0] == 0
    change(run, joint_names=["elbow", "elbow2"])
    assert "\n1 check passed" in optiplan("verify", free, run)[1]


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
        ('{"pieces": {},\n "t": 0, "t": 1}', "trajectory.json:2: file: broken JSON (a duplicate key: 't')"),
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
    assert message in " ".join(err.split())


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
