"""Servers that are killed, workers that share, stops that are asked for: no run is lost, none is done twice."""

import csv
import errno
import fcntl
import json
import os
import sqlite3
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from uuid import uuid4

import numpy as np
import pytest
import sqlalchemy as sa
from service_faults import Plan, faults
from service_outages import QUICK
from service_process import HTTP, Program, free_port, postgres, postgres_folder, serving
from sqlalchemy import make_url

from optiplan.cli.main import run as command
from optiplan.errors import OptiPlanError
from optiplan.service.client import Client
from optiplan.service.execution.leases import take_lease
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.keyed_tables import ProblemTable
from optiplan.service.store.tables import LAYOUT, about, open_database, store_name
from tests.waiting import PATIENCE, wait_until


@pytest.fixture(scope="module")
def postgresql():
    """The address of a PostgreSQL of our own: it takes seconds to make."""
    if postgres_folder() is None:
        pytest.skip("PostgreSQL is not installed")
    with postgres() as address:
        yield make_url(address)


@pytest.fixture
def database(postgresql):
    """The address of an empty database there, another one for each test."""
    name = f"of_{uuid4().hex}"
    engine = sa.create_engine(driven(postgresql), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(sa.text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return postgresql.set(database=name)


def driven(address):
    """The address with the driver that SQLAlchemy is to load."""
    return address.set(drivername="postgresql+psycopg").render_as_string(hide_password=False)


def test_kills_on_sqlite(tmp_path):
    found = faults(tmp_path, "", Plan(rounds=1, jobs=4))
    assert found.faultless, found
    assert found.done == 4


def test_two_workers_share_the_runs_of_one_postgresql_and_kills_lose_none(tmp_path, database):
    """First nothing is killed, and both solve; then the server or a worker is, twice."""
    found = faults(tmp_path, str(database), Plan(rounds=2, jobs=6, workers=2, seed=1, shared=24))
    engine = sa.create_engine(driven(database))
    with engine.connect() as connection:
        ended = connection.scalar(sa.text("SELECT count(*) FROM optiplan_runs WHERE status = 'done'"))
    engine.dispose()
    assert found.faultless, found
    assert found.done == ended == 30
    assert len(found.shares) == 2
    assert min(found.shares.values()) >= 1


def names_at_once(url):
    """What eight that start at the same moment call the store of an empty database."""

    def name(_):
        engine = open_database(url)
        start.wait()
        try:
            return store_name(engine)
        finally:
            engine.dispose()

    start = threading.Barrier(8, timeout=PATIENCE)
    with ThreadPoolExecutor(8) as threads:
        return set(threads.map(name, range(8)))


def test_server_and_workers_may_start_at_once_on_an_empty_postgresql(database):
    assert len(names_at_once(driven(database))) == 1


def test_several_may_store_one_problem_at_once(database):
    with ThreadPoolExecutor(8) as threads:
        engine = open_database(driven(database))
        for k in range(20):
            stored = [threads.submit(ProblemTable(engine).add, f"{k:064}", "a", "panda", "0" * 64) for _ in range(8)]
            assert [one.result(PATIENCE) for one in stored] == [None] * 8
        engine.dispose()


def test_servers_may_start_at_once_on_an_empty_folder(tmp_path):
    assert len(names_at_once(f"sqlite:///{tmp_path / 'runs.sqlite'}")) == 1


DRIVER = "paper=file:path={},patience=0.1"


def test_a_server_that_is_stopped_stops_its_robot_and_leaves_its_run_to_the_next(tmp_path):
    """Streams end with an event; a client that watches goes on as soon as there is a server again."""
    slow = QUICK.replace("[-1, 0.18, 1]", "[0.77, 0.18, -0.03]")  # in the way, so that shorter ones are searched
    slow = slow.replace("quintic", "{name: rrtstar, iterations: 100000}")
    table, told = tmp_path / "table.csv", []
    given = ("--solvers", "1", "--port", str(free_port()))

    def watch():
        with HTTP.stream("GET", f"{server.url}/api/runs/{run}/events") as lines:
            told.extend(json.loads(line[5:]) for line in lines.iter_lines() if line.startswith("data:"))

    with (
        serving(tmp_path / "data", *given, "--driver", DRIVER.format(table)) as server,
        Client(server.url) as client,
    ):
        executed(server)
        run = HTTP.post(f"{server.url}/api/runs", json={"problem": slow, "budget": 3.0}).json()["id"]
        watcher = threading.Thread(target=watch)
        watcher.start()
        events = client.watch(run)
        heard = [next(events), next(events)]
        wait_until(lambda: told and HTTP.get(f"{server.url}/api/runs/{run}").json()["status"] == "running")
        assert server.stop() == 0
        assert np.abs(speeds(table.with_name("table.csv.partial"))[-20:]).max() == 0.0
        watcher.join(PATIENCE)
        assert told[-1]["type"] == "stopping"
        with serving(tmp_path / "data", *given) as second:
            heard.extend(events)
            assert second.stop() == 0
    assert heard[-1] == {"type": "end", "status": "done", "verified": True}
    assert sum(event["type"] == "end" for event in heard) == 1
    assert len({event["by"] for event in heard if "by" in event}) == 2, "it was solved by the second server"


def executed(server):
    """Execute the problem; return once the robot is on its way."""
    given = {"problem": QUICK, "budget": 5.0, "driver": "paper", "override": 0.1}
    started = HTTP.post(f"{server.url}/api/executions", json=given, timeout=PATIENCE)
    assert started.status_code == 201, started.text
    url = f"{server.url}/api/executions/{started.json()['id']}"
    wait_until(lambda: (HTTP.get(url).json()["state"] or {"progress": 0.0})["progress"] > 0.1)


def test_a_robot_stands_still_after_its_server_was_killed(tmp_path):
    table = tmp_path / "table.csv"
    with serving(tmp_path / "data", "--solvers", "0", "--driver", DRIVER.format(table)) as server:
        executed(server)
        server.kill()
    wait_until(lambda: np.abs(speeds(table.with_name("table.csv.partial"))[-20:]).max() == 0.0)
    assert not table.exists()  # it did not come to its end


def speeds(table):
    """The speed of the first joint in the rows that are written as yet, at least its first one."""
    head, *rows = csv.reader(table.read_text().splitlines())
    column = head.index("v shoulder")
    return np.array([row[column] for row in rows if len(row) == len(head) and row[column]] or [1.0], float)


def too_many_files(*_):
    raise OSError(errno.EMFILE, "Too many open files")


def test_a_lease_ends_with_its_process(tmp_path, monkeypatch):
    engine = sa.create_engine("sqlite://")
    mine, other = take_lease(engine, tmp_path), take_lease(engine, tmp_path)
    assert mine.alive(mine.name)
    assert mine.alive(other.name)
    with monkeypatch.context() as patch:
        patch.setattr(os, "open", too_many_files)
        assert mine.alive(other.name), "it could not be looked at"
    other.close()
    assert not mine.alive(other.name)
    assert not mine.alive("never was")


def test_a_lease_that_another_process_finds_before_it_is_locked_is_held_all_the_same(tmp_path, monkeypatch):
    """Processes that start together each remove the files that have no lock."""
    engine, flock, others = sa.create_engine("sqlite://"), fcntl.flock, []

    def late(handle, how):
        if how == fcntl.LOCK_EX and not others:  # of the first lease
            monkeypatch.setattr(fcntl, "flock", flock)
            others.append(take_lease(engine, tmp_path))
        flock(handle, how)

    monkeypatch.setattr(fcntl, "flock", late)
    mine = take_lease(engine, tmp_path)
    assert others[0].alive(mine.name)
    assert mine.alive(others[0].name)


def test_only_the_file_that_was_found_without_a_lock_is_removed(tmp_path, monkeypatch):
    """It may have been removed and made anew, with a lock, since it was opened."""
    lease, flock, path, made = take_lease(sa.create_engine("sqlite://"), tmp_path), fcntl.flock, tmp_path / "x", []
    path.touch()
    old = path.stat().st_ino

    def replaced(handle, how):
        if not made and os.fstat(handle).st_ino == old:
            path.unlink()
            made.append(os.open(path, os.O_CREAT | os.O_RDWR))
            flock(made[0], fcntl.LOCK_EX)
        flock(handle, how)

    monkeypatch.setattr(fcntl, "flock", replaced)
    assert not lease.alive("x")
    assert lease.alive("x")
    os.close(made[0])
    assert not lease.alive("x")
    assert not path.exists()


def test_a_database_of_a_newer_layout_is_refused(tmp_path):
    url = f"sqlite:///{tmp_path / 'a.sqlite'}"
    engine = open_database(url)
    open_database(url).dispose()
    with engine.begin() as connection:
        connection.execute(about.update().where(about.c.key == "layout").values(value=str(LAYOUT + 1)))
    with pytest.raises(OptiPlanError, match="newer OptiPlan"):
        open_database(url)
    with pytest.raises(OptiPlanError, match="expected sqlite:///PATH or postgresql://"):
        open_database("nonsense://x")


def test_the_sqlite_file_of_another_program_is_refused_and_stays_as_it_is(tmp_path):
    with closing(sqlite3.connect(tmp_path / "a.sqlite")) as other:
        other.execute("CREATE TABLE orders (id INTEGER)")
    with pytest.raises(OptiPlanError, match="another program, with the tables orders"):
        open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    with closing(sqlite3.connect(tmp_path / "a.sqlite")) as other:
        assert other.execute("SELECT name FROM sqlite_master").fetchall() == [("orders",)]


def test_a_folder_belongs_to_one_database(tmp_path):
    folder = ContentFolder(tmp_path, 0)
    folder.claim("one")
    folder.claim("one")
    with pytest.raises(OptiPlanError, match="belongs to another database"):
        folder.claim("two")
    digest = folder.put(b"content")
    assert folder.put(b"content") == digest
    assert folder.get(digest) == b"content"
    (tmp_path / digest[:2] / digest).write_bytes(b"damaged")
    assert folder.get(digest) is None
    assert folder.put(b"content") == digest


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--host", "0.0.0.0"], "OPTIPLAN_TOKEN"),
        (["--host", "192.0.2.1", "--token-file", "{token}"], "cannot listen"),
        (["--token-file", "/nowhere/token"], "token-file"),
        (["--database-password-file", "/nowhere/password"], "--database postgresql://USER@HOST/NAME"),
        (["--database", "postgresql://x@y/z", "--database-password-file", "/nowhere"], "database-password-file"),
        (["--trusted-proxy", "10.0.0.0/99"], "trusted-proxy"),
        (["--root-path", "optiplan"], "root-path"),
        (["--folder", "/nowhere"], "folder"),
        (["--driver", "arm=steam"], "one of: sim"),
        (["--driver", "arm=sim:rate"], "KEY=VALUE"),
        (["--driver", "sim", "--driver", "sim"], "no other driver has"),
        (["--driver", "arm=sim:patience=9"], "driver.patience"),
        (["--database", "mysql://x/y"], "expected sqlite:///PATH or postgresql://"),
        (["--log-level", "loud"], "choose from"),
        (["--memory", "inf"], "--memory"),
        (["--keep-gb", "nan"], "--keep-gb"),
        (["--keep-days", "nan"], "--keep-days"),
        (["--database", "postgresql://user:secret@host:port/name"], "user:***@host:port/name"),
    ],
)
def test_a_server_that_cannot_start_says_why(arguments, word, tmp_path, capsys):
    (tmp_path / "token").write_text("a-token-of-enough-characters\n")
    arguments = [argument.format(token=tmp_path / "token") for argument in arguments]
    assert command(["serve", "--port", "0", "--data", str(tmp_path / "data"), *arguments]) == 2
    assert word in " ".join(capsys.readouterr().err.split())


def test_the_password_of_a_database_comes_from_a_file():
    secret = "p@ss/w:ord?"
    settings = ServiceSettings(database="postgresql://optiplan@db:5433/optiplan", database_password=secret)
    address = make_url(settings.database_url)
    assert (address.username, address.password, address.host, address.port) == ("optiplan", secret, "db", 5433)
    assert secret not in repr(settings)


def test_a_worker_says_that_it_works(tmp_path):
    worker = Program(
        "worker", "--database", f"sqlite:///{tmp_path / 'w.sqlite'}", "--data", str(tmp_path), "--solvers", "1"
    )
    assert worker.stop() == 0
