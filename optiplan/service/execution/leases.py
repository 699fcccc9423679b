"""Leases: which processes live, known without a clock. A lease ends with the process, however that ends.

PostgreSQL: a session holds an advisory lock, which the server drops with the connection. SQLite: a lock on a file.
"""

import fcntl
import hashlib
import os
import uuid
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import sqlalchemy as sa
from sqlalchemy.engine import Engine


class Lease(Protocol):
    """The lease of this process, by which others know that it lives."""

    name: str

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
        self._handle = os.open(folder / self.name, os.O_CREAT | os.O_RDWR, 0o600)
        fcntl.flock(self._handle, fcntl.LOCK_EX)
        for other in folder.iterdir():  # what ended processes left behind
            if not self.alive(other.name):
                other.unlink(missing_ok=True)

    def alive(self, name: str) -> bool:
        if name == self.name:
            return True
        try:
            handle = os.open(self._folder / name, os.O_RDWR)
        except OSError:
            return False
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return True
        else:
            return False
        finally:
            os.close(handle)

    def close(self) -> None:
        with suppress(OSError):
            (self._folder / self.name).unlink(missing_ok=True)
            os.close(self._handle)


class _SessionLease:
    """Holds a connection of its own; where that breaks, the lease is taken again at the next question."""

    def __init__(self, engine: Engine) -> None:
        self.name = uuid.uuid4().hex
        self._engine = sa.create_engine(engine.url, poolclass=sa.NullPool, isolation_level="AUTOCOMMIT")
        self._connection = self._engine.connect()
        self._connection.execute(_LOCK, {"key": _key(self.name)})

    def alive(self, name: str) -> bool:
        if name == self.name:
            return True
        try:
            got = self._connection.scalar(_TRY, {"key": _key(name)})
        except sa.exc.SQLAlchemyError:
            self._renew()
            got = self._connection.scalar(_TRY, {"key": _key(name)})
        if got:
            self._connection.execute(_UNLOCK, {"key": _key(name)})
        return not got

    def close(self) -> None:
        with suppress(sa.exc.SQLAlchemyError):
            self._connection.close()
        self._engine.dispose()

    def _renew(self) -> None:
        with suppress(sa.exc.SQLAlchemyError):
            self._connection.close()
        self._connection = self._engine.connect()
        self._connection.execute(_LOCK, {"key": _key(self.name)})


_LOCK = sa.text("SELECT pg_advisory_lock(:key)")
_TRY = sa.text("SELECT pg_try_advisory_lock(:key)")
_UNLOCK = sa.text("SELECT pg_advisory_unlock(:key)")


def _key(name: str) -> int:
    """A number of 63 bits for a name."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big") >> 1
