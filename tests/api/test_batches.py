"""`op.plan_batch`: rows with proofs, resumed without redoing, bad files and dead workers that end no other."""

import json
import os
from multiprocessing import active_children
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import optiplan as op
from optiplan.cores import WHY_DEAD
from optiplan.runs.batches import workers
from optiplan.runs.batches.episode import EpisodeRequest, planned_episode
from optiplan.runs.batches.store import BatchStore, array_of
from optiplan.runs.batches.workers import in_processes, on_cluster
from tests.waiting import wait_until

pytest.importorskip("pyarrow")

PROBLEM = """version: 1
name: NAME
robot: planar2r
start: {joints: [0.1, 0.2]}
goal: {joints: [GOAL, 0.5]}
planner: quintic
"""
HERE = "tests.api.unruly_planners"


def folder_of_problems(root):
    for name, goal in {"a/one": 0.8, "a/two": -0.4, "b/three": 0.3}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / f"{name}.yaml").write_text(PROBLEM.replace("NAME", name[2:]).replace("GOAL", str(goal)))
    (root / "bad.yaml").write_text(PROBLEM.replace("[GOAL, 0.5]", "[0.5]"))
    return root


@pytest.fixture(autouse=True, scope="module")
def here():
    """Plan in this process, which need not start, but where the processes are what is tested."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optiplan.api.batches.in_processes", lambda requests, count: map(planned_episode, requests))
        yield


@pytest.fixture(scope="module")
def problems(tmp_path_factory):
    return folder_of_problems(tmp_path_factory.mktemp("problems"))


@pytest.fixture(scope="module")
def batch(problems, tmp_path_factory):
    return op.plan_batch(problems, tmp_path_factory.mktemp("batch") / "out", workers=1, lerobot=True, rate=20)


def settings(batch):
    return json.loads((batch.out / "batch.json").read_text())


def test_a_batch_counts_what_came_of_every_file(batch):
    assert (dict(batch.counts), batch.made, batch.kept) == ({"verified": 3, "bad-input": 1}, 4, 0)
    ((file, reason),) = batch.bad
    assert file == "bad.yaml"
    assert "bad.yaml:5: goal.joints: 1 values; expected 2 values" in reason


def test_each_row_holds_a_motion_that_can_be_proved_again(batch, problems, tmp_path):
    with BatchStore(batch.out, settings(batch)) as store:
        rows = {row["file"]: row for row in store.rows()}
    row = rows["a/one.yaml"]
    problem = op.load_problem(problems / "a/one.yaml")
    assert (row["state"], row["hash"], row["task"], row["planner"]) == ("verified", problem.hash, "a", "quintic")
    (tmp_path / "trajectory.json").write_bytes(row["trajectory"])
    report = op.verify(problem, tmp_path / "trajectory.json")
    assert report.verified
    assert len(json.loads(row["report"])["checks"]) == len(report.checks)
    positions = array_of(row, "positions")
    assert positions[0].tolist() == pytest.approx([0.1, 0.2])
    assert positions[-1].tolist() == pytest.approx([0.8, 0.5])
    assert len(positions) == np.ceil(row["duration"] * 20) + 1


def test_again_it_plans_only_what_is_new_or_changed(tmp_path):
    root, out = folder_of_problems(tmp_path / "problems"), tmp_path / "out"
    (root / "a/one.yaml").unlink()
    assert op.plan_batch(root, out, workers=1).made == 3
    again = op.plan_batch(root, out, workers=1)
    assert (again.made, again.kept) == (1, 2), "what was wrong with a file may be elsewhere, and gone"
    folder_of_problems(root)
    (root / "bad.yaml").write_text(PROBLEM.replace("GOAL", "0.6"))
    more = op.plan_batch(root, out, workers=1)
    assert (more.made, more.kept, dict(more.counts), more.bad) == (2, 2, {"verified": 4}, ())
    (root / "bad.yaml").unlink()
    (root / "a/one.yaml").rename(root / "a/four.yaml")
    less = op.plan_batch(root, out, workers=1, lerobot=True)
    assert (less.made, less.kept, dict(less.counts)) == (1, 2, {"verified": 3})
    assert json.loads((less.data_sets[0] / "meta" / "info.json").read_text())["total_episodes"] == 3


def test_a_file_that_is_not_there_is_a_bad_one(tmp_path):
    root = folder_of_problems(tmp_path / "problems")
    (root / "link.yaml").symlink_to(tmp_path / "nothing.yaml")
    found = op.plan_batch(root, tmp_path / "out")
    assert found.counts == {"verified": 3, "bad-input": 2}
    assert dict(found.bad)["link.yaml"].endswith("No such file or directory; expected a readable YAML file")
    (root / "link.yaml").unlink()
    assert op.plan_batch(root, tmp_path / "out").counts == {"verified": 3, "bad-input": 1}
    listed = op.plan_batch([root / "a/one.yaml", root / "three.yaml"], tmp_path / "listed")
    assert (listed.counts, [name for name, _ in listed.bad]) == ({"verified": 1, "bad-input": 1}, ["three.yaml"])


def test_an_exception_nobody_expects_is_a_row(problems, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("one by zero")

    monkeypatch.setattr("optiplan.runs.batches.episode.load_problem", broken)
    row = planned_episode(request(problems, "quintic"))
    assert row.state == "crashed"
    assert "a/one.yaml: ZeroDivisionError: one by zero" in row.detail


def test_what_was_made_before_an_interruption_is_kept(problems, tmp_path):
    def interrupt(name, share):
        if share > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        op.plan_batch(problems, tmp_path / "out", workers=1, progress=interrupt)
    assert op.plan_batch(problems, tmp_path / "out", workers=1).kept == 2


def test_other_settings_do_not_continue_a_batch(batch, problems):
    with pytest.raises(op.InputError, match="rate: 30 in the place of 20"):
        op.plan_batch(problems, batch.out, rate=30)


def test_a_second_call_at_the_same_time_is_refused(batch):
    with BatchStore(batch.out, settings(batch)), pytest.raises(op.InputError, match="at this moment"):
        BatchStore(batch.out, settings(batch))


def request(root, planner):
    return EpisodeRequest(root, "a/one.yaml", 1, planner, None, 5.0, 20.0)


def test_a_worker_that_dies_costs_one_episode(problems):
    others = set(active_children())
    rows = in_processes([request(problems, name) for name in ("quintic", f"{HERE}:Killed", *["quintic"] * 2)], 1)
    states = [next(rows).state]
    wait_until(lambda: others >= set(active_children()))  # it dies before the fourth is given to it
    rows = list(rows)
    assert states + [row.state for row in rows] == ["verified", "crashed", "verified", "verified"]
    assert WHY_DEAD in rows[0].detail


def test_processes_are_replaced_every_so_often(problems, monkeypatch):
    pools = []
    monkeypatch.setattr(workers, "CHILD_LIFE", 2)
    monkeypatch.setattr(workers, "_pool", lambda count, make=workers._pool: pools.append(make(count)) or pools[-1])
    rows = in_processes([request(problems, "quintic")] * 3, 1)
    assert [row.state for row in rows] == ["verified"] * 3
    assert len(pools) == 2


def test_a_dask_client_in_place_of_processes(problems):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        rows = list(on_cluster([request(problems, "quintic"), request(problems, f"{HERE}:Broken")], client))
    assert [row.state for row in rows] == ["verified", "no-plan"]
    assert "one by zero" in rows[1].detail


def test_what_a_cluster_loses_is_no_row(problems):
    distributed = pytest.importorskip("distributed")

    class Failing:
        """Stands for a client whose workers lack optiplan, or die of an episode."""

        def __init__(self, error):
            self.error = error

        def nthreads(self):
            return {}

        def submit(self, function, request, pure):
            return self

        def result(self):
            raise self.error

        def cancel(self, futures):
            pass

    with pytest.raises(op.OptiPlanError, match=r"'a/one\.yaml' was lost \(ModuleNotFoundError: optiplan\)"):
        list(on_cluster([request(problems, "quintic")], Failing(ModuleNotFoundError("optiplan"))))
    gone = Failing(OSError("no scheduler"))
    gone.nthreads = gone.result
    with pytest.raises(op.OptiPlanError, match=r"the cluster failed \(OSError: no scheduler\)"):
        list(on_cluster([request(problems, "quintic")], gone))
    killed = distributed.KilledWorker("task", SimpleNamespace(address="tcp://a"), 3)
    (row,) = on_cluster([request(problems, "quintic")], Failing(killed))
    assert row.state == "crashed"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"problems": 3}, "op.plan_batch: problems: found the int 3"),
        ({"problems": "/nowhere"}, "/nowhere: problems: no folder"),
        ({"seeds": 0}, "op.plan_batch: seeds: found the int 0"),
        ({"rate": 0.5}, "op.plan_batch: rate: found the float 0.5"),
        ({"rate": 10**9}, "a whole number of Hz from 1 to 10000"),
        ({"workers": "all"}, "op.plan_batch: workers: found the str 'all'"),
    ],
)
def test_errors_name_the_argument(problems, tmp_path, arguments, words):
    with pytest.raises(op.InputError) as caught:
        op.plan_batch(**{"problems": problems, "out": tmp_path / "out", **arguments})
    assert words in str(caught.value)


def test_a_name_that_is_not_utf_8_is_named(problems, tmp_path):
    (tmp_path / "in").mkdir()
    odd = Path(os.fsdecode(b"\xff.yaml"))
    (tmp_path / "in" / odd).write_bytes((problems / "a/one.yaml").read_bytes())
    with pytest.raises(op.InputError, match=r"\?\.yaml: problems: a name that is not UTF-8"):
        op.plan_batch(tmp_path / "in", tmp_path / "out", workers=1)


def test_a_folder_with_other_files_is_refused(problems):
    with pytest.raises(op.InputError, match=r"a folder without batch\.json"):
        op.plan_batch(problems, problems)


def test_a_place_that_can_be_no_batch_is_refused(problems, tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(op.InputError, match=r"file: out: .* is a file; expected a folder that can be written"):
        op.plan_batch(problems, tmp_path / "file")
    (tmp_path / "batch.json").write_text("[]")
    with pytest.raises(op.InputError, match=r"batch\.json: batch: \[\]; expected"):
        op.plan_batch(problems, tmp_path)
