"""What is kept for how long: by age, by size, and what nobody refers to; databases of older layouts are brought up,
and deleted ones told."""

import os
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
import sqlalchemy as sa

from optiplan.service.archive import outdated, sweep
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.keyed_tables import ProblemTable
from optiplan.service.store.run_table import NewRun, RunEnd, RunTable
from optiplan.service.store.tables import LAYOUT, DatabaseAwayError, about, benches, open_database, runs
from optiplan.service.store.write_probe import WriteProbe
from tests.waiting import wait_until

DAY = 86400.0


@pytest.fixture
def engine(tmp_path):
    found = open_database(f"sqlite:///{tmp_path / 'kept.sqlite'}")
    yield found
    found.dispose()


@pytest.fixture
def table(engine):
    return RunTable(engine)


def add(table, engine, name, age=0.0, size=0, contents=None, request="0" * 64, status="done"):
    """Record a run that was submitted so many seconds ago."""
    new = NewRun(name, name, "0" * 64, "planar2r", request, "quintic", 0, 1.0, None)
    table.add_ended(new, RunEnd("done", True, contents=contents or {}, bytes=size), time.time() - age)
    with engine.begin() as connection:
        connection.execute(runs.update().where(runs.c.id == name).values(status=status))


def test_runs_go_when_they_are_too_old(table, engine):
    for name, age in (("new", 0.0), ("nearly", 29.9 * DAY), ("old", 30.1 * DAY)):
        add(table, engine, name, age)
    add(table, engine, "waiting", 99 * DAY, status="queued")
    assert outdated(table, ServiceSettings(keep_days=30.0)) == ["old"]
    assert outdated(table, ServiceSettings(keep_days=float("inf"))) == []
    assert set(outdated(table, ServiceSettings(keep_days=0.0))) == {"new", "nearly", "old"}  # what waits is not old


def test_the_oldest_go_where_runs_are_too_many_bytes(table, engine):
    for number in range(5):
        add(table, engine, f"run{number}", age=60.0 * number, size=300)
    assert outdated(table, ServiceSettings(keep_bytes=1000)) == ["run3", "run4"]
    assert outdated(table, ServiceSettings(keep_bytes=1500)) == []
    assert len(outdated(table, ServiceSettings(keep_bytes=0))) == 5


def test_contents_go_with_the_last_that_refers_to_them(table, engine, tmp_path):
    contents, problems = ContentFolder(tmp_path / "contents", 0), ProblemTable(engine)
    request, shared, own, stored, lost = (contents.put(text) for text in (b"r", b"s", b"o", b"p", b"l"))
    add(table, engine, "one", contents={"run.json": shared, "trajectory.json": own}, request=request)
    add(table, engine, "two", contents={"run.json": shared}, request=request)
    problems.add("1" * 64, "kept", "panda", stored)
    problems.add("1" * 64, "kept", "panda", stored)
    assert sweep(contents, table, problems) == 0, "what is young may belong to a run that is being recorded"
    assert sweep(contents, table, problems, young=-1.0) == 1
    assert contents.get(lost) is None
    table.delete("one")
    assert sweep(contents, table, problems, young=-1.0) == 1
    assert contents.get(own) is None
    assert all(contents.get(digest) is not None for digest in (request, shared, stored))
    table.delete("two")
    problems.delete("1" * 64)
    assert sweep(contents, table, problems, young=-1.0) == 3


def test_the_request_counts_among_the_bytes_of_a_run(table):
    table.submit(replace(NEW, bytes=300), "one")
    table.begin(NEW.id, "me")
    table.end(NEW.id, "me", RunEnd("done", True, bytes=40))
    assert table.get(NEW.id)["bytes"] == 340
    table.add_ended(replace(NEW, id="2" * 32, bytes=5), RunEnd("done", True, bytes=2), time.time())
    assert table.get("2" * 32)["bytes"] == 7


NEW = NewRun("1" * 32, "a", "0" * 64, "planar2r", "0" * 64, "quintic", 0, 5.0, None)


@pytest.mark.parametrize(
    ("kind", "contents", "again"),
    [
        ("no-path", {"run.json": "2" * 64}, False),
        ("input", {"run.json": "2" * 64}, False),
        ("input", {}, True),  # a file of its problem is missing, or was changed
        ("bug", {"run.json": "2" * 64}, True),
    ],
)
def test_only_what_the_planner_answered_is_the_answer_for_good(table, kind, contents, again):
    table.submit(NEW, "one")
    table.begin(NEW.id, "me")
    table.end(NEW.id, "me", RunEnd("failed", failure={"kind": kind}, contents=contents))
    record, queued = table.submit(NEW, "two")
    assert queued == again
    assert record["status"] == ("queued" if again else "failed")


def test_what_is_submitted_while_it_is_cancelled_is_begun_anew(table):
    table.submit(NEW, "one")
    table.begin(NEW.id, "me")
    assert table.cancel(NEW.id, "one") == 0
    record, queued = table.submit(NEW, "two")
    assert (record["status"], record["cancel"], queued) == ("queued", False, True)
    assert not table.end(NEW.id, "me", RunEnd("cancelled")), "it ends the former try alone"
    assert table.begin(NEW.id, "me")["status"] == "running"


def test_a_damaged_content_is_written_anew(tmp_path):
    contents = ContentFolder(tmp_path, 0)
    digest = contents.put(b"whole")
    for damaged in (b"whol", b"wHole"):
        (tmp_path / digest[:2] / digest).write_bytes(damaged)
        assert contents.get(digest) is None
        assert contents.put(b"whole") == digest
        assert contents.get(digest) == b"whole"


def test_a_server_tidies_what_is_outdated_and_keeps_the_rest(server, monkeypatch):
    old, young = (server.submit(seed=seed)["id"] for seed in (7001, 7002))
    for run in (old, young):
        server.ended(run)
    engine = server.service.archive.engine
    with engine.begin() as connection:
        connection.execute(runs.update().where(runs.c.id == old).values(submitted=time.time() - 31 * DAY))
    server.service.tidy()
    assert server.http.get(f"/api/runs/{old}").status_code == 404
    assert server.http.get(f"/api/runs/{young}/trajectory.json").status_code == 200
    again = server.submit(seed=7001)["id"]
    assert again == old
    assert server.ended(again)["status"] == "done", "it is made anew"


def test_a_server_deletes_nothing_for_its_age_when_its_clock_was_set(server, monkeypatch):
    run = server.submit(seed=7003)["id"]
    server.ended(run)
    server.http.put("/api/uploads/kept.obj", content=b"v 0 0 0")
    os.utime(server.service.settings.upload_folder / "kept.obj", (0.0, 0.0))
    with server.service.archive.engine.begin() as connection:
        connection.execute(runs.update().where(runs.c.id == run).values(submitted=0.0))
    monkeypatch.setattr(server.service.archive, "clock", SimpleNamespace(even=lambda: False))
    server.service.tidy()
    assert server.http.get(f"/api/runs/{run}/trajectory.json").status_code == 200
    assert server.http.delete("/api/uploads/kept.obj").status_code == 204


def test_a_server_keeps_no_more_than_it_may(server, monkeypatch):
    kept = [server.submit(seed=seed)["id"] for seed in (7011, 7012, 7013)]
    sizes = {run: server.ended(run) and server.service.archive.runs.get(run)["bytes"] for run in kept}
    assert min(sizes.values()) > 1000
    ended = server.service.archive.runs.of_states(("done", "failed", "cancelled"))
    newest = sorted(ended, key=lambda record: record["submitted"], reverse=True)[:2]
    allowed = sum(record["bytes"] for record in newest)
    monkeypatch.setattr(server.service, "settings", replace(server.service.settings, keep_bytes=allowed))
    server.service.tidy()
    left = {record["id"] for record in server.service.archive.runs.of_states(("done", "failed", "cancelled"))}
    assert left == {record["id"] for record in newest}


def test_a_database_of_an_older_layout_is_brought_up(tmp_path):
    url = f"sqlite:///{tmp_path / 'old.sqlite'}"
    engine = open_database(url)
    with engine.begin() as connection:
        benches.drop(connection)
        connection.execute(about.update().where(about.c.key == "layout").values(value="1"))
    engine.dispose()
    engine = open_database(url)
    assert sa.inspect(engine).has_table("optiplan_benches")
    with engine.connect() as connection:
        assert connection.scalar(sa.select(about.c.value).where(about.c.key == "layout")) == str(LAYOUT)
    engine.dispose()


def test_a_database_whose_file_was_deleted_is_away_until_it_is_back(tmp_path):
    file, aside = tmp_path / "here.sqlite", tmp_path / "aside.sqlite"
    engine = open_database(f"sqlite:///{file}")
    probe, table = WriteProbe(engine, ContentFolder(tmp_path / "contents", 0)), RunTable(engine)
    wait_until(lambda: probe.fault() is None)
    file.rename(aside)
    for _ in range(2):
        with pytest.raises(DatabaseAwayError, match="its file was deleted or replaced"):
            table.tell([("0" * 32, {"type": "best"})])
        file.touch()  # another one
    wait_until(lambda: "its file was deleted or replaced" in str(probe.fault()))
    aside.replace(file)
    wait_until(lambda: probe.fault() is None)
    engine.dispose()
