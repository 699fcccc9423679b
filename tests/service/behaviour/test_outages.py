"""The database goes away while runs are solved: nothing dies, what could not be told is told later, health says so."""

import json
import sqlite3
import subprocess
import sys
import threading
import time
from concurrent.futures import Future

import pytest
import sqlalchemy as sa
from service_outages import outage_round
from service_process import postgres_folder, postgres_server

from optiplan.service.execution import leases
from optiplan.service.execution.event_writer import EventWriter
from optiplan.service.execution.leases import take_lease
from optiplan.service.execution.run_solver import RunSolver
from optiplan.service.execution.solver_pool import SolverAnswer
from optiplan.service.settings import ServiceSettings
from optiplan.service.store import tables
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.run_table import NewRun, RunEnd, RunTable
from optiplan.service.store.tables import DatabaseAwayError, open_database
from optiplan.service.store.write_probe import WriteProbe
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import PATIENCE, wait_until

needs_postgres = pytest.mark.skipif(postgres_folder() is None, reason="PostgreSQL is not installed")


class Breaking:
    """A method that raises so many times before it works; `failed` is set by the first."""

    def __init__(self, method, error, times=3):
        self.method, self.error, self.left, self.failed = method, error, times, threading.Event()

    def __call__(self, *args, **kwargs):
        if self.left > 0:
            self.left -= 1
            self.failed.set()
            raise self.error
        return self.method(*args, **kwargs)


def events_of(server, run, last=""):
    """The events of a run, each with its id, or None."""
    found, number = [], None
    headers = {"Last-Event-ID": last} if last else {}
    with server.http.stream("GET", f"/api/runs/{run}/events", headers=headers) as lines:
        for line in lines.iter_lines():
            if line.startswith("id:"):
                number = line[3:].strip()
            elif line.startswith("data:"):
                found.append((number, json.loads(line[5:])))
                number = None
    return found


def test_a_telling_that_raises_leaves_the_slot_alive_and_is_made_up_for(server, monkeypatch):
    tell = Breaking(server.service.archive.runs.tell, DatabaseAwayError("it is gone", False))
    monkeypatch.setattr(server.service.archive.runs, "tell", tell)
    run = server.submit(problem=NO_WAY, budget=1.0, seed=901)["id"]
    assert server.ended(run)["status"] == "failed"
    assert tell.failed.is_set()
    assert any(event["type"] == "stage" for _, event in events_of(server, run))
    assert server.service.pool.ended == []
    assert server.ended(server.submit(seed=902)["id"])["status"] == "done"


@pytest.mark.parametrize("method", ["begin", "end"])
def test_a_change_that_the_database_does_not_take_is_made_later(server, monkeypatch, method):
    change = Breaking(getattr(server.service.archive.runs, method), DatabaseAwayError("it is gone", False))
    monkeypatch.setattr(server.service.archive.runs, method, change)
    run = server.submit(seed=903 + (method == "end"))["id"]
    assert server.ended(run)["verified"]
    assert change.failed.is_set()
    assert [event["type"] for _, event in events_of(server, run)].count("end") == 1


def test_a_plan_that_was_answered_is_kept_once_the_database_takes_it(server, monkeypatch):
    add = Breaking(server.service.archive.runs.add_ended, DatabaseAwayError("it is gone", False))
    monkeypatch.setattr(server.service.archive.runs, "add_ended", add)
    run = server.http.post("/api/plan", json={"problem": QUICK, "seed": 910}).json()
    assert server.ended(run["id"])["duration"] == run["duration"]
    assert add.failed.is_set()


def test_a_plan_that_could_not_be_kept_is_refused(server, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(server.service.archive.probe, "fault", lambda: DatabaseAwayError("it is gone", False))
        answer = server.http.post("/api/plan", json={"problem": QUICK, "seed": 911})
        assert (answer.status_code, answer.headers["Retry-After"]) == (503, "2")
        assert answer.json()["error"] == server.http.get("/readyz").json()["error"]
        assert "it is gone" in answer.json()["error"]
    assert server.http.post("/api/plan", json={"problem": QUICK, "seed": 911}).status_code == 200


def test_an_end_that_is_refused_for_good_is_a_failure(server, monkeypatch):
    end = Breaking(server.service.archive.runs.end, ValueError("no row takes this"), times=1)
    monkeypatch.setattr(server.service.archive.runs, "end", end)
    ended = server.ended(server.submit(seed=905)["id"])
    assert (ended["status"], ended["failure"]["kind"]) == ("failed", "bug")


def test_an_exception_while_a_run_is_solved_is_its_end(server, monkeypatch):
    monkeypatch.setattr(
        server.service.archive.contents, "get", Breaking(server.service.archive.contents.get, OSError("gone"), times=1)
    )
    ended = server.ended(server.submit(seed=906)["id"])
    assert (ended["status"], ended["failure"]["kind"]) == ("failed", "bug")


def test_a_database_that_is_held_is_away_until_it_is_let_go(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "BUSY", 0.1)
    file = tmp_path / "held.sqlite"
    engine = open_database(f"sqlite:///{file}")
    probe, runs = WriteProbe(engine, ContentFolder(tmp_path / "contents", 0)), RunTable(engine)
    wait_until(lambda: probe.fault() is None)
    holder = sqlite3.connect(file, isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    with pytest.raises(DatabaseAwayError, match="another process holds it"):
        runs.tell([("0" * 32, {"type": "best"})])
    assert "another process holds it" in str(probe.fault()), "also where it took a change just before"
    holder.execute("ROLLBACK")
    wait_until(lambda: probe.fault() is None)
    engine.dispose()
    holder.close()


def test_a_full_disk_is_told_from_a_database_that_is_away(tmp_path):
    engine = open_database(f"sqlite:///{tmp_path / 'full.sqlite'}")
    with engine.connect() as connection:
        connection.execute(sa.text("PRAGMA max_page_count = 1"))
        with pytest.raises(DatabaseAwayError) as raised:
            connection.execute(tables.events.insert(), [{"run": "0", "data": {"a": "x" * 5000}}] * 20)
    assert raised.value.full
    engine.dispose()


def clocks_apart(url, monkeypatch, folder):
    """The end of a run whose deadline is 30 s, submitted at a machine one hour behind the worker's."""
    engine = open_database(url)
    runs, contents, real = RunTable(engine), ContentFolder(folder, 0), time.time

    class Pool:
        def submit(self, lane, job):
            done: Future = Future()
            done.set_result(SolverAnswer({"error": "planned", "left": job.until - time.monotonic()}))
            return done

    request = contents.put(json.dumps({"problem": QUICK}).encode())
    monkeypatch.setattr(time, "time", lambda: real() - 3600.0)
    runs.submit(NewRun("1" * 32, "a", "0" * 64, "planar2r", request, "quintic", 0, 5.0, 30.0), "2" * 32)
    monkeypatch.setattr(time, "time", real)
    record = runs.begin("1" * 32, "worker")
    solver = RunSolver(ServiceSettings(data=folder), EventWriter(runs), contents, Pool())
    monkeypatch.setattr(time, "time", lambda: real() + 3600.0)
    end = solver(record, threading.Event())
    monkeypatch.setattr(time, "time", real)
    engine.dispose()
    return end


def test_a_deadline_does_not_mind_clocks(tmp_path, monkeypatch):
    end = clocks_apart(f"sqlite:///{tmp_path / 'a.sqlite'}", monkeypatch, tmp_path)
    assert end.failure["detail"] == "planned"


@needs_postgres
def test_postgresql_goes_and_comes_back(tmp_path, monkeypatch):
    """Its clock counts; an outage is told as one; leases live through it, and end with their process."""
    monkeypatch.setattr(leases, "RENEW", 0.1)
    monkeypatch.setattr(leases, "LAPSE", 6.0)  # of which renewing takes far less on a busy machine
    with postgres_server() as server:
        url = server.url.replace("postgresql:", "postgresql+psycopg:")
        assert clocks_apart(url, monkeypatch, tmp_path).failure["detail"] == "planned"
        engine = open_database(url)
        runs, probe = RunTable(engine), WriteProbe(engine, ContentFolder(tmp_path / "contents", 0))
        assert abs(runs.now() - time.time()) < 60.0
        mine, other = take_lease(engine, tmp_path), take_lease(engine, tmp_path)
        assert mine.alive(other.name)
        server.stop()
        with pytest.raises(DatabaseAwayError):
            runs.tell([("0" * 32, {"type": "best"})])
        with pytest.raises(sa.exc.SQLAlchemyError):
            mine.alive(other.name)
        wait_until(lambda: probe.fault() is not None)
        assert server.start()
        wait_until(lambda: probe.fault() is None)
        runs.tell([("0" * 32, {"type": "best"})])
        assert all(mine.alive(other.name) for _ in range(20))
        other.close()
        wait_until(lambda: not mine.alive(other.name))
        assert mine.held
        mine.close()
        engine.dispose()


def test_a_lease_is_kept_through_an_outage_that_nobody_asked_in(tmp_path):
    """A worker that only solves asks for nobody's lease, and its own is there for others after an outage."""
    if postgres_folder() is None:
        pytest.skip("PostgreSQL is not installed")
    with postgres_server() as server:
        engine = open_database(server.url.replace("postgresql:", "postgresql+psycopg:"))
        worker = take_lease(engine, tmp_path)
        server.stop()
        assert server.start()
        key = leases._key(worker.name)
        look = sa.text("SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND objid = :low")

        def taken():
            with engine.connect() as connection:
                return connection.scalar(look, {"low": key & 0xFFFFFFFF})

        wait_until(taken)
        worker.close()
        engine.dispose()


LAST_RESORTS = """
import os, sys, threading, time
from optiplan.service import server

def exit_code(act, grace):
    if not (child := os.fork()):
        server.GRACE, server.LINGER = grace, 0.5
        act()
        sys.exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

def hangs():
    with server._LastResort() as last:
        last.begin()
        time.sleep(600)

def leaves_a_thread():
    with server._LastResort() as last:
        last.begin()
    threading.Thread(target=time.sleep, args=(600,)).start()

def goes_on():
    with server._LastResort() as last:
        pass
    time.sleep(2.0)
    sys.exit(7)

print(exit_code(hangs, 0.5), exit_code(leaves_a_thread, 60.0), exit_code(goes_on, 0.5))
"""
"""Exit codes of what happens after a signal, each in a process of its own, with so much grace, s."""


def test_a_signal_ends_a_process_in_which_something_hangs():
    command = [sys.executable, "-c", LAST_RESORTS]
    told = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=PATIENCE, check=True).stdout
    assert told.split() == ["1", "0", "7"]


def test_events_have_numbers_and_are_resumed(server):
    run = server.submit(problem=NO_WAY, budget=1.0, seed=907)["id"]
    first = events_of(server, run)
    numbers = [int(number) for number, event in first if number]
    assert numbers == sorted(set(numbers))
    assert len(numbers) >= 3
    assert first[-1] == (str(numbers[-1]), {"type": "end", "status": "failed", "verified": False})
    rest = events_of(server, run, str(numbers[1]))
    assert [event for _, event in rest] == [event for number, event in first if number and int(number) > numbers[1]]
    assert events_of(server, run, str(numbers[-1]))[-1][1]["type"] == "end"
    for unknown in ("99999999", "no-number", "9" * 40):
        assert len(events_of(server, run, unknown)) >= len(numbers), "an id of another database: from the beginning"


def test_a_stream_survives_a_database_that_goes_away(server, monkeypatch):
    away = DatabaseAwayError("it is gone", False)
    run = server.submit(problem=NO_WAY, budget=1.5, seed=908)["id"]
    look = Breaking(server.service.archive.runs.events_after, away, times=2)
    monkeypatch.setattr(server.service.archive.runs, "events_after", look)
    found = events_of(server, run)
    assert look.failed.is_set()
    assert [event["type"] for _, event in found].count("end") == 1
    assert any(event["type"] == "stage" for _, event in found)


def test_a_run_that_is_tried_again_has_the_events_of_its_last_try(server):
    run = server.submit(problem=NO_WAY, budget=60.0, seed=909)["id"]
    server.http.post(f"/api/runs/{run}/cancel")
    assert server.ended(run)["status"] == "cancelled"
    assert events_of(server, run)[-1][1]["status"] == "cancelled"
    server.submit(problem=NO_WAY, budget=60.0, seed=909)
    while server.http.get(f"/api/runs/{run}").json()["status"] != "running":
        time.sleep(0.05)
    assert all(data["type"] != "end" for _, _, data in server.service.archive.runs.events_after(0, [run]))
    server.http.post(f"/api/runs/{run}/cancel")
    server.ended(run)


def test_events_of_one_run_are_written_in_order_and_bad_ones_alone_are_lost(tmp_path):
    engine = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    runs = RunTable(engine)
    writer = EventWriter(runs)
    for number in range(5):
        writer.report("run", {"type": "best", "seconds": number if number != 3 else object()})
    writer.start()
    writer.settle("run", threading.Event())
    assert [data["seconds"] for _, _, data in runs.events_after(0, ["run"])] == [0, 1, 2, 4]
    assert writer.alive
    writer.close(5.0)
    engine.dispose()


@pytest.mark.parametrize("kind", ["SQLite", pytest.param("PostgreSQL", marks=needs_postgres)])
def test_a_server_and_a_worker_live_through_an_outage(kind):
    found = outage_round(kind, 1.0)
    assert found.faults == []
    assert found.answered == 8


def test_an_end_is_recorded_with_its_event(tmp_path):
    engine = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    runs = RunTable(engine)
    runs.submit(NewRun("1" * 32, "a", "0" * 64, "planar2r", "0" * 64, "quintic", 0, 5.0, None), "2" * 32)
    assert runs.begin("1" * 32, "me")["tries"] == 1
    assert runs.begin("1" * 32, "me")["tries"] == 1, "asked again, since no answer came"
    assert runs.begin("1" * 32, "another") is None
    assert not runs.end("1" * 32, "another", RunEnd("done"))
    assert runs.end("1" * 32, "me", RunEnd("done", True))
    assert not runs.end("1" * 32, "me", RunEnd("done", True))
    types = [data["type"] for _, _, data in runs.events_after(0, ["1" * 32])]
    assert types == ["status", "end"]
    engine.dispose()
