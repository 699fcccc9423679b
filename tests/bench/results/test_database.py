import json
import sqlite3
import zlib
from contextlib import closing
from dataclasses import fields, replace

import numpy as np
import pytest

from optiplan.bench.execution.run_task import hash_and_pack
from optiplan.bench.results import database, measures
from optiplan.bench.results.database import SCHEMA_VERSION, Store, StoreError
from optiplan.bench.results.records import BenchPlanner, BenchProblem, Outcome, Row
from optiplan.errors import InputError, UnknownChoiceError
from optiplan.trajectory.trajectory import Trajectory

PROBLEMS = (BenchProblem("s/a", "s", "hard", "00", {"version": 1}, {"file": "a.yaml"}),)
PLANNERS = (BenchPlanner("p", "quintic", {"goals": 2}),)
MOTION = Trajectory(("j",), [0.0, 1.0 / 3.0], np.array([[[0.1], [1e-17], [0.7]]]))


@pytest.fixture
def store(tmp_path):
    with Store.create(tmp_path / "out", {"name": "mine"}) as store:
        store.fill(PROBLEMS, PLANNERS)
        store.begin("1 local", {"cores": 2}, {"optiplan": "0"})
        yield store


def outcome(seed=0, motion=MOTION):
    digest, blob = hash_and_pack(motion)
    return Outcome(Row("s/a", "p", seed, 0, "s", None, witness={"q": [1.0]}, trajectory=digest), blob)


def test_columns_of_the_table_are_the_fields_of_a_row(store):
    names = [row["name"] for row in store.query("PRAGMA table_info(runs)")]
    assert names == [*(item.name for item in fields(Row)), "session"]


def test_what_goes_in_comes_out(store):
    store.add(outcome())
    (row,) = store.query("SELECT * FROM runs")
    assert json.loads(row["witness"]) == {"q": [1.0]}
    assert (row["executed"], row["verified"], row["session"]) == (None, 0, 1)
    motion = store.trajectory(row["trajectory"])
    assert (motion.coefficients == MOTION.coefficients).all()
    assert (motion.breakpoints == MOTION.breakpoints).all()
    assert store.problem("s/a") == PROBLEMS[0]
    assert (store.meta("name"), store.meta("schema_version")) == ("mine", SCHEMA_VERSION)
    with pytest.raises(UnknownChoiceError, match="choose from: s/a"):
        store.problem("s/b")
    for ask in (store.meta, store.trajectory):
        with pytest.raises(KeyError):
            ask("nothing")


def test_a_run_is_stored_once_and_a_motion_once(store):
    store.add(outcome(0))
    store.add(outcome(1))
    with pytest.raises(sqlite3.IntegrityError, match="UNIQUE"):
        store.add(outcome(1))
    store.add(outcome(2, Trajectory(("j",), [0.0, 1.0 / 3.0], np.array([[[0.1], [2e-17], [0.7]]]))))
    assert store.done() == {("s/a", "p", seed, 0) for seed in range(3)}
    assert len(store.query("SELECT * FROM trajectories")) == 2
    with pytest.raises(sqlite3.IntegrityError, match="FOREIGN KEY"):
        store.add(replace(outcome(), row=replace(outcome().row, problem="s/b")))


def test_the_hash_is_of_the_content(store):
    digest, blob = hash_and_pack(MOTION)
    assert json.loads(zlib.decompress(blob)) == json.loads(json.dumps(MOTION.to_dict()))
    assert hash_and_pack(Trajectory(MOTION.joint_names, MOTION.breakpoints, MOTION.coefficients))[0] == digest
    assert hash_and_pack(None) == (None, None)


def test_reading_while_somebody_writes(store):
    store.add(outcome())
    with Store(store.folder) as reader:
        batches = reader.batches("SELECT * FROM runs")
        store.add(outcome(1))
        assert len(reader.done()) == 2
        assert sum(map(len, batches)) == 2


def test_a_report_is_of_one_moment(store, monkeypatch):
    def meanwhile(reader, load=measures.load_runs):
        store.add(outcome(0))
        return load(reader)

    store.add(outcome(1))
    monkeypatch.setattr(measures, "load_runs", meanwhile)
    with Store(store.folder) as reader:
        assert measures.load_results(reader).runs.seed.tolist() == [1]
        assert len(reader.done()) == 2


def test_closed_it_is_one_file(store):
    store.add(outcome())
    store.end("complete")
    store.close()
    assert sorted(path.name for path in store.folder.iterdir()) == ["lock", "results.sqlite"]
    with Store(store.folder) as reader:
        assert [row["how"] for row in reader.query("SELECT how FROM sessions")] == ["complete"]


def test_a_filled_store_that_cannot_be_made_one_file_is_not_moved(tmp_path, monkeypatch):
    connected = database._connected

    def at_once(path, write):
        db = connected(path, write)
        db.execute("PRAGMA busy_timeout = 0")
        return db

    monkeypatch.setattr(database, "_connected", at_once)
    filled = Store.filled(tmp_path / "filled", {"name": "mine"})
    store = filled.__enter__()
    store.fill(PROBLEMS, PLANNERS)
    with closing(sqlite3.connect(store.path, isolation_level=None)) as reader:
        reader.execute("BEGIN")
        reader.execute("SELECT * FROM problems").fetchall()
        with pytest.raises(StoreError, match="locked"):
            filled.__exit__(None, None, None)
    assert not (tmp_path / "filled").exists()


def test_what_is_no_results_is_refused(tmp_path, store):
    with pytest.raises(InputError, match=r"no results\.sqlite"):
        Store(tmp_path)
    with sqlite3.connect(store.path) as db:
        db.execute("UPDATE meta SET value = '99' WHERE key = 'schema_version'")
    with pytest.raises(InputError, match="schema version 99; expected 1"):
        Store(store.folder)
    with sqlite3.connect(tmp_path / "results.sqlite") as db:
        db.execute("CREATE TABLE others (x)")
    with pytest.raises(InputError, match="a database without the table `meta`; expected results of a suite"):
        Store(tmp_path)
    (tmp_path / "results.sqlite").write_text("no database" * 100)
    with pytest.raises(StoreError, match="no database of results"):
        Store(tmp_path)


def test_what_cannot_be_opened_is_not_kept_locked(tmp_path, store):
    store.close()
    whole = store.path.read_bytes()
    store.path.write_text("no database" * 100)
    with pytest.raises(StoreError):
        Store(store.folder, write=True)
    store.path.write_bytes(whole)
    Store(store.folder, write=True).close()
    with pytest.raises(InputError, match="is there already"):
        Store.create(store.folder, {})
    Store(store.folder, write=True).close()
