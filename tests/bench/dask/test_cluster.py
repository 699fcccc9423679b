"""A real Dask scheduler and real worker processes on this machine; nothing in a worker is shared with us."""

import logging
import logging.handlers
import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from optiplan.bench.dask import cluster, cluster_worker
from optiplan.bench.dask.cluster import ClusterError, DaskCluster
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.suite.suite import load_suite
from optiplan.cli.main import run as main_run

PATIENCE = 300.0
"""s that a connection may take: a busy machine starts a process in many seconds."""

PATIENT = {f"DASK_DISTRIBUTED__COMM__TIMEOUTS__{what}": f"{PATIENCE:g}s" for what in ("CONNECT", "TCP")}

SLOW = {"name": "bench_planners:Straight", "label": "slow", "seconds": 0.1}


class Dask:
    """A scheduler and its workers, each a process of its own with a cache and a working folder of its own."""

    def __init__(self, folder):
        self.folder, self.processes = folder, []
        self.scheduler = self.start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self.address = self.told(self.scheduler, r"Scheduler at:\s+(tcp://\S+)")

    def start(self, what, *words, **environment):
        number = len(self.processes)
        home = self.folder / f"{what}{number}"
        home.mkdir()
        code = f"from distributed.cli.dask_{what} import main; main()"
        paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])  # where `bench_planners` is
        environment = {
            **os.environ,
            **PATIENT,
            "PYTHONPATH": paths,
            "XDG_CACHE_HOME": str(home / "cache"),
        } | environment
        with (home / "log").open("w") as log:
            command = [sys.executable, "-c", code, *words]
            process = subprocess.Popen(command, cwd=home, env=environment, stdout=log, stderr=log)
        process.log = home / "log"
        process.home = home
        self.processes.append(process)
        return process

    def worker(self, **environment):
        words = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1", "--memory-limit", "0")
        process = self.start("worker", self.address, *words, **environment)
        return process

    def told(self, process, pattern, patience=PATIENCE):
        end = time.monotonic() + patience
        while not (found := re.search(pattern, process.log.read_text())):
            assert process.poll() is None, process.log.read_text()
            assert time.monotonic() < end, process.log.read_text()
            time.sleep(0.05)
        return found[1]

    def workers(self, count):
        started = [self.worker() for _ in range(count)]
        for process in started:
            self.told(process, r"(Registered to)")
        return started

    def close(self):
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait(10)


@pytest.fixture
def patient(planners, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT", PATIENCE)
    cluster_worker.signature.cache_clear()  # who edits optiplan while tests run has another one


@pytest.fixture
def dask(tmp_path, patient):
    """A scheduler without workers, for tests that start or kill some, or it."""
    started = Dask(tmp_path)
    yield started
    started.close()


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A scheduler with a worker, for all tests that kill neither."""
    started = Dask(tmp_path_factory.mktemp("dask"))
    started.workers(1)
    yield started
    started.close()


def run_there(path, folder, address, watch=lambda outcome: None):
    suite = load_suite(path, folder / "files")
    with open_results(suite, folder) as store:
        done = run_suite(suite, store, DaskCluster(address), "dask", watch)
        rows = {tuple(row)[:4]: dict(row) for row in store.query("SELECT * FROM runs")}
    return done, rows


def verdicts(rows):
    return {key: (row["verified"], row["failure_kind"], row["trajectory"]) for key, row in rows.items()}


def test_three_workers_one_killed_midway_give_what_a_local_run_gives(write_suite, run, dask, tmp_path):
    path = write_suite(count=2, planners=[SLOW, "quintic", "rrtconnect"], seeds=[0, 7])
    workers = dask.workers(3)
    seen = []

    def kill_one(outcome):
        seen.append(outcome.row)
        if len(seen) == 4:
            victim = next(p for p in workers if f"/{p.pid}/" in outcome.row.worker)
            victim.send_signal(signal.SIGKILL)

    done, rows = run_there(path, tmp_path / "there", dask.address, kill_one)
    assert (done.total, done.made, len(rows)) == (12, 12, 12)
    assert sum(process.poll() is not None for process in workers) == 1
    assert len({row["worker"] for row in rows.values()}) >= 2
    local = run(path)[1]
    assert verdicts(rows) == verdicts(local)
    assert run_there(path, tmp_path / "there", dask.address)[0].made == 0


def test_robots_and_meshes_travel(write_suite, tmp_path, patient, pair, robot_of_ours):
    path = write_suite(planners=["quintic"], problems=[{"glob": str(robot_of_ours / "p*.yaml")}])
    rows = run_there(path, tmp_path / "there", pair.address)[1]
    assert [(row["failure_kind"], row["verified"]) for row in rows.values()] == [(None, 1)] * 2
    kept = pair.processes[1].home / "cache" / "optiplan" / "travel"
    names = sorted(path.name for path in kept.rglob("*.*") if path.is_file())
    assert names == ["arm.urdf", "block.stl", "link.stl", "robot.yaml"]
    assert str(kept) in next(kept.rglob("arm.urdf")).read_text()


@pytest.mark.timeout(60)  # the thread of a client was seen to hang, until the limit of all tests
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1", "nonsense://x:1"])
def test_no_scheduler(address, monkeypatch):
    monkeypatch.setattr("optiplan.bench.dask.cluster.CONNECT", 0.5)
    with pytest.raises(ClusterError, match=r"no Dask scheduler at .*expected a running one"):
        DaskCluster(address)


@pytest.mark.parametrize(("late", "answer"), [(2, "a client"), (3, None)])
def test_a_client_whose_thread_starts_late_is_tried_again(late, answer, monkeypatch):
    attempts = []

    def client(address, **options):
        attempts.append(address)
        assert len(attempts) > late  # as distributed does when its thread has not started after 10 s
        return "a client"

    monkeypatch.setattr("distributed.Client", client)
    monkeypatch.setattr(DaskCluster, "_compare", lambda self: None)
    if answer:
        assert DaskCluster("tcp://127.0.0.1:9")._client == answer
    else:
        with pytest.raises(ClusterError, match="no Dask scheduler at"):
            DaskCluster("tcp://127.0.0.1:9")


def test_a_task_that_ends_with_a_timeout_of_its_own_is_not_waited_for(monkeypatch):
    class Failed:
        status = "error"

        def result(self, timeout):
            raise TimeoutError("the cache folder does not answer")

    monkeypatch.setattr("distributed.Client", lambda address, **options: None)
    monkeypatch.setattr(DaskCluster, "_compare", lambda self: None)
    there, future = DaskCluster("tcp://127.0.0.1:9"), Failed()
    there._running[future] = None, {}
    there._done.put(future)
    with pytest.raises(ClusterError, match="the cache folder does not answer"):
        next(there._arrived())


def test_a_worker_of_another_version_is_refused(patient, pair, monkeypatch):
    theirs = cluster_worker.signature()
    monkeypatch.setattr(cluster_worker, "signature", lambda: theirs | {"numpy": "0.1", "code": "x"})
    with pytest.raises(ClusterError, match=r"worker tcp://.* numpy [\d.]+ there, 0.1 here; code None there, x here"):
        DaskCluster(pair.address)


def test_one_that_comes_later_too(write_suite, dask, tmp_path, monkeypatch):
    cluster = DaskCluster(dask.address)
    theirs = cluster_worker.signature()
    monkeypatch.setattr(cluster_worker, "signature", lambda: theirs | {"numpy": "0.1"})
    dask.workers(1)
    suite = load_suite(write_suite(count=1), tmp_path / "files")
    with pytest.raises(ClusterError, match=r"that came later has other versions: numpy"):
        next(cluster.outcomes(suite.tasks()))


def test_stopping_gives_up_the_runs_under_way_and_ends_their_processes(write_suite, patient, pair, tmp_path):
    path = write_suite(count=1, planners=["bench_planners:Hangs"], limits={"wall": 60})
    cluster = DaskCluster(pair.address)
    threading.Timer(3.0, cluster.close).start()
    assert list(cluster.outcomes(load_suite(path, tmp_path).tasks())) == []
    found = subprocess.run(["pgrep", "-P", str(pair.processes[1].pid)], capture_output=True, check=False)
    assert found.stdout == b""


def test_a_scheduler_that_ends_is_an_error_and_no_traceback(write_suite, dask, tmp_path):
    records = logging.handlers.QueueHandler(queue.SimpleQueue())
    logging.getLogger("distributed.client").addHandler(records)
    path = write_suite(count=2, planners=[SLOW], repetitions=20)
    dask.workers(1)

    def end(outcome):
        dask.scheduler.kill()

    with pytest.raises(ClusterError, match=r"fails.*go on later"):
        run_there(path, tmp_path / "there", dask.address, end)
    logging.getLogger("distributed.client").removeHandler(records)
    assert records.queue.empty()


@pytest.mark.usefixtures("one_figure_of_measures")
def test_the_command_line(write_suite, patient, pair, tmp_path, capfd, monkeypatch):
    words = ["bench", str(write_suite()), "--out", str(tmp_path / "there"), "--dask"]
    assert main_run([*words, pair.address]) == 0
    assert "2 of 2 runs" in capfd.readouterr().out
    monkeypatch.setattr(cluster, "CONNECT", 2.0)  # nobody will ever answer there
    assert main_run([*words, "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler at tcp://127.0.0.1:9" in capfd.readouterr().err
    assert main_run([*words, pair.address, "--workers", "2"]) == 2
    assert "leave out --workers" in capfd.readouterr().err


def test_without_distributed_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r"pip install 'optiplan\[cluster\]'"):
        DaskCluster("tcp://127.0.0.1:9")
