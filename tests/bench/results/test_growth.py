"""Results grow: by planners, seeds and sets, by merging, and side by side; what must agree is named."""

import json

import numpy as np
import pytest

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import found_runs, open_results, run_suite
from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.headline import facts, warnings
from optiplan.bench.results.database import Store, StoreError
from optiplan.bench.results.growth import expected_runs, merge_results, place_of, together
from optiplan.bench.suite.suite import load_suite
from optiplan.errors import InputError

SLOW = {"name": "bench_planners:Straight", "label": "slow", "seconds": 0.01}


@pytest.fixture
def grow(tmp_path):
    """Runs a suite file into a folder, adding it to what is there."""

    def grow(path, folder=None, add=True):
        suite = load_suite(path, tmp_path / "files")
        with open_results(suite, folder or tmp_path / "out", add) as store:
            assert found_runs(suite, store) <= suite.size
            done = run_suite(suite, store, LocalPool(1), "1 local", lambda outcome: None)
            return done, store.done(), store.meta("parts"), store.meta("suite_hash")

    return grow


def test_a_folder_grows_by_a_planner_a_seed_and_a_set(write_suite, grow):
    """By an edited suite, and by one that has nothing but the addition; the end is as if one suite had said all."""
    first, done, _, _ = grow(write_suite(count=1))
    assert (first.made, len(done)) == (1, 1)
    edited = write_suite(count=2, seeds=[0, 3])
    second, done, parts, digest = grow(edited)
    assert (second.found, second.made, len(done)) == (1, 3, 4)
    assert parts["seeds"] == [0, 3]
    suite = load_suite(edited, edited.parent / "files")
    assert digest == suite.hash
    only = write_suite(count=2, name="addition", planners=[SLOW], seeds=[0, 3])
    third, done, parts, _ = grow(only)
    assert (third.total, third.made, third.complete, len(done)) == (4, 4, True, 8)
    assert list(parts["planners"]) == ["bench_planners:Straight", "slow"]
    whole = write_suite(count=2, seeds=[0, 3], planners=["bench_planners:Straight", SLOW])
    again, _, _, _ = grow(whole, add=False)
    assert (again.found, again.made) == (8, 0)


def test_runs_that_no_suite_asks_for_are_not_missing(results, write_suite, tmp_path):
    """Two suites of unlike planners and seeds, one added to the other, and merged."""
    a, b = write_suite(count=1, seeds=[0, 1]), write_suite(count=1, name="b", planners=[SLOW])
    for path in (a, b):
        with open_results(load_suite(path, tmp_path / "files"), tmp_path / "out", add=True) as store:
            expected = expected_runs(store)
    assert expected == 3
    one = results({("s/a", "one", 0): (1.0, 2.0), ("s/a", "one", 1): (1.0, 2.0)}, "one")
    two = results({("s/a", "two", 0): (1.0, 3.0)}, "two")
    for folder, known in ((one, {"s/a": 1.5}), (two, {"s/a": 1.75, "s/b": 1.0})):
        with Store(folder, write=True) as store:
            store.set_meta("best_known", known)
    with merge_results([one, two], tmp_path / "both") as store:
        assert warnings(store, analyse(store)) == []
        assert facts(store, analyse(store)) == "1 problems × 2 planners: 3 runs, 100.0 % verified"
        assert store.meta("best_known") == {"s/a": 1.5, "s/b": 1.0}


def test_what_must_agree_is_named_and_nothing_is_changed(write_suite, grow, tmp_path):
    grow(write_suite(count=1))
    with pytest.raises(InputError) as caught:
        grow(write_suite(count=1, budget=3, planners=[{"name": "bench_planners:Straight", "seconds": 0.01}]))
    words = "\n".join(map(str, caught.value.issues))
    assert "budget: 2.0 there, 3.0 here" in words
    assert "planners: the same name and another content: bench_planners:Straight" in words
    with pytest.raises(InputError, match="with --add"):
        grow(write_suite(count=2), add=False)
    (tmp_path / "problems" / "p1.yaml").unlink()
    assert grow(write_suite(count=1), add=False)[0].found == 1


def test_a_merge_that_breaks_off_leaves_nothing(results, tmp_path, monkeypatch):
    """So the same command can be given again: half a merge would be taken for a whole one."""
    folders = [results({("s/a", name, 0): (1.0, 2.0)}, name) for name in ("one", "two")]
    absorb, absorbed = Store.absorb, []

    def full(store, *arguments):
        if absorbed:
            raise StoreError("database or disk is full")
        absorbed.append(absorb(store, *arguments))

    monkeypatch.setattr(Store, "absorb", full)
    with pytest.raises(StoreError):
        merge_results(folders, tmp_path / "both")
    assert not (tmp_path / "both").exists()
    monkeypatch.undo()
    with merge_results(folders, tmp_path / "both") as store:
        assert len(store.done()) == 2
    assert {path.name for path in (tmp_path / "both").iterdir()} == {"results.sqlite", "lock"}


def test_merged_folders_are_one(results, tmp_path):
    """Runs, problems and planners of both; a folder that is a copy in parts counts once."""
    a = results({("s/a", "one", 0): (1.0, 2.0), ("s/b", "one", 0): (1.5, 2.5)}, "a")
    b = results({("s/a", "two", 0): (3.0, 1.0), ("s/a", "one", 0): (1.0, 2.0), ("t/c", "two", 1): (1.0, 4.0)}, "b")
    with merge_results([a, b], tmp_path / "both") as store:
        assert store.done() == {
            *(("s/a", "one", 0, 0), ("s/b", "one", 0, 0), ("s/a", "two", 0, 0), ("t/c", "two", 1, 0)),
        }
        assert [row["id"] for row in store.query("SELECT id FROM problems ORDER BY position")] == ["s/a", "s/b", "t/c"]
        sessions = {row["planner"]: row["session"] for row in store.query("SELECT planner, session FROM runs")}
        assert sessions == {"one": 1, "two": 2}
        assert store.meta("parts")["seeds"] == [0, 1]
        assert place_of(store, ("s/a", "two", 0, 0)) == (str(tmp_path / "both"), ("s/a", "two", 0, 0))
    with Store(tmp_path / "both") as store:  # it is whole when it is opened again
        assert len(store.done()) == 4


@pytest.mark.parametrize(
    ("runs", "changes", "words"),
    [
        ({("s/a", "one", 0): (9.0, 2.0)}, {}, "1 runs that .* has, too, made another time: one on s/a, seed 0"),
        ({("s/a", "two", 0): (1.0, 2.0)}, {"budget": 9.0}, "budget: 5.0 there, 9.0 here"),
        ({("s/a", "two", 0): (1.0, 2.0)}, {"problems": {"s/a": ["other", "s", None]}}, "problems: the same name"),
    ],
)
def test_folders_that_do_not_agree_are_not_merged(results, tmp_path, runs, changes, words):
    a, b = results({("s/a", "one", 0): (1.0, 2.0)}, "a"), results(runs, "b")
    with Store(a, write=True) as store:
        store.set_meta("parts", store.meta("parts") | {"problems": {"s/a": ["s/a", "s", None]}})
    with Store(b, write=True) as store:
        store.set_meta("parts", store.meta("parts") | changes)
    with pytest.raises(InputError, match=words):
        merge_results([a, b], tmp_path / "both")
    assert not (tmp_path / "both").exists()


def test_side_by_side_says_what_differs_and_keeps_both(results, tmp_path):
    """The same planner in two folders: two planners; what is asked of a run is asked of its own folder."""
    a = results({("s/a", "one", 0): (1.0, 2.0), ("s/a", "two", 0): (1.0, 3.0)}, "a")
    b = results({("s/a", "one", 0): (0.5, 2.0), ("s/b", "one", 0): (1.0, 3.0)}, "b", cpu="other")
    with Store(b, write=True) as store:
        store.set_meta("parts", store.meta("parts") | {"budget": 9.0})
    with together([a, b], tmp_path / "shown") as store:
        planners = [row["label"] for row in store.query("SELECT label FROM planners ORDER BY position")]
        assert planners == ["one (a)", "two", "one (b)"]
        assert place_of(store, ("s/b", "one (b)", 0, 0)) == (str(b), ("s/b", "one", 0, 0))
        assert place_of(store, ("s/a", "two", 0, 0)) == (str(a), ("s/a", "two", 0, 0))
        analysis = analyse(store)
        told = "\n".join(warnings(store, analysis))
        assert f"budget: 5.0 in {a}, 9.0 in {b}" in told
        assert "several machines" in told
        assert "Not complete" not in told
        assert "4 runs" in facts(store, analysis)
        np.testing.assert_array_equal(analysis.runs.seed, 0)


def test_limits_and_objective_of_a_source_go_over_those_of_its_files(write_suite, tmp_path):
    """A whole set without jerk limits beside the same set with them; a mistake is told with its line."""
    path = write_suite(count=2)
    data = json.loads(path.read_text())
    stated = {"limits": {"jerk": "none", "velocity": 0.5}, "objective": {"jerk": 0.1}}
    data["problems"].append({**data["problems"][0], "set": "free", **stated})
    path.write_text(json.dumps(data))
    suite = load_suite(path, tmp_path / "files")
    plain, free = (next(p for p in suite.problems if p.id == f"{name}/p0") for name in ("plain", "free"))
    assert plain.hash != free.hash
    from optiplan.problem.load import problem_from_dict

    problem = problem_from_dict(free.data)
    own = problem_from_dict(plain.data)
    assert np.isinf(problem.limits.jerk).all()
    np.testing.assert_allclose(problem.limits.velocity, 0.5 * own.limits.velocity)
    assert (problem.objective.time, problem.objective.jerk) == (1.0, 0.1)
    data["problems"][1]["limits"] = {"jerk": "nothing"}
    path.write_text(json.dumps(data, indent=1))
    with pytest.raises(InputError, match=r"problems\[1\]\.limits\.jerk"):
        load_suite(path, tmp_path / "files")
