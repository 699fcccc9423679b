"""Uploaded files: so many bytes and files in all; what nobody has used for long goes, the longest unused first.

The folder is the truth. Each server keeps an index of it, read once and then with each `sweep`, so that an upload costs
what it writes, however many there are. The time of a file's last use is its modification time.
"""

import os
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from optiplan.files import write_bytes
from optiplan.records import dataclass
from optiplan.service.store.contents import StorageFullError, room_wanted

MARKED = 6 * 3600.0
"""s between two marks that a file is in use: each looks like another version of the file to who caches by it."""
IN_USE = 86400.0
"""s since its last use within which a file does not go to make room for others."""
LEFT_BEHIND = 3600.0
"""s after which a half-written file is that of a process that was killed."""


@dataclass(frozen=True)
class Upload:
    """One file: its path below the folder, its bytes, and when it was uploaded or used last (s since 1970)."""

    file: str
    bytes: int
    used: float


class Uploads:
    """The folder of uploaded files.

    Args:
        folder: made where it is not there.
        most_bytes: of all files together.
        most_files: how many there may be.
    """

    def __init__(self, folder: Path, most_bytes: int, most_files: int) -> None:
        self._folder, self._most_bytes, self._most_files = folder, most_bytes, most_files
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._index: dict[str, Upload] | None = None
        self._bytes = 0

    def put(self, file: str, content: bytes) -> None:
        """Keep a file under a path of plain names; an older one is replaced.

        Raises:
            StorageFullError: there are too many bytes or files, all of them in use, or the disk is full.
            FileExistsError, NotADirectoryError, IsADirectoryError: the path is a folder, or below a file.
        """
        with self._lock:
            index = self._known()
            own = index[file].bytes if file in index else 0
            self._make_room(len(content) - own, 0 if file in index else 1, file)
            with room_wanted():
                write_bytes(self._folder / file, content)
            self._record(Upload(file, len(content), time.time()))

    def all(self) -> list[Upload]:
        """All files, by path, as they are in the folder now."""
        with self._lock:
            return sorted(self._read().values(), key=lambda upload: upload.file)

    def delete(self, file: str) -> bool:
        """Delete a file, and folders that are empty without it; False if there is none."""
        with self._lock:
            return self._delete(file)

    def sweep(self, days: float) -> list[str]:
        """Delete files unused for so many days, and the longest unused beyond the bounds; return their paths."""
        with self._lock:
            by_use = sorted(self._read().values(), key=lambda upload: upload.used)
            gone = [upload.file for upload in by_use if upload.used < time.time() - 86400.0 * days]
            for file in gone:
                self._delete(file)
            with suppress(StorageFullError):  # all that is left is in use
                gone += self._make_room(0, 0)
            return gone

    def _known(self) -> dict[str, Upload]:
        return self._read() if self._index is None else self._index

    def _read(self) -> dict[str, Upload]:
        self._index, self._bytes = {}, 0
        for place, _, names in os.walk(self._folder):
            for name in names:
                path = Path(place, name)
                try:
                    found = path.lstat()
                except OSError:  # deleted meanwhile
                    continue
                if not name.startswith("."):
                    self._record(Upload(str(path.relative_to(self._folder)), found.st_size, found.st_mtime))
                elif found.st_mtime < time.time() - LEFT_BEHIND:
                    path.unlink(missing_ok=True)
        return self._index

    def _record(self, upload: Upload) -> None:
        index = self._known()
        self._bytes += upload.bytes - (index[upload.file].bytes if upload.file in index else 0)
        index[upload.file] = upload

    def _make_room(self, size: int, count: int, kept: str = "") -> list[str]:
        """Delete what has been unused longest until so many bytes and files more fit; return the paths."""
        index, gone = self._known(), []
        for upload in sorted(index.values(), key=lambda one: one.used) if self._over(size, count) else ():
            if not self._over(size, count):
                break
            if upload.file != kept and _last_use(self._folder / upload.file) < time.time() - IN_USE:
                self._delete(upload.file)
                gone.append(upload.file)
        if self._over(size, count):
            raise StorageFullError(
                f"uploads may be {self._most_files} files of {self._most_bytes / 1e6:g} MB in all; expected fewer: "
                "DELETE /api/uploads/PATH (--upload-files, --uploads-gb)"
            )
        return gone

    def _over(self, size: int, count: int) -> bool:
        return self._bytes + size > self._most_bytes or len(self._known()) + count > self._most_files

    def _delete(self, file: str) -> bool:
        path = self._folder / file
        known = self._known().pop(file, None)
        self._bytes -= known.bytes if known else 0
        try:
            path.unlink()
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError, PermissionError):
            return False
        for folder in path.relative_to(self._folder).parents:
            with suppress(OSError):
                if folder != Path():
                    (self._folder / folder).rmdir()
        return True


def mark_used(folder: Path, files: Iterable[Path]) -> None:
    """Note that files of the folder of uploads are in use; others are passed over."""
    root, now = Path(os.path.realpath(folder)), time.time()
    for file in files:
        with suppress(OSError):  # a folder that is only read here
            if file.is_relative_to(root) and file.stat().st_mtime < now - MARKED:
                os.utime(file)


def _last_use(path: Path) -> float:
    try:
        return path.lstat().st_mtime
    except OSError:
        return 0.0
