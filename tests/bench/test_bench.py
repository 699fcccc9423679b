"""`op.bench`: the runs of a suite, its table, its rows, and errors that name the call."""

import pytest

import optiplan as op
from optiplan.bench.bench import workforce

pytestmark = pytest.mark.usefixtures("one_figure_of_measures")


def test_a_suite_is_one_call(write_suite, tmp_path):
    told = []
    results = op.bench(write_suite(), tmp_path / "out", workers=1, progress=lambda name, share: told.append(share))
    assert isinstance(results, op.BenchResults)
    assert (results.total, results.found, results.made, told) == (2, 0, 2, [0.5, 1.0])
    assert results.planners["bench_planners:Straight"]["verified"] == 1.0
    assert [row["verified"] for row in results.rows] == [True, True]
    assert results.rows[0]["ratio"] >= 1.0
    assert isinstance(results.rows[0]["metrics"], dict)
    assert results.report.is_file()
    lines = str(results).splitlines()
    assert lines[0] == f"small: 2 runs in {tmp_path / 'out'}"
    assert lines[1].split()[:5] == ["planner", "runs", "planned", "timed", "verified"]
    assert lines[2].split()[:2] == ["bench_planners:Straight", "2"]
    again = op.bench(write_suite(), tmp_path / "out", best_known=tmp_path / "best.csv")
    assert (again.found, again.made) == (2, 0)
    assert again.planners["bench_planners:Straight"]["over_best_known"] == 1.0
    assert (tmp_path / "best.csv").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"workers": 0}, r"^op\.bench: workers: found the int 0; expected a whole number >= 1"),
        ({"workers": True}, r"^op\.bench: workers: "),
        ({"workers": 10_000, "pin": True}, r"^op\.bench: workers: found 10000 pinned workers; expected at most"),
        ({"dask": "tcp://nowhere:1", "pin": True}, r"^op\.bench: pin: found pin beside dask"),
        ({"dask": 3}, r"^op\.bench: dask: "),
        ({"add": 1}, r"^op\.bench: add: "),
        ({"out": 3}, r"^op\.bench: out: "),
        ({"best_known": 3}, r"^op\.bench: best_known: "),
        ({"progress": 3}, r"^op\.bench: progress: "),
        ({"suite": 3}, r"^op\.bench: suite: "),
    ],
)
def test_arguments_that_do_not_fit(arguments, words, write_suite):
    with pytest.raises(op.InputError, match=words):
        op.bench(**({"suite": write_suite()} | arguments))


def test_results_of_another_suite_are_named(results_of, write_suite, tmp_path):
    results_of(count=1)
    told = []
    with pytest.raises(op.InputError, match=r"^op\.bench: .*results of another suite.*add=True.*as `out`"):
        op.bench(write_suite(1, seeds=[0, 1]), tmp_path / "out")
    suite = write_suite(1, seeds=[1, 2])
    made = op.bench(suite, tmp_path / "out", add=True, progress=lambda name, share: told.append(share)).made
    assert (made, told) == (2, [0.5, 1.0])  # the runs of the other suite are none of this one


def test_workers_are_as_many_as_a_container_has_cores(monkeypatch):
    monkeypatch.setattr("optiplan.bench.bench.cores", lambda: 1)
    assert workforce(None, None, False)[1] == "1 local"
    with pytest.raises(op.InputError, match="at most 1, one for each core"):
        op.bench("suite.yaml", workers=2, pin=True)
