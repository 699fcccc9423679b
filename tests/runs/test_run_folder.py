import json
import os

import numpy as np
import pytest

import optiplan as op
from optiplan.cli.viewing import open_runs
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import problem_from_dict
from optiplan.runs.pipeline import run
from optiplan.runs.run_folder import check_folder, load_run, save_run

FREE = {"version": 1, "robot": "planar2r", "start": {"joints": [0.5, 1.0]}, "goal": {"joints": [-0.5, 1.2]}}


@pytest.fixture(scope="module")
def done():
    return run(problem_from_dict(FREE), "quintic", {}, Budget(10.0), lambda stage, fraction: None)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("place", ["", "run.json", "trajectory.json"])
def test_what_is_saved_is_loaded_without_loss(done, tmp_path, place):
    save_run(done, tmp_path)
    stored = load_run(tmp_path / place)
    np.testing.assert_array_equal(stored.trajectory.coefficients, done.trajectory.coefficients)
    np.testing.assert_array_equal(stored.trajectory.breakpoints, done.trajectory.breakpoints)
    assert stored.record["hash"] == done.problem.hash


def test_the_problem_can_be_rebuilt_from_the_record(done, tmp_path):
    save_run(done, tmp_path)
    assert problem_from_dict(load_run(tmp_path).record["problem"]).hash == done.problem.hash


def test_the_lower_bound_of_a_loaded_run_is_computed_anew(done, tmp_path):
    save_run(done, tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps({**record, "lower_bound": 10.0 * record["lower_bound"]}))
    assert op.load_run(tmp_path).lower_bound == done.lower_bound


def test_a_trajectory_from_elsewhere_has_no_record(done, tmp_path):
    save_run(done, tmp_path)
    (tmp_path / "mine.json").write_bytes((tmp_path / "trajectory.json").read_bytes())
    assert load_run(tmp_path / "mine.json").record == {}


def test_saving_twice_leaves_two_files(done, tmp_path):
    save_run(done, tmp_path)
    save_run(done, tmp_path)
    assert names(tmp_path) == ["run.json", "trajectory.json"]


@pytest.mark.parametrize("write", [1, 2])
def test_a_disk_that_fills_up_leaves_the_older_run(done, tmp_path, monkeypatch, write):
    save_run(done, tmp_path)
    before = (tmp_path / "run.json").read_bytes(), (tmp_path / "trajectory.json").read_bytes()
    count = iter(range(1, 9))

    def full(descriptor):
        if next(count) == write:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="no space left"):
        save_run(done, tmp_path)
    assert names(tmp_path) == ["run.json", "trajectory.json"]
    assert before == ((tmp_path / "run.json").read_bytes(), (tmp_path / "trajectory.json").read_bytes())


def test_a_folder_below_a_file_is_refused(done, tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(InputError):
            save_run(done, folder)
        with pytest.raises(InputError, match="is a file"):
            check_folder(folder)


def test_checking_a_folder_makes_nothing(tmp_path):
    check_folder(tmp_path / "a" / "b")
    assert names(tmp_path) == []


def test_a_lost_trajectory_is_an_error_not_a_failure(done, tmp_path):
    save_run(done, tmp_path)
    (tmp_path / "trajectory.json").unlink()
    with pytest.raises(InputError, match=r"trajectory\.json"):
        load_run(tmp_path)


def test_a_problem_file_is_no_run(tmp_path):
    (tmp_path / "cell.yaml").write_text("version: 1\n")
    with pytest.raises(InputError, match=r"cell.yaml:1: file: YAML; expected JSON, such as a file of the folder that"):
        load_run(tmp_path / "cell.yaml")


def test_an_empty_folder_holds_no_run(tmp_path):
    with pytest.raises(InputError, match=r"run\.json"):
        load_run(tmp_path)


def test_a_failed_run_loads_without_trajectory(tmp_path):
    (tmp_path / "run.json").write_text(json.dumps({"failure": {"kind": "no-path", "detail": "", "witness": {}}}))
    assert load_run(tmp_path).trajectory is None


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("planner", None),
        ("problem", None),
        ("options", True),
        ("seed", "1"),
        ("seed", float("inf")),
        ("failure", {"kind": "no-path"}),
        ("report", {"checks": [1]}),
        ("metrics", 1.0),
        ("lower_bound", "x"),
        ("timings", [1.0]),
        ("timings", {"plan": None}),
        ("timings", {"stages": 1.0}),
        ("info", [[1]]),
        ("info", {"expressions": "level"}),
        ("improvements", {"a": 1}),
        ("improvements", [[1.0]]),
        ("proved_bound", {"a": 1}),
    ],
)
def test_a_value_of_another_kind_is_bad_input(done, tmp_path, key, value):
    save_run(done, tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps({**record, key: value}))
    with pytest.raises(InputError, match=rf"run\.json.*{key}"):
        op.load_run(tmp_path)


def test_a_run_with_a_constraint_that_no_file_holds_is_not_verified_once_it_is_loaded(tmp_path):
    plain = op.load_problem(FREE)
    own = plain.with_constraint(op.Expression("first joint", lambda k: k.q[0], upper=0.6))
    made = op.retime(own, [plain.start, (0.9, 1.0), plain.goal[0].q])
    assert not made.verified
    made.save(tmp_path / "made")
    op.load_run(tmp_path / "made").save(tmp_path)
    assert op.load_run(tmp_path).why_not == "problem: constraints that no file holds: first joint"
    assert not open_runs([tmp_path])[1][0].report["verified"]
    assert not op.verify(plain, tmp_path).verified
    assert "problem" not in {check.name for check in op.verify(made.problem, tmp_path / "made").failures}
    record = json.loads((tmp_path / "made" / "run.json").read_text())
    record["info"].pop("expressions")
    (tmp_path / "made" / "run.json").write_text(json.dumps(record))
    for report in (op.load_run(tmp_path / "made").report, op.verify(plain, tmp_path / "made")):
        assert [check.name for check in report.failures] == ["problem"]
    assert not open_runs([tmp_path / "made"])[1][0].report["verified"]


@pytest.mark.parametrize("value", [None, "", "left out"])
def test_a_run_without_the_hash_of_its_problem_is_not_verified(done, tmp_path, value):
    save_run(done, tmp_path)
    record = {**json.loads((tmp_path / "run.json").read_text()), "hash": value}
    if value:
        del record["hash"]
    (tmp_path / "run.json").write_text(json.dumps(record))
    for report in (op.load_run(tmp_path).report, op.verify(done.problem, tmp_path)):
        assert "run.json has no hash" in report.failures[0].detail
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match="no entries"):
        op.verify(done.problem, tmp_path)


@pytest.mark.parametrize("key", ["t", "q", "v", "a"])
def test_samples_that_are_one_number_are_refused(done, tmp_path, key):
    save_run(done, tmp_path)
    data = json.loads((tmp_path / "trajectory.json").read_text())
    (tmp_path / "trajectory.json").write_text(json.dumps({**data, key: 1.0}))
    report = op.load_run(tmp_path).report
    assert [check.name for check in report.failures] == ["samples"]
