"""Leases: which processes live, known without a clock. A lease ends with the process, however that ends.

PostgreSQL: a session holds an advisory lock, which the server drops with the connection. SQLite: a lock on a file.
"""

import fcntl
import hashlib
import logging
import os
import threading
import time
import uuid
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.service.store.tables import postgres_options

RENEW = 1.0
"""s between two looks at the session that holds a lock."""
LAPSE = 8.0
"""s without a lock after which a process counts as dead: one that lives has its lock again by then, after an outage."""

_log = logging.getLogger("optiplan.service")


class Lease(Protocol):
    """The lease of this process, by which others know that it lives."""

    name: str

    @property
    def held(self) -> bool:
        """Whether what holds it works."""
        ...

    def alive(self, name: str) -> bool:
        """Whether the process that has the lease of this name lives."""
        ...

    def close(self) -> None:
        """End it."""
        ...


def take_lease(engine: Engine, folder: Path) -> Lease:
    """A new lease; `folder` holds the files by which processes of one machine know each other."""
    return _SessionLease(engine) if engine.dialect.name == "postgresql" else _FileLease(folder)


class _FileLease:
    def __init__(self, folder: Path) -> None:
        self.name = uuid.uuid4().hex
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._handle = self._locked_file()
        for other in folder.iterdir():
            self.alive(other.name)

    def _locked_file(self) -> int:
        """Open a file of our name, with a lock on it; another process may remove one that has no lock yet."""
        while True:
            handle = os.open(self._folder / self.name, os.O_CREAT | os.O_RDWR, 0o600)
            fcntl.flock(handle, fcntl.LOCK_EX)
            if os.fstat(handle).st_nlink:
                return handle
            os.close(handle)

    @property
    def held(self) -> bool:
        return True

    def alive(self, name: str) -> bool:
        """Whether the process of a lease lives; the file of one that has ended is removed, under its lock."""
        if name == self.name:
            return True
        try:
            handle = os.open(self._folder / name, os.O_RDWR)
        except FileNotFoundError:
            return False
        except OSError:  # as where this process has too many files open: that tells nothing of the other one
            return True
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return True
        else:
            if os.fstat(handle).st_nlink:  # else the name may be another file's by now
                (self._folder / name).unlink(missing_ok=True)
            return False
        finally:
            os.close(handle)

    def close(self) -> None:
        with suppress(OSError):
            (self._folder / self.name).unlink(missing_ok=True)
            os.close(self._handle)


class _SessionLease:
    """Holds a session of its own, in which a thread takes the lock again as soon as an outage is over."""

    def __init__(self, engine: Engine) -> None:
        self.name = uuid.uuid4().hex
        options = postgres_options(engine.url.render_as_string(hide_password=False))
        self._engine = sa.create_engine(
            engine.url, poolclass=sa.NullPool, isolation_level="AUTOCOMMIT", connect_args=options
        )
        self._using = threading.Lock()
        self._session: sa.Connection | None = None
        self._mine = False
        self._missing: dict[str, float] = {}
        self._stop = threading.Event()
        self._locked()
        self._thread = threading.Thread(target=self._keep, name="lease", daemon=True)
        self._thread.start()

    @property
    def held(self) -> bool:
        return self._thread.is_alive()

    def alive(self, name: str) -> bool:
        """Whether the process of a lease lives: its lock is held, or has not been missed for `LAPSE` s in a row.

        Raises:
            SQLAlchemyError: the database is away; so is every lock, and the time without one begins anew.
        """
        if name == self.name:
            return True
        with self._using:
            session = self._locked()
            try:
                got = session.scalar(_TRY, {"key": _key(name)})
                if got:
                    session.execute(_UNLOCK, {"key": _key(name)})
            except sa.exc.SQLAlchemyError:
                self._drop()
                raise
            if not got:
                self._missing.pop(name, None)
                return True
            return time.monotonic() - self._missing.setdefault(name, time.monotonic()) < LAPSE

    def close(self) -> None:
        self._stop.set()
        self._thread.join(RENEW)
        if self._using.acquire(timeout=RENEW):  # else it waits for a database that does not answer
            self._drop()
        self._engine.dispose()

    def _keep(self) -> None:
        while not self._stop.wait(RENEW):
            try:
                with self._using:
                    self._locked()
            except Exception as error:  # the database may be away for a while
                _log.warning("the lock of this process cannot be held: %s", str(error).split("\n")[0])

    def _locked(self) -> sa.Connection:
        """The session, with the lock of this process; a session that has ended is made anew.

        Where an old session of ours still has the lock, that keeps us alive, and the next look tries again.
        """
        try:
            if self._session is None:
                self._session = self._engine.connect()
                self._mine = False
            if self._mine:
                self._session.execute(_LOOK)
            else:
                self._mine = bool(self._session.scalar(_TRY, {"key": _key(self.name)}))
        except sa.exc.SQLAlchemyError:
            self._drop()
            raise
        return self._session

    def _drop(self) -> None:
        """Let go of the session; after an outage every process needs time to take its lock again."""
        session, self._session = self._session, None
        self._missing.clear()
        if session is not None:
            with suppress(sa.exc.SQLAlchemyError):
                session.invalidate()
                session.close()


_LOOK = sa.text("SELECT 1")
_TRY = sa.text("SELECT pg_try_advisory_lock(:key)")
_UNLOCK = sa.text("SELECT pg_advisory_unlock(:key)")


def _key(name: str) -> int:
    """A number of 63 bits for a name."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big") >> 1
