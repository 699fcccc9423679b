import json
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optiplan.planners.registry import PLANNERS
from optiplan.runs import pipeline
from optiplan.trajectory.trajectory import Trajectory

TOUCHING = """\
version: 1
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [-0.5, 1.2]}
scene:
  obstacles:
    - {name: wall, shape: {box: [0.02, 0.6, 0.02]}, pose: {position: [0.74, 0.18, 0.05]}}
"""


def test_verified_is_exit_code_0(optiplan, free):
    code, out, err = optiplan("plan", free)
    assert code == 0
    assert out.startswith("verified · free · planar2r · quintic · seed 0\n")
    assert "proved clear by more than" in out
    assert "lower bound" in out
    assert err == ""


def test_json_is_one_object(optiplan_json, free):
    code, data = optiplan_json("plan", free)
    assert code == data["exit_code"] == 0
    assert data["verified"] is data["report"]["verified"] is True
    assert data["planner"] == "quintic"
    assert data["ratio"] == pytest.approx(data["duration"] / data["lower_bound"])
    assert data["ratio"] >= 1.0
    assert {"load", "plan", "verify", "stages"} <= set(data["timings"])
    assert {"optiplan", "python", "pin", "coal", "ompl"} <= set(data["versions"])


def test_out_holds_run_and_trajectory(optiplan, free, tmp_path):
    folder = tmp_path / "deep" / "run"
    assert optiplan("plan", free, "--out", folder, "--seed", 5)[0] == 0
    assert sorted(path.name for path in folder.iterdir()) == ["run.json", "trajectory.json"]
    run = json.loads((folder / "run.json").read_text())
    assert run["seed"] == 5
    assert run["problem"]["robot"] == "planar2r"
    motion = json.loads((folder / "trajectory.json").read_text())
    trajectory = Trajectory.from_dict(motion)
    t = np.array(motion["t"])
    assert np.diff(t).max() <= 0.01
    assert trajectory.duration == run["duration"] == t[-1]
    for order, key in enumerate("qva"):
        np.testing.assert_array_equal(motion[key], trajectory(t, order))


def test_seed_and_planner_do_not_change_the_identity_of_the_problem(optiplan_json, free):
    plain, other = optiplan_json("plan", free)[1], optiplan_json("plan", free, "--seed", 9)[1]
    assert plain["hash"] == other["hash"]


def test_options_of_the_file_belong_to_its_planner(optiplan_json, free):
    free.write_text(free.read_text().replace("planner: quintic", "planner: {name: rrtconnect, attempts: 7}"))
    assert optiplan_json("plan", free, "--planner", "quintic")[1]["options"] == {}


def test_no_plan_is_exit_code_3_with_reason_and_witness(optiplan, optiplan_json, tmp_path):
    path = tmp_path / "touching.yaml"
    path.write_text(TOUCHING)
    code, out, _ = optiplan("plan", path, "--planner", "quintic", "--out", tmp_path / "run")
    assert code == 3
    assert out.startswith("no plan · touching")
    assert "\ncollision: the motion is not free" in out
    assert "verified" not in out
    assert [file.name for file in (tmp_path / "run").iterdir()] == ["run.json"]
    code, data = optiplan_json("plan", path, "--planner", "quintic")
    assert code == data["exit_code"] == 3
    assert "wall" in str(data["failure"]["witness"])
    assert data["report"] is data["duration"] is data["ratio"] is None


def test_a_failed_run_takes_the_place_of_an_older_one(optiplan, free, tmp_path):
    folder, path = tmp_path / "run", tmp_path / "touching.yaml"
    path.write_text(TOUCHING)
    assert optiplan("plan", free, "--out", folder)[0] == 0
    assert optiplan("plan", path, "--planner", "quintic", "--out", folder)[0] == 3
    assert [file.name for file in folder.iterdir()] == ["run.json"]


def test_found_but_not_verified_is_exit_code_4(optiplan, free, monkeypatch):
    def hasty(self, problem, budget, progress):
        result = plan(self, problem, budget, progress)
        fast = result.trajectory.scaled(result.trajectory.duration / 2)
        return type(result)(fast, None, result.timings)

    from optiplan.planners.point_to_point.quintic import Quintic

    plan = Quintic.plan
    monkeypatch.setattr(Quintic, "plan", hasty)
    code, out, _ = optiplan("plan", free)
    assert code == 4
    assert "FAIL" in out
    assert out.startswith("not verified · free")


@pytest.mark.parametrize("budget", ["0", "-1", "nan", "inf", "soon"])
def test_budget_is_a_positive_number(optiplan, free, budget):
    code, out, err = optiplan("plan", free, f"--budget={budget}")
    assert (code, out) == (2, "")
    assert "--budget" in err


def test_unknown_planner_lists_the_known(optiplan, free):
    code, _, err = optiplan("plan", free, "--planner", "rrt")
    assert code == 2
    assert f"unknown planner 'rrt'; choose from: {', '.join(sorted(PLANNERS))} (did you mean 'rrtstar'?)" in err


def test_broken_file_is_told_with_its_line(optiplan, optiplan_json, free):
    free.write_text(free.read_text().replace("[0.5, 1.0]", "[0.5, .nan]"))
    code, out, err = optiplan("plan", free)
    assert (code, out) == (2, "")
    assert err.startswith(f"{free}:4: start.joints[1]: NaN; expected a finite number")
    code, data = optiplan_json("plan", free)
    assert code == 2
    assert data["issues"][0]["line"] == 4


def test_out_that_is_a_file_is_refused_before_the_work(optiplan, free):
    code, _, err = optiplan("plan", free, "--out", free)
    assert code == 2
    assert "is a file; expected a folder" in err


def test_the_report_is_short_and_within_80_columns(optiplan, free, monkeypatch):
    """The verdict first, what it is about, and every check only when asked for."""
    monkeypatch.setenv("COLUMNS", "80")
    short, full = optiplan("plan", free)[1], optiplan("plan", free, "--full")[1]
    for out in (short, full):
        assert max(map(len, out.splitlines())) <= 80
        assert out.startswith("verified")
        assert "pairs of bodies" in out
        assert "torque: at all times, without friction" in out
    assert "acceleration" not in short
    assert "checks passed (all of them: --full)" in short
    for name in ("velocity", "acceleration", "jerk", "torque", "continuity"):
        assert sum(line.startswith(f"{name} ") for line in full.splitlines()) == 1


def test_a_motion_that_is_not_optimised_says_so(optiplan, free, monkeypatch):
    run = pipeline.run
    info = {"fallback": "sampled path"}
    monkeypatch.setattr(pipeline, "run", lambda *given: replace(run(*given), info=info))
    out = optiplan("plan", free)[1]
    assert "note: no optimised motion was found; this is the sampled path, timed" in out


def test_the_bound_says_what_it_is_about(optiplan, optiplan_json, free):
    """A joint goal has one end, so nothing is shorter than the bound; a choice of ends may have a nearer one."""
    assert "× the lower bound" in optiplan("plan", free)[1]
    assert optiplan_json("plan", free)[1]["lower_bound_of"] == "problem"
    choice = "{any_of: [{joints: [-0.5, 1.2]}, {joints: [-2, 1]}]}"
    free.write_text(free.read_text().replace("{joints: [-0.5, 1.2]}", choice))
    assert "bound of this end configuration" in " ".join(optiplan("plan", free)[1].split())
    assert optiplan_json("plan", free)[1]["lower_bound_of"] == "end"


def test_ctrl_c_while_the_bound_is_proved_keeps_the_motion(optiplan_json, free, tmp_path, monkeypatch):
    monkeypatch.setattr("optiplan.api.bounding.bound", lambda *given: signal.raise_signal(signal.SIGINT))
    code, data = optiplan_json("plan", free, "--bound", 60, "--out", tmp_path / "run")
    assert (code, data["exit_code"], data["verified"]) == (130, 130, True)
    assert (tmp_path / "run" / "run.json").is_file()


def test_the_report_is_printed_even_when_saving_fails(optiplan, optiplan_json, free, tmp_path, monkeypatch):
    import optiplan.runs.run_folder as store
    from optiplan.errors import InputError, Issue

    def full_disk(run, folder):
        raise InputError([Issue(str(folder), None, "file", "no space left on device", "a folder that can be written")])

    monkeypatch.setattr(store, "save_run", full_disk)
    code, out, err = optiplan("plan", free, "--out", tmp_path / "run")
    assert code == 2
    assert out.startswith("verified")
    assert "no space left on device" in err
    code, data = optiplan_json("plan", free, "--out", tmp_path / "run")
    assert (code, data["verified"], data["exit_code"]) == (2, True, 2)
    assert "no space left" in data["error"]


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder that nobody can write")
def test_out_is_tested_for_writing_before_planning(optiplan, free):
    """A folder whose permissions allow what the system does not."""
    code, out, err = optiplan("plan", free, "--out", "/proc/self/run")
    assert (code, out) == (2, "")
    assert "cannot be written" in err


def test_a_tracking_error_is_planned_for_and_said(optiplan, optiplan_json, free):
    code, data = optiplan_json("plan", free, "--tracking-error", "0.002")
    assert code == 0
    assert data["tracking_error"] == data["report"]["tracking_error"] == [0.002, 0.002]
    assert "wherever the joints are within 0.002 rad" in " ".join(
        optiplan("plan", free, "--tracking-error", 0.002)[1].split()
    )
    code, _, err = optiplan("plan", free, "--tracking-error", "9")
    assert code == 2
    assert "nearer to its limit than the tracking error; expected a smaller tracking error" in err
    assert optiplan("plan", free, "--tracking-error", "-1")[0] == 2
