"""`results.sqlite`: everything about a suite's runs in one file, one transaction a run.

docs/how-to/benchmarks.md tells the schema.
The database is in WAL mode: readers never wait, and after a `kill -9` or on a full disk it holds every run that was
stored and nothing of any other. `synchronous = NORMAL` leaves the last runs to the operating system for a moment: if
the machine itself goes down they are made again, and the file is whole all the same.
"""

import json
import os
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Final, Self

from optiplan.bench.execution.machine import now
from optiplan.bench.results.records import COLUMNS, BenchPlanner, BenchProblem, Key, Outcome
from optiplan.bench.results.tables import (
    ABSORB_PLANNERS,
    ABSORB_PROBLEMS,
    ABSORB_RUNS,
    ABSORB_SESSIONS,
    ADDED,
    SCHEMA,
    SCHEMA_VERSION,
    VIEW,
)
from optiplan.errors import InputError, Issue, OptiPlanError, UnknownChoiceError
from optiplan.files import flush, lock, replacing
from optiplan.trajectory.trajectory import Trajectory

FILE = "results.sqlite"
LOCK = "lock"
BATCH = 20_000
"""Rows at a time."""

JSON_COLUMNS = ("witness", "metrics", "timings", "info", "improvements")
"""Columns of `runs` that hold JSON text."""
INSERT = f"INSERT INTO runs ({', '.join(COLUMNS)}, session) VALUES ({', '.join('?' * (len(COLUMNS) + 1))})"


_REQUIRED: Final = object()


class StoreError(OptiPlanError):
    """The results cannot be read or written; earlier runs are intact."""


class Store:
    """Open results of one suite; use as a context manager.

    One process at a time may write (`write`), any number may read.
    """

    def __init__(self, folder: Path, *, write: bool = False) -> None:
        """Open the results in a folder, which must be there.

        Raises:
            InputError: there are none, they are of another version, or another process is writing to them.
            StoreError: the file cannot be opened.
        """
        self.folder = folder
        self.path = folder / FILE
        self.session: int | None = None
        if not self.path.is_file():
            raise InputError([Issue(str(folder), None, "folder", f"no {FILE}", "a folder that a suite was run into")])
        self._lock = _locked(folder) if write else None
        try:
            with self._translated_errors():
                self._db = _connected(self.path, write)
            self._check_version()
            self._rate()
        except BaseException:
            self._unlock()
            raise

    @classmethod
    def create(cls, folder: Path, meta: Mapping[str, Any]) -> "Store":
        """Create an empty database in a folder atomically, and open it for writing.

        Args:
            folder: made when it is not there; holds no results yet.
            meta: JSON-ready values of table `meta`, by key.

        Raises:
            InputError, StoreError: as `Store`, or the folder cannot be written.
        """
        with (
            _without_results(folder),
            replacing(folder / FILE) as fresh,
            closing(sqlite3.connect(fresh)) as db,
            db,
        ):
            db.executescript(SCHEMA)
            rows = {"schema_version": SCHEMA_VERSION, "created_at": now(), **meta}
            db.executemany("INSERT INTO meta VALUES (?, ?)", [(k, json.dumps(v)) for k, v in rows.items()])
        return cls(folder, write=True)

    @classmethod
    @contextmanager
    def filled(cls, folder: Path, meta: Mapping[str, Any]) -> Iterator["Store"]:
        """Yield an empty store to be filled, which the folder has once that is done; after an exception it has none.

        Arguments and exceptions are those of `create`.
        """
        with _without_results(folder), TemporaryDirectory(prefix=".", dir=folder) as scratch:
            with cls.create(Path(scratch), meta) as store:
                yield store
                with store._translated_errors():  # what its log still held would be lost
                    store._leave_one_file()
            flush(store.path)
            store.path.replace(folder / FILE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        """Close; results that were written are in one file then."""
        self.close()

    def close(self) -> None:
        """Close the database, and let other processes write."""
        if self._lock is not None:
            with suppress(sqlite3.Error):  # readers are there, or the disk is full: it stays as it is
                self._leave_one_file()
        self._db.close()
        self._unlock()

    def _leave_one_file(self) -> None:
        """Bring what the log holds into the file, which can be read from anywhere then."""
        self._db.execute("PRAGMA journal_mode = DELETE")

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def meta(self, key: str, default: Any = _REQUIRED) -> Any:
        """Return a value of table `meta`, or the default where there is none.

        Raises:
            KeyError: there is neither.
        """
        found = self.query("SELECT value FROM meta WHERE key = ?", (key,))
        if not found and default is _REQUIRED:
            raise KeyError(key)
        return json.loads(found[0][0]) if found else default

    def set_meta(self, key: str, value: Any) -> None:
        """Write a value of table `meta`, JSON-ready."""
        with self._transaction():
            self._db.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, json.dumps(value)))

    @property
    def code(self) -> dict[str, Any] | None:
        """The code that the runs are of, as `Suite.code`; None in results of a release that did not record it."""
        code: dict[str, Any] | None = self.meta("code", None)
        return code

    def query(self, sql: str, values: tuple[Any, ...] = ()) -> list[sqlite3.Row]:
        """The rows of any SELECT; they can be asked by column name."""
        with self._translated_errors():
            return self._db.execute(sql, values).fetchall()

    def batches(self, sql: str) -> Iterator[list[sqlite3.Row]]:
        """The rows of any SELECT as of now, some at a time: memory does not grow with the results."""
        with self._translated_errors():
            cursor = self._db.execute(sql)
            while rows := cursor.fetchmany(BATCH):
                yield rows

    def done(self) -> set[Key]:
        """Return the keys of the stored runs."""
        return {tuple(row) for row in self.query("SELECT problem, planner, seed, repetition FROM runs")}

    def problem(self, id_: str) -> BenchProblem:
        """A problem; `problem_from_dict(problem.data)` loads it.

        Raises:
            UnknownChoiceError: there is none of that id.
        """
        rows = self.query("SELECT * FROM problems WHERE id = ?", (id_,))
        if not rows:
            raise UnknownChoiceError("problem", id_, [row["id"] for row in self.query("SELECT id FROM problems")])
        row = {key: rows[0][key] for key in ("id", "set_name", "difficulty", "hash")}
        return BenchProblem(**row, data=json.loads(rows[0]["data"]), origin=json.loads(rows[0]["origin"]))

    def trajectory(self, sha256: str) -> Trajectory:
        """A trajectory by the content of column `trajectory`.

        Raises:
            KeyError: there is none.
        """
        rows = self.query("SELECT data FROM trajectories WHERE sha256 = ?", (sha256,))
        if not rows:
            raise KeyError(sha256)
        return Trajectory.from_dict(json.loads(zlib.decompress(rows[0]["data"])))

    def fill(self, problems: tuple[BenchProblem, ...], planners: tuple[BenchPlanner, ...]) -> None:
        """Write the suite's problems and planners where they are not there yet, behind those that are."""
        with self._transaction():
            for position, planner in enumerate(planners, self._next_position("planners")):
                row = (planner.label, position, planner.name, json.dumps(dict(planner.options)))
                self._db.execute("INSERT OR IGNORE INTO planners VALUES (?, ?, ?, ?)", row)
            for position, p in enumerate(problems, self._next_position("problems")):
                data = (json.dumps(dict(p.data)), json.dumps(dict(p.origin)))
                values = (p.id, position, p.set_name, p.difficulty, p.hash, *data)
                self._db.execute("INSERT OR IGNORE INTO problems VALUES (?, ?, ?, ?, ?, ?, ?)", values)

    def absorb(self, other: "Store", labels: Mapping[str, str]) -> tuple[int, int]:
        """Copy everything of another store but its `meta`; what is there already stays, each run comes once.

        Args:
            other: read from its file, so it may be open and written to.
            labels: new names of planners; those that are left out keep theirs.

        Returns:
            The number of the first copied session and that beyond the last.
        """
        first = self.query("SELECT coalesce(max(session), 0) + 1 FROM sessions")[0][0]
        named = {row["label"]: row["label"] for row in other.query("SELECT label FROM planners")} | dict(labels)
        columns = ", ".join(name for name in COLUMNS if name != "planner")
        with self._translated_errors():
            self._db.execute("ATTACH DATABASE ? AS other", (str(other.path),))
            try:
                with self._transaction():
                    self._db.execute("CREATE TEMP TABLE labels (old TEXT PRIMARY KEY, new TEXT)")
                    self._db.executemany("INSERT INTO labels VALUES (?, ?)", named.items())
                    self._db.execute(ABSORB_PROBLEMS, (self._next_position("problems"),))
                    self._db.execute(ABSORB_PLANNERS, (self._next_position("planners"),))
                    self._db.execute("INSERT OR IGNORE INTO trajectories SELECT sha256, data FROM other.trajectories")
                    self._db.execute(ABSORB_SESSIONS, (first - 1,))
                    self._db.execute(ABSORB_RUNS.format(columns=columns), (first - 1,))
                    self._db.execute("DROP TABLE labels")
            finally:
                self._db.execute("DETACH DATABASE other")
        return first, self.query("SELECT coalesce(max(session), 0) + 1 FROM sessions")[0][0]

    def _next_position(self, table: str) -> int:
        found: int = self.query(f"SELECT coalesce(max(position), -1) + 1 FROM {table}")[0][0]
        return found

    def begin(self, workers: str, machine: Mapping[str, Any], versions: Mapping[str, str]) -> None:
        """Start a session: the runs added from now on belong to it."""
        sql = "INSERT INTO sessions (started_at, workers, machine, versions) VALUES (?, ?, ?, ?)"
        with self._transaction():
            values = (now(), workers, json.dumps(dict(machine)), json.dumps(dict(versions)))
            self.session = self._db.execute(sql, values).lastrowid

    def end(self, how: str) -> None:
        """End the session: `complete` or `interrupted`; one that failed or was killed has no end."""
        with self._transaction():
            self._db.execute("UPDATE sessions SET ended_at = ?, how = ? WHERE session = ?", (now(), how, self.session))

    def add(self, outcome: Outcome) -> None:
        """Store a run, with its trajectory, in one transaction.

        Raises:
            StoreError: the disk is full or failing; nothing of the run is stored.
        """
        row = dict(vars(outcome.row))
        for name in JSON_COLUMNS:
            row[name] = None if row[name] is None else json.dumps(row[name], allow_nan=False)
        with self._transaction():
            if outcome.trajectory is not None:
                values = (row["trajectory"], outcome.trajectory)
                self._db.execute("INSERT OR IGNORE INTO trajectories VALUES (?, ?)", values)
            self._db.execute(INSERT, (*(row[name] for name in COLUMNS), self.session))

    @contextmanager
    def of_one_moment(self) -> Iterator[None]:
        """Read the results of one moment within it, whatever is stored meanwhile."""
        if self._db.in_transaction:
            yield
            return
        with self._translated_errors():
            self._db.execute("BEGIN")
            try:
                yield
            finally:
                if self._db.in_transaction:  # a disk that fails may have ended it
                    self._db.execute("COMMIT")

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._translated_errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:  # a full disk may have rolled it back already
                    self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def _translated_errors(self) -> Iterator[None]:
        """Return the error of SQLite as one that says what to do."""
        try:
            yield
        except sqlite3.OperationalError as error:
            text = f"{self.path}: {error}; what was stored before is whole"
            full = "full" in str(error) or "disk I/O" in str(error)
            raise StoreError(f"{text}: make room and give the same command again" if full else text) from error
        except sqlite3.IntegrityError:  # a bug of ours: a run made twice
            raise
        except sqlite3.DatabaseError as error:
            raise StoreError(f"{self.path}: no database of results: {error}") from error

    def _check_version(self) -> None:
        """Refuse results of a later release, bring those of an earlier one up to date."""
        if not self.query("SELECT 1 FROM sqlite_master WHERE name = 'meta'"):
            self.close()
            raise _unusable(self.path, "a database without the table `meta`", "results of a suite")
        rows = self.query("SELECT value FROM meta WHERE key = 'schema_version'")
        found = int(rows[0][0]) if rows else 0
        if not 1 <= found <= SCHEMA_VERSION:
            what = f"schema version {found or 'unknown'}"
            self.close()
            raise _unusable(self.path, what, f"1 to {SCHEMA_VERSION}, which this release reads")
        if found < SCHEMA_VERSION:
            with self._transaction():  # nobody else adds columns meanwhile
                there = {row["name"] for row in self.query("PRAGMA main.table_info(runs)")}
                wanted = {name: kind for version in ADDED for name, kind in ADDED[version].items()}
                for name in (name for name in wanted if name not in there):
                    self._db.execute(f"ALTER TABLE runs ADD COLUMN {name} {wanted[name]}")
                self._db.execute("UPDATE meta SET value = ? WHERE key = 'schema_version'", (str(SCHEMA_VERSION),))

    def _rate(self) -> None:
        """Make the view `rated`, which lives as long as the connection."""
        names = [row["name"] for row in self.query("PRAGMA table_info(runs)") if row["name"] != "ratio"]
        with self._translated_errors():
            self._db.execute(VIEW.format(columns=", ".join(f"runs.{name} AS {name}" for name in names)))


def _connected(path: Path, write: bool) -> sqlite3.Connection:
    db = sqlite3.connect(path, timeout=30.0, isolation_level=None)
    db.row_factory = sqlite3.Row
    if write:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = NORMAL")
        db.execute("PRAGMA wal_autocheckpoint = 200")  # pages of 4 KiB: the log takes little room beside the data
        db.execute("PRAGMA foreign_keys = ON")
    return db


@contextmanager
def _without_results(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder without results meanwhile; a folder that is made for them goes if they do not come."""
    there = folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = _locked(folder)
        try:
            if (folder / FILE).exists():
                raise _unusable(folder, f"a {FILE} is there already", "a folder without results")
            yield
        finally:
            os.close(held)
            if not (there or (folder / FILE).exists()):
                (folder / LOCK).unlink(missing_ok=True)
                folder.rmdir()
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f"{folder}: the results cannot be written: {error}") from error


def _locked(folder: Path) -> int:
    """Take a lock that is released when this process ends."""
    try:
        return lock(folder / LOCK)
    except BlockingIOError as error:
        raise _unusable(folder, "a suite is being run into it at this moment", "one runner a folder") from error
    except OSError as error:
        raise _unusable(folder, error.strerror or str(error), "a folder that can be written") from error


def _unusable(path: Path, found: str, expected: str) -> InputError:
    return InputError([Issue(str(path), None, "out", found, expected)])
