"""Tables of the service's database, the version of their layout, and how a database is opened."""

import os
import re
import sqlite3
import time
import uuid
from contextlib import suppress
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement

from optiplan.config.messages import some
from optiplan.errors import OptiPlanError

LAYOUT = 2
"""Version of the tables; a database of a newer one is refused, an older one is brought up to it by `MIGRATIONS`."""

BUSY = 10.0
"""s that a statement waits for another process that writes to the same SQLite file."""
PAUSE = 0.01
"""s between two tries where SQLite does not wait by itself."""
CONNECT = 5
"""s in which PostgreSQL has to take a connection."""
SILENT = "keepalives_idle=10 keepalives_interval=5 keepalives_count=3"
"""Both ends of a connection to PostgreSQL notice within 25 s that the other machine is gone."""

SQLITE_AWAY = {
    sqlite3.SQLITE_BUSY: "another process holds it",
    sqlite3.SQLITE_LOCKED: "another process holds it",
    sqlite3.SQLITE_READONLY: "it can only be read",
    sqlite3.SQLITE_IOERR: "its disk cannot be written or read",
    sqlite3.SQLITE_FULL: "its disk is full",
    sqlite3.SQLITE_CANTOPEN: "its file cannot be opened",
}
"""Errors of SQLite that pass."""
POSTGRES_AWAY = ("08", "53", "57P", "58", "25006")
"""Beginnings of the codes of such errors of PostgreSQL: connection, resources, shut down, its system, only readable.

Source: PostgreSQL's manual, appendix A.
"""
POSTGRES_FULL = "53100"

metadata = sa.MetaData()

about = sa.Table(
    "optiplan_about",
    metadata,
    sa.Column("key", sa.String(40), primary_key=True),
    sa.Column("value", sa.Text, nullable=False),
)
"""`layout`; `store`: which folder of contents belongs to this database; and what others note under a key of theirs."""

problems = sa.Table(
    "optiplan_problems",
    metadata,
    sa.Column("hash", sa.String(64), primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("robot", sa.Text, nullable=False),
    sa.Column("text", sa.String(64), nullable=False),
    sa.Column("created", sa.Float, nullable=False),
)
"""Problems that were stored; `text` is the digest of the YAML or JSON as it came."""

runs = sa.Table(
    "optiplan_runs",
    metadata,
    sa.Column("id", sa.String(64), primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("problem", sa.String(64), nullable=False),
    sa.Column("robot", sa.Text, nullable=False),
    sa.Column("request", sa.String(64), nullable=False),
    sa.Column("planner", sa.Text, nullable=False),
    sa.Column("seed", sa.BigInteger, nullable=False),
    sa.Column("budget", sa.Float, nullable=False),
    sa.Column("deadline", sa.Float),
    sa.Column("status", sa.String(10), nullable=False, index=True),
    sa.Column("cancel", sa.Boolean, nullable=False, default=False),
    sa.Column("holder", sa.String(40)),
    sa.Column("tries", sa.Integer, nullable=False, default=0),
    sa.Column("verified", sa.Boolean),
    sa.Column("duration", sa.Float),
    sa.Column("ratio", sa.Float),
    sa.Column("failure", sa.JSON),
    sa.Column("timings", sa.JSON),
    sa.Column("contents", sa.JSON),
    sa.Column("bytes", sa.BigInteger, nullable=False, default=0),
    sa.Column("submitted", sa.Float, nullable=False, index=True),
    sa.Column("started", sa.Float),
    sa.Column("finished", sa.Float),
)
"""Runs: `request` and the values of `contents` are digests; times are seconds since 1970; `holder` solves it now."""

events = sa.Table(
    "optiplan_events",
    metadata,
    sa.Column("number", sa.BigInteger().with_variant(sa.Integer, "sqlite"), primary_key=True, autoincrement=True),
    sa.Column("run", sa.String(64), nullable=False, index=True),
    sa.Column("data", sa.JSON, nullable=False),
    sqlite_autoincrement=True,
)
"""What happened in a run, in order; no number is given twice."""

submissions = sa.Table(
    "optiplan_submissions",
    metadata,
    sa.Column("run", sa.String(64), nullable=False, index=True),
    sa.Column("submission", sa.String(64), nullable=False),
)
"""Who wants a run: one row for each submission of it that was not taken back."""

benches = sa.Table(
    "optiplan_benches",
    metadata,
    sa.Column("id", sa.String(64), primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("created", sa.Float, nullable=False, index=True),
    sa.Column("content", sa.JSON, nullable=False),
)
"""Benches: `content` has the problems, planners, seeds, budget, and `runs` as [problem, planner, seed, id]."""

MIGRATIONS: dict[int, tuple[str, ...]] = {2: ()}
"""Statements that bring a database to a layout from the one before it; tables that are new are made without."""


class DatabaseAwayError(OptiPlanError):
    """The database does not answer or takes no changes; it may later, so that what failed is worth another try.

    Attributes:
        full: its disk is full.
    """

    def __init__(self, reason: str, full: bool) -> None:
        super().__init__(f"the database does not answer: {reason}")
        self.full = full


class Clock(FunctionElement[float]):
    """The time by the database's clock, s since 1970: the one clock of all processes that share the database."""

    type = sa.Float()
    inherit_cache = True


@compiles(Clock, "postgresql")
def _postgres_clock(element: Clock, compiler: Any, **_: Any) -> str:
    return "CAST(extract(epoch FROM clock_timestamp()) AS double precision)"


@compiles(Clock, "sqlite")
def _sqlite_clock(element: Clock, compiler: Any, **_: Any) -> str:
    return "optiplan_clock()"


def open_database(url: str) -> Engine:
    """Open a database and bring its tables up to `LAYOUT`.

    Raises:
        OptiPlanError: it is of another kind, cannot be reached, or is of a newer version.
    """
    sqlite = url.startswith("sqlite")
    shown = re.sub(r"(://[^:/@]*:)[^@]*@", r"\1***@", url)
    if not (sqlite or url.startswith("postgresql")):
        raise OptiPlanError(f"the database {shown}; expected sqlite:///PATH or postgresql://USER@HOST/NAME")
    try:
        options: dict[str, Any] = {} if sqlite else {"pool_pre_ping": True, "connect_args": postgres_options(url)}
        engine = sa.create_engine(url, pool_size=10, max_overflow=20, **options)
        if sqlite:
            sa.event.listen(engine, "connect", _set_up_sqlite)
        sa.event.listen(engine, "handle_error", _away)
        with engine.begin() as connection:
            _bring_up(connection)
    except (sa.exc.SQLAlchemyError, DatabaseAwayError, ImportError, ValueError, TypeError) as error:
        reason = str(getattr(error, "orig", None) or error.__cause__ or error).strip().split("\n")[0]
        raise OptiPlanError(f"the database {shown} cannot be used: {reason}") from error
    if sqlite:
        _watch_file(engine)
    return engine


def note(engine: Engine, key: str, value: Any) -> None:
    """Write a value, or what SQL makes of one, under a key of the table `about`."""
    row = about.c.key == key
    with suppress(sa.exc.IntegrityError), engine.begin() as connection:  # another process was first
        if connection.execute(about.update().where(row).values(value=value)).rowcount == 0:
            connection.execute(about.insert().values(key=key, value=value))


def store_name(engine: Engine) -> str:
    """The name that the folder of contents of this database has, made at the first asking."""
    with engine.begin() as connection:
        _alone(connection)
        found = connection.scalar(sa.select(about.c.value).where(about.c.key == "store"))
        if found is None:
            found = uuid.uuid4().hex
            connection.execute(about.insert().values(key="store", value=found))
    return str(found)


def _watch_file(engine: Engine) -> None:
    """Refuse every use of an SQLite file that is no longer the one that was opened.

    A process that has a file open could write on into it after it was deleted, and nobody would find that again.
    """
    path = engine.url.database or ":memory:"
    opened = _identity(path)
    if opened is None:  # a database in memory
        return

    def check(*_: Any) -> None:
        if _identity(path) != opened:
            raise DatabaseAwayError("its file was deleted or replaced; put it back", False)

    for moment in ("do_connect", "checkout"):
        sa.event.listen(engine, moment, check)


def _identity(path: str) -> tuple[int, int] | None:
    """Return what tells a file from another one of its name; None where there is none."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _set_up_sqlite(connection: Any, _: Any) -> None:
    """Readers do not wait for a writer; a commit is on the disk; writers wait for one another."""
    connection.isolation_level = "IMMEDIATE"  # a writer waits at its first statement, not at its last
    connection.create_function("optiplan_clock", 0, time.time)  # a file is of one machine
    connection.execute(f"PRAGMA busy_timeout={1000 * BUSY:.0f}")
    _log_ahead(connection)
    for pragma in ("synchronous=FULL", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _log_ahead(connection: Any) -> None:
    """Keep a log beside the file. SQLite does not wait for another that is about to do the same: it says "locked"."""
    last = time.monotonic() + BUSY
    while True:
        try:
            connection.execute("PRAGMA journal_mode=WAL")
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > last:
                raise
            time.sleep(PAUSE)


def postgres_options(url: str) -> dict[str, Any]:
    """How connections to PostgreSQL are made: none waits for ever for a machine that is gone, on either side.

    What the address says itself is left as it is.
    """
    client = dict(pair.split("=") for pair in SILENT.split())
    server = [f"-c tcp_{pair}" for pair in SILENT.split()]
    server.append("-c idle_in_transaction_session_timeout=60000")
    options = {"connect_timeout": CONNECT, "options": " ".join(server), **client}
    return {name: value for name, value in options.items() if name not in sa.make_url(url).query}


def _away(context: Any) -> DatabaseAwayError | None:
    """The error to raise in place of one that passes; None: another one, or a connection that is exchanged anyway."""
    error = context.original_exception
    if context.is_pre_ping or not isinstance(context.sqlalchemy_exception, sa.exc.DBAPIError):
        return None
    if isinstance(error, sqlite3.Error):
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        return DatabaseAwayError(SQLITE_AWAY[code], code == sqlite3.SQLITE_FULL) if code in SQLITE_AWAY else None
    code = getattr(error, "sqlstate", None) or ""
    lost = not code and isinstance(context.sqlalchemy_exception, sa.exc.OperationalError)
    if not (context.is_disconnect or lost or code.startswith(POSTGRES_AWAY)):
        return None
    return DatabaseAwayError(str(error).strip().split("\n")[0], code == POSTGRES_FULL)


def _alone(connection: sa.Connection) -> None:
    """Wait for others that start on the same database, until the transaction ends."""
    if connection.dialect.name == "postgresql":
        connection.execute(sa.text("SELECT pg_advisory_xact_lock(7100)"))
    else:
        connection.execute(sa.text("BEGIN IMMEDIATE"))  # which Python begins before a change only


def _bring_up(connection: sa.Connection) -> None:
    _alone(connection)
    others = sa.inspect(connection).get_table_names() if connection.dialect.name == "sqlite" else []
    if others and about.name not in others:
        held = f"the file of another program, with the tables {some(sorted(others), 3)}"
        raise OptiPlanError(f"the database is {held}; expected a new file, or one that `optiplan serve` made")
    metadata.create_all(connection)
    found = int(connection.scalar(sa.select(about.c.value).where(about.c.key == "layout")) or 0)
    if found > LAYOUT:
        raise OptiPlanError(f"the database is of layout {found}, made by a newer OptiPlan; this one knows {LAYOUT}")
    for layout in range(found + 1, LAYOUT + 1) if found else ():
        for statement in MIGRATIONS[layout]:
            connection.execute(sa.text(statement))
    if found == 0:
        connection.execute(about.insert().values(key="layout", value=str(LAYOUT)))
    elif found < LAYOUT:
        connection.execute(about.update().where(about.c.key == "layout").values(value=str(LAYOUT)))
