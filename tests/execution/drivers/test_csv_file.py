"""Driver `file`: exact numbers, and a name only for a motion that came to its end."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from tests.execution.in_process import SetClock


def written(run, path, rate=200.0, stop_at=None):
    clock = SetClock(pause=0.0 if stop_at is None else 0.002)
    execution = op.Execution(op.Executor(run), op.driver("file", run, path=path, rate=rate), clock=clock)
    execution.start()
    if stop_at is not None:
        while execution.snapshot()["place"] < stop_at:
            pass
        execution.stop("enough")
    return execution.wait(20.0)


def table(path):
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


def test_set_points_are_kept_exactly(run_of, tmp_path):
    run, path = run_of("01_reach"), tmp_path / "new" / "motion.csv"
    assert written(run, path)["phase"] == "done"
    names, values = table(path)
    n = len(run.problem.robot.joint_names)
    assert names[:2] == ["t", "q panda_joint1"]
    assert values.shape[1] == 1 + 4 * n
    within = values[:, 0] <= run.duration
    t = values[within, 0]
    assert np.abs(values[within, 1 : 1 + n] - run.trajectory(t)).max() < 1e-12
    assert [one.name for one in path.parent.iterdir()] == ["motion.csv"]


def test_a_motion_that_was_stopped_stays_partial(run_of, tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text("of yesterday")
    assert written(run_of("01_reach"), path, stop_at=0.1)["reason"] == "enough"
    assert path.read_text() == "of yesterday"
    assert len(table(tmp_path / "motion.csv.partial")[1]) > 20


def test_a_motion_that_cannot_take_its_name_is_told_where_it_is(run_of, tmp_path):
    path = tmp_path / "motion.csv"
    driver = op.driver("file", run_of("01_reach"), path=path)
    driver.send(SimpleNamespace(t=0.0, q=[0.0], v=[0.0], a=[0.0], torque=[0.0], status=SimpleNamespace(phase="done")))
    assert driver.report == {"file": f"{path}.partial"}
    path.mkdir()
    with pytest.raises(OSError, match=r"motion\.csv"):
        driver.stop("done")
    assert driver.report == {"file": f"{path}.partial"}


def test_a_file_that_cannot_be_written_is_named(run_of, tmp_path):
    with pytest.raises(InputError, match="a folder; expected a file that can be written"):
        op.driver("file", run_of("01_reach"), path=tmp_path)
    with pytest.raises(InputError, match="a folder; expected a file that can be written"):
        op.driver("file", run_of("01_reach"), path=".")
    with pytest.raises(InputError, match="a device or a pipe; expected a file that can be written"):
        op.driver("file", run_of("01_reach"), path="/dev/null")
