"""Files named by the SHA-256 of what is in them: never changed, the same content once, damage seen when read."""

import errno
import hashlib
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from optiplan.errors import OptiPlanError
from optiplan.files import write_bytes

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a disk, or a share of one, that is full, and of a file that may not be as large."""

_NAME, _PROBE = "store", "probe"


class StorageFullError(OptiPlanError):
    """No room is left for what the service has to keep."""


@contextmanager
def room_wanted() -> Iterator[None]:
    """Turn the error of a full disk, on which something is written within, into a `StorageFullError`."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise StorageFullError(f"the disk of the data folder is full: {error.strerror}") from error
        raise


class ContentFolder:
    """Folder of contents that belongs to one database."""

    def __init__(self, folder: Path, spare: int) -> None:
        """Open it.

        Args:
            folder: made where it is not there.
            spare: bytes of the disk that stay free.

        Raises:
            OptiPlanError: it cannot be written.
        """
        self.folder, self.spare = folder, spare
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OptiPlanError(f"{folder} cannot be written: {error.strerror or error}") from error

    def claim(self, store: str) -> None:
        """Check that the folder is that of a database, or make it so.

        Raises:
            OptiPlanError: it belongs to another one: a worker that writes there would not be seen by the server.
        """
        mark = self.folder / _NAME
        if not mark.exists():
            write_bytes(mark, store.encode())
        found = mark.read_text().strip()
        if found != store:
            raise OptiPlanError(
                f"{self.folder} belongs to another database; expected the folder that all servers and workers of this "
                "database share (--data)"
            )

    def put(self, content: bytes) -> str:
        """Keep a content and return its digest; it is on the disk when this returns.

        Raises:
            StorageFullError: there is no room.
        """
        digest = hashlib.sha256(content).hexdigest()
        path = self._path(digest)
        if _intact(path, digest) is not None:  # a damaged one is written anew
            with suppress(OSError):
                os.utime(path)  # it is young again: no sweep takes it before its run is recorded
                return digest
        with room_wanted():
            write_bytes(path, content)
        return digest

    def get(self, digest: str) -> bytes | None:
        """The content of a digest; None if it is not there, or not what it was."""
        return _intact(self._path(digest), digest)

    def delete(self, digest: str) -> None:
        """Keep a content no longer."""
        self._path(digest).unlink(missing_ok=True)

    def check_room(self) -> None:
        """Check that the disk takes more.

        Raises:
            StorageFullError: less than `spare` bytes are free.
        """
        free = shutil.disk_usage(self.folder).free
        if free < self.spare:
            raise StorageFullError(f"the disk of the data folder has {free / 1e6:.0f} MB left; nothing new is taken on")

    def check_writable(self) -> None:
        """Check that the disk takes more, by a small file.

        Raises:
            StorageFullError: it does not.
        """
        self.check_room()
        with room_wanted():
            write_bytes(self.folder / _PROBE, _PROBE.encode())

    def older_than(self, seconds: float) -> set[str]:
        """Digests of the contents that have been there for so long."""
        found, limit = set(), time.time() - seconds
        for path in self.folder.glob("??/*"):
            with suppress(OSError):
                if len(path.name) == 64 and path.stat().st_mtime <= limit:
                    found.add(path.name)
        return found

    def _path(self, digest: str) -> Path:
        if len(digest) != 64 or not set(digest) <= set("0123456789abcdef"):
            raise ValueError(f"no digest: {digest!r}")
        return self.folder / digest[:2] / digest


def _intact(path: Path, digest: str) -> bytes | None:
    try:
        content = path.read_bytes()
    except OSError:
        return None
    return content if hashlib.sha256(content).hexdigest() == digest else None
