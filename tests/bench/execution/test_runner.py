import io
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from types import SimpleNamespace

import pytest

from optiplan.bench.execution.machine import descendants, ended
from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, other_versions, run_suite
from optiplan.bench.execution.slot import WorkerSlot
from optiplan.bench.results.database import Store, StoreError
from optiplan.bench.suite.suite import load_suite
from optiplan.cli.printing.bench_progress import progress
from optiplan.errors import InputError
from tests.waiting import PATIENCE, wait_until

SLOW = {"name": "bench_planners:Straight", "label": "slow", "seconds": 0.05}


def start(path, folder, workers=2):
    """`optiplan bench` as a program of its own, in a process group of its own."""
    code = "from optiplan.cli.main import main; main()"
    command = [sys.executable, "-c", code, "bench", str(path), "--out", str(folder), "--workers", str(workers)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def stored(folder):
    """Runs in the database so far, 0 when there is none yet."""
    try:
        with closing(sqlite3.connect(f"file:{folder}/results.sqlite?mode=ro", uri=True)) as db:
            return db.execute("SELECT count(*) FROM runs").fetchone()[0]
    except sqlite3.OperationalError:
        return 0


def workers_of(process):
    return descendants(process.pid)


def verdicts(rows):
    return {key: (row["verified"], row["failure_kind"], row["trajectory"]) for key, row in rows.items()}


def test_every_run_is_made_once_whatever_the_number_of_workers(write_suite, run, tmp_path):
    path = write_suite(seeds=[0, 7], repetitions=2)
    done, rows = run(path)
    assert (done.total, done.found, done.made) == (8, 0, 8)
    assert verdicts(rows) == verdicts(run(path, tmp_path / "again", workers=2)[1])
    assert all(bool(row["verified"]) == (row["seed"] == 0) for row in rows.values())
    unlucky = rows["plain/p0", "bench_planners:Straight", 7, 1]
    assert (unlucky["failure_kind"], unlucky["witness"]) == ("no-path", '{"q": [0.5, 1.0]}')
    assert len({row["trajectory"] for row in rows.values() if row["verified"]}) == 2


def test_the_same_again_makes_nothing_twice(write_suite, run, tmp_path):
    path = write_suite(count=3)
    seen = []

    def give_up(outcome):
        seen.append(outcome.row.key)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(path, watch=give_up)
    done, rows = run(path, watch=lambda outcome: seen.append(outcome.row.key))
    assert (done.found, done.made, done.complete) == (2, 1, True)
    assert sorted(seen) == sorted(rows)
    assert len({row["session"] for row in rows.values()}) == 2
    with Store(tmp_path / "out") as store:
        assert [row["how"] for row in store.query("SELECT how FROM sessions")] == ["interrupted", "complete"]
    assert run(path)[0].made == 0


def test_another_suite_is_refused_and_what_differs_is_named(results_of, write_suite, run, tmp_path):
    results_of(count=1)
    with pytest.raises(InputError) as caught:
        run(write_suite(count=2, budget=3, planners=["bench_planners:Straight", SLOW]))
    found = "\n".join(issue.found for issue in caught.value.issues)
    assert "budget: 2.0 there, 3.0 here" in found
    assert "planners: only here: slow" in found
    assert "problems: only here: plain/p1" in found
    (tmp_path / "problems" / "p1.yaml").unlink()
    assert run(write_suite(count=1))[0].complete


@pytest.mark.parametrize(("budget", "cut"), [(0.01, 1), (2, 0)])
def test_nothing_found_when_the_budget_is_spent_is_cut_short(write_suite, run, budget, cut):
    ((_, row),) = run(write_suite(count=1, planners=[SLOW], seeds=[7], budget=budget))[1].items()
    assert (row["failure_kind"], row["cut_short"]) == ("no-path", cut)


def test_other_versions_are_told(results_of, tmp_path):
    path = results_of(count=1)
    with sqlite3.connect(tmp_path / "out" / "results.sqlite") as db:
        db.execute("""UPDATE sessions SET versions = json_set(versions, '$.numpy', '0.1')""")
    with open_results(load_suite(path, tmp_path), tmp_path / "out") as store:
        assert [words.startswith("numpy: 0.1 before") for words in other_versions(store)] == [True]


def test_a_problem_that_cannot_be_loaded_is_a_row(write_suite, run, tmp_path):
    path = write_suite(count=1)
    file = tmp_path / "problems" / "p0.yaml"
    file.write_text(file.read_text().replace("[-1, 0.18, 1]", "[0.3, 0.18, 0.2]").replace("0.1}", "0.5}"))
    (row,) = run(path)[1].values()
    assert row["failure_kind"] == "bad-input"
    assert "the start is in collision" in row["failure_detail"]


def test_a_planner_that_hangs_while_warming_up_does_not_hold_up_the_suite(write_suite, run):
    path = write_suite(count=1, planners=["bench_planners:Hangs", SLOW], limits={"wall": 3})
    rows = run(path)[1]
    hung = rows["plain/p0", "bench_planners:Hangs", 0, 0]
    assert (hung["failure_kind"], "(phase: warm-up)" in hung["failure_detail"]) == ("timeout", True)
    assert rows["plain/p0", "slow", 0, 0]["verified"]


def test_ctrl_c_ends_cleanly_and_the_same_command_goes_on(write_suite, tmp_path, run):
    path, folder = write_suite(count=2, planners=[SLOW], repetitions=8), tmp_path / "out"
    process = start(path, folder)
    wait_until(lambda: stored(folder) >= 3)
    workers = workers_of(process)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "the same command goes on" in err
    assert all(map(ended, workers))
    there = stored(folder)
    done, rows = run(path, folder)
    assert (done.found, done.total, len(rows)) == (there, 16, 16)


@pytest.mark.timeout(20)
def test_a_pool_that_is_closed_while_outcomes_wait_to_be_stored_ends(monkeypatch):
    monkeypatch.setattr(WorkerSlot, "run", lambda slot, task: task)
    pool = LocalPool(1)
    outcomes = pool.outcomes(range(1000))
    first = next(outcomes)
    wait_until(pool._done.full)
    pool.close()
    time.sleep(0.3)  # the slot gives up the outcome that it holds
    assert [first, *outcomes] == list(range(9))


def test_killed_with_a_worker_every_run_is_there_once(write_suite, tmp_path, run):
    path, folder = write_suite(count=2, planners=[SLOW], repetitions=8), tmp_path / "out"
    process = start(path, folder)
    wait_until(lambda: stored(folder) >= 3)
    workers = workers_of(process)
    os.kill(workers[0], signal.SIGKILL)
    time.sleep(0.1)
    process.kill()
    process.communicate(timeout=PATIENCE)
    wait_until(lambda: all(map(ended, workers)))
    done, rows = run(path, folder)
    assert 3 <= done.found < 16
    assert len(rows) == 16
    assert all(row["verified"] for row in rows.values())


class Terminal(io.StringIO):
    """What says of itself that a person watches."""

    def isatty(self):
        return True


@pytest.mark.parametrize("stream", [Terminal, io.StringIO])
def test_a_bar_with_rate_and_time_left_where_a_person_watches(monkeypatch, stream):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys, "stderr", stream())
    with progress(4, 1) as watch:
        watch(SimpleNamespace(row=SimpleNamespace(verified=True)))
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", sys.stderr.getvalue())
    assert all(word in shown for word in ("2/4", "/s, 100 % verified", "left"))
    assert (sys.stderr.getvalue() == shown) == (stream is io.StringIO)


def test_without_a_terminal_progress_is_plain_lines_now_and_then(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress(50, 10) as watch:
        for k in range(40):
            watch(SimpleNamespace(row=SimpleNamespace(verified=k % 2 == 0)))
    first, last = sys.stderr.getvalue().splitlines()
    assert re.fullmatch(r"11/50 runs, [\d.]+/s, 100 % verified, about \d+ s left", first)
    assert re.fullmatch(r"50/50 runs, [\d.]+/s, 50 % verified, about 0 s left", last)


def test_one_runner_a_folder(write_suite, tmp_path):
    suite = load_suite(write_suite(), tmp_path)
    with open_results(suite, tmp_path / "out"), pytest.raises(InputError, match="at this moment"):
        open_results(suite, tmp_path / "out")


def test_a_full_disk_is_told_and_loses_nothing(write_suite, tmp_path, run):
    path = write_suite(count=4, repetitions=10)
    suite = load_suite(path, tmp_path / "files")
    with open_results(suite, tmp_path / "out") as store:
        pages = store.query("PRAGMA page_count")[0][0]
        store.query(f"PRAGMA max_page_count = {pages + 8}")
        with pytest.raises(StoreError, match=r"full.*make room and give the same command again"):
            run_suite(suite, store, LocalPool(1), "1 local", lambda outcome: None)
        there = len(store.done())
    assert 0 < there < 30
    done, rows = run(path)
    assert (done.found, len(rows)) == (there, 40)


def test_where_storing_fails_nothing_goes_on(write_suite, tmp_path):
    before = set(descendants(os.getpid()))  # a server of other tests
    suite = load_suite(write_suite(planners=[SLOW]), tmp_path)
    with open_results(suite, tmp_path / "out") as store:
        store.add = lambda outcome: (_ for _ in ()).throw(StoreError("full"))
        with pytest.raises(StoreError, match="full"):
            run_suite(suite, store, LocalPool(2), "2 local", lambda outcome: None)
    assert set(descendants(os.getpid())) <= before


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 2 MB in memory, where we may mount one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=2m", "none", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("no right to mount a tmpfs")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_full_tmpfs(write_suite, small_disk, run):
    path, folder = write_suite(count=2, repetitions=15), small_disk / "out"
    filler = small_disk / "filler"
    filler.write_bytes(b"0" * 1_900_000)
    process = start(path, folder, workers=1)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2, err
    assert "make room and give the same command again" in err
    assert "Traceback" not in err
    there = stored(folder)
    assert 0 < there < 30
    filler.unlink()
    done, _ = run(path, folder)
    assert (done.found, done.total) == (there, 30)
    with closing(sqlite3.connect(folder / "results.sqlite")) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert db.execute("SELECT count(*), sum(verified) FROM runs").fetchone() == (30, 30)
