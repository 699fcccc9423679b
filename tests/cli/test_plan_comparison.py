"""Several planners on one problem, as the command line compares them."""

import json
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.cli import viewing
from optiplan.cli.plan_comparison import bound_of
from optiplan.planners.point_to_point.quintic import Quintic
from optiplan.planners.registry import PLANNERS
from optiplan.problem.load import load_problem
from optiplan.problem.problem import JointGoal, PoseGoal, derived
from optiplan.trajectory.timing.lower_bound import lower_bounds
from tests.waiting import PATIENCE, processor_seconds, wait_until

LSPB = "planner: {name: lspb, duration: 18, velocity: 0.02}"


@pytest.fixture(autouse=True)
def no_width(monkeypatch):
    """Whoever runs the tests may have set one, as processes of pytest do for each other."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture
def slow_lspb(free):
    """The free problem, whose own planner cannot go so far so slowly: lspb would have to exceed D/T = 1/18."""
    free.write_text(free.read_text().replace("planner: quintic", LSPB))
    return free


def rows(out):
    """The planners of the table, from top to bottom, and the lines of each."""
    found = {}
    for line in out.splitlines():
        name = line.split(" ")[0]
        if name in PLANNERS:
            found[name] = line
    return found


def test_table_has_verified_ones_first_by_duration(optiplan, optiplan_json, free):
    code, out, err = optiplan("plan", free, "--planner", "bangbang,quintic,scurve")
    assert code == 0
    assert list(rows(out)) == ["scurve", "quintic", "bangbang"]
    assert "verified" in rows(out)["scurve"]
    assert "not verified" in rows(out)["bangbang"]
    assert "∞" in rows(out)["bangbang"]
    assert "rest: acceleration" in rows(out)["bangbang"]
    assert err.startswith("3 planners, each with 20 s to plan: up to 60 s")
    assert [line.split(":")[0] for line in err.splitlines()[1:]] == ["1/3 bangbang", "2/3 quintic", "3/3 scurve"]
    code, data = optiplan_json("plan", free, "--planner", "bangbang, quintic, scurve,quintic")
    assert code == data["exit_code"] == 0
    assert [run["planner"] for run in data["runs"]] == ["scurve", "quintic", "bangbang"]
    assert data["runs"][2]["metrics"]["peak_jerk"] is None
    best = data["runs"][0]
    assert f"{best['duration']:.3f}" in rows(out)["scurve"]
    assert f"{best['metrics']['tool_path']:.3f}" in rows(out)["scurve"]
    assert f"{best['metrics']['rms_torque']:.2f}" in rows(out)["scurve"]
    assert f"{1e3 * best['metrics']['clearance']:.3g}" in rows(out)["scurve"]


def made(problem, end, duration, verified=True):
    """A run that ends there, of which a comparison of bounds looks at no more."""
    trajectory = SimpleNamespace(end=np.array(end), duration=duration)
    return SimpleNamespace(problem=problem, trajectory=trajectory, duration=duration, verified=verified)


def test_runs_that_end_elsewhere_are_held_against_one_bound(free):
    problem = load_problem(free)
    pose = derived(problem, goal=(PoseGoal("tip", pin.SE3.Identity()),))
    near, far = problem.start + np.array([[0.1, 0.0], [1.0, 0.0]])
    bounds = lower_bounds(problem.start, np.array([near, far]), problem.limits)
    runs = [made(pose, far, 1.01 * bounds[1]), made(pose, near, 1.4 * bounds[0]), made(pose, problem.start, 1.0, False)]
    bound = bound_of(runs)
    assert bound.seconds == bounds[0]
    assert bound.words.startswith("the least over the end configurations reached here")
    assert bound.ratio(runs[1].duration) == pytest.approx(1.4)
    assert bound.ratio(runs[0].duration) == pytest.approx(1.01 * bounds[1] / bounds[0])
    assert bound.ratio(runs[1].duration) < bound.ratio(runs[0].duration)
    listed = derived(problem, goal=(JointGoal(far), JointGoal(near)))
    assert bound_of([made(listed, far, 2.0)]) == (bounds[0], "the least over the 2 goals of the problem")
    assert bound_of([made(pose, far, 2.0, False)]).seconds is None
    assert bound_of([made(pose, problem.start, 2.0)]) == (None, "none: the robot need not move")


def test_table_and_json_say_what_the_bound_is(optiplan, optiplan_json, free):
    out = optiplan("plan", free, "--planner", "quintic,scurve")[1]
    data = optiplan_json("plan", free, "--planner", "quintic,scurve")[1]
    assert f"bound: {data['bound']['seconds']:.3f} s, of the goal" in out
    assert data["bound"]["of"] == "of the goal"
    for run in data["runs"]:
        assert run["ratio"] == pytest.approx(run["duration"] / data["bound"]["seconds"])


@pytest.mark.parametrize("width", [80, 120, 200])
def test_table_fits_the_terminal(optiplan, free, monkeypatch, width):
    """Narrow, the reasons stand below it and its measures in a second half; nothing is cut off."""
    monkeypatch.setenv("COLUMNS", str(width))
    out = optiplan("plan", free, "--planner", "bangbang,quintic,informed_rrtstar", "--budget", "0.5")[1]
    lines = out.splitlines()
    assert max(map(len, lines)) <= width
    assert "…" not in out
    names = [line.split(" ")[0] for line in lines]
    assert names.count("quintic") == (2 if width == 80 else 1)
    assert next(line for line in lines if "rest: acceleration" in line).startswith("bangbang")
    assert (names.count("bangbang:") == 1) == (width < 170)
    for heading in ("planning", "tool path", "peak jerk", "RMS torque", "clearance", "least mani-"):
        assert out.count(heading) == 1


def test_all_are_the_planners_of_the_registry(optiplan_json, free):
    data = optiplan_json("plan", free, "--planner", "all", "--budget", "0.2")[1]
    assert sorted(run["planner"] for run in data["runs"]) == sorted(PLANNERS)
    assert {"bug"}.isdisjoint((run["failure"] or {}).get("kind") for run in data["runs"])


def test_a_row_is_the_run_of_the_planner_alone(optiplan_json, free):
    alone = optiplan_json("plan", free, "--planner", "scurve", "--seed", "3")[1]
    row = optiplan_json("plan", free, "--planner", "quintic,scurve", "--seed", "3")[1]["runs"][0]
    assert {key for key in row if row[key] != alone[key]} - {"ratio"} == {"timings", "improvements"}
    assert row["ratio"] == pytest.approx(alone["ratio"], rel=1e-9)  # by the goal's bound, alone by that of its end


def test_every_planner_has_a_folder(optiplan, free, tmp_path):
    out = tmp_path / "runs"
    assert optiplan("plan", free, "--planner", "quintic,scurve", "--out", out)[0] == 0
    assert sorted(str(path.relative_to(out)) for path in out.rglob("*.json")) == [
        f"{name}/{file}.json" for name in ("quintic", "scurve") for file in ("run", "trajectory")
    ]
    assert json.loads((out / "scurve" / "run.json").read_text())["planner"] == "scurve"
    (out / "quintic" / "run.json").unlink()
    (out / "quintic" / "run.json").mkdir()
    code, _, err = optiplan("plan", free, "--planner", "quintic,scurve", "--out", out)
    assert code == 2
    assert "run.json is a folder" in err


def test_what_a_planner_cannot_do_is_a_row_with_the_line_of_its_option(optiplan, optiplan_json, slow_lspb):
    code, out, _ = optiplan("plan", slow_lspb, "--planner", "lspb,quintic")
    assert code == 0
    assert list(rows(out)) == ["quintic", "lspb"]
    assert "no plan" in rows(out)["lspb"]
    run = optiplan_json("plan", slow_lspb, "--planner", "lspb,quintic")[1]["runs"][1]
    assert run["failure"]["kind"] == "input"
    assert run["failure"]["detail"].startswith(f"{slow_lspb}:7: planner.velocity: 0.02 rad/s")
    assert run["failure"]["witness"]["issues"][0]["line"] == 7


def test_the_same_of_the_planner_alone_is_bad_input(optiplan, slow_lspb):
    code, out, err = optiplan("plan", slow_lspb)
    assert (code, out) == (2, "")
    assert err.startswith(f"{slow_lspb}:7: planner.velocity: 0.02 rad/s")
    assert "more than 0.0556 and at most 0.111" in err


def test_options_that_no_problem_could_have_end_it_before_the_work(optiplan, free):
    free.write_text(free.read_text().replace("planner: quintic", "planner:\n  name: rrtconnect\n  reach: -1.0"))
    code, out, err = optiplan("plan", free, "--planner", "quintic,rrtconnect")
    assert (code, out) == (2, "")
    assert err.startswith(f"{free}:9: planner.reach: ")
    assert optiplan("plan", free, "--planner", "quintic,scurve")[0] == 0


def test_options_of_the_file_go_to_its_planner_only(optiplan_json, free):
    free.write_text(free.read_text().replace("planner: quintic", "planner: {name: quintic, goals: 2}"))
    runs = optiplan_json("plan", free, "--planner", "quintic,scurve")[1]["runs"]
    assert {run["planner"]: run["options"] for run in runs} == {"quintic": {"goals": 2}, "scurve": {}}


@pytest.mark.parametrize(("result", "expected"), [("refused", 4), ("none", 3)])
def test_exit_code_without_a_verified_one(optiplan_json, free, result, expected):
    if result == "none":
        wall = "{box: [0.02, 0.6, 0.02]}, pose: {position: [0.74, 0.18, 0.05]}"
        free.write_text(free.read_text().replace("{sphere: 0.1}, pose: {position: [-1, 0.18, 1]}", wall))
    names = "bangbang,cubic" if result == "refused" else "bangbang,quintic"
    code, data = optiplan_json("plan", free, "--planner", names)
    assert code == data["exit_code"] == expected


def test_a_bug_loses_no_other_run(optiplan, optiplan_json, free, monkeypatch, tmp_path):
    def broken(self, problem, budget, progress):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(Quintic, "plan", broken)
    code, out, err = optiplan("plan", free, "--planner", "quintic,scurve", "--out", tmp_path / "runs")
    assert code == 1
    assert list(rows(out)) == ["scurve", "quintic"]
    assert "bug: ZeroDivisionError: by nothing" in err
    code, data = optiplan_json("plan", free, "--planner", "quintic,scurve")
    assert code == data["exit_code"] == 1
    assert data["runs"][0]["verified"] is True
    assert "Traceback" in data["runs"][1]["failure"]["witness"]["traceback"]
    assert json.loads((tmp_path / "runs" / "quintic" / "run.json").read_text())["failure"]["kind"] == "bug"


def test_view_opens_one_page_of_all_runs_best_first(optiplan, slow_lspb, monkeypatch):
    opened = []
    monkeypatch.setattr(viewing, "serve_page", lambda problem, runs, **_: opened.append(runs))
    assert optiplan("plan", slow_lspb, "--planner", "lspb,quintic,scurve", "--view")[0] == 0
    assert [run.label for run in opened[0]] == ["scurve", "quintic", "lspb"]
    assert [run.trajectory is None for run in opened[0]] == [False, False, True]
    assert opened[0][2].failure["kind"] == "input"


@pytest.mark.parametrize("names", ["quintic,quint", "all,quintic"])
def test_unknown_names_list_the_known(optiplan, free, names):
    code, out, err = optiplan("plan", free, "--planner", names)
    assert (code, out) == (2, "")
    assert "unknown planner" in err
    assert "rrtconnect" in err


@pytest.mark.parametrize("names", ["quintic,", ","])
def test_a_comma_without_a_name_is_told(optiplan, free, names):
    code, out, err = optiplan("plan", free, "--planner", names)
    assert (code, out) == (2, "")
    assert f"an empty name in '{names}'; expected names with one comma between two" in err


def test_ctrl_c_shows_and_leaves_what_is_done(shut_in, tmp_path):
    command = [sys.executable, "-c", "from optiplan.cli.main import main; main()", "plan", str(shut_in)]
    out = tmp_path / "runs"
    options = ["--planner", "quintic,rrtconnect", "--budget", "60", "--out", str(out), "--json"]
    process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
    wait_until((out / "quintic" / "run.json").exists)
    worked = processor_seconds(process.pid)
    wait_until(lambda: process.poll() is not None or processor_seconds(process.pid) > worked + 0.3)  # of rrtconnect
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    data = json.loads(process.communicate(timeout=PATIENCE)[0])
    assert process.returncode == data["exit_code"] == 130
    assert [run["planner"] for run in data["runs"]] == ["quintic"]
    assert time.monotonic() - began < 5.0
    assert [str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()] == ["quintic/run.json"]


def test_nothing_is_shown_after_ctrl_c(free, optiplan_json, monkeypatch):
    monkeypatch.setattr("optiplan.cli.plan_comparison.run_all", lambda *_: ([], [], True))
    monkeypatch.setattr("optiplan.cli.commands.plan._view", lambda *_: pytest.fail("shown"))
    assert optiplan_json("plan", free, "--planner", "quintic,cubic", "--view")[0] == 130
