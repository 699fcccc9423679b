"""Results that take long to make and can always be made again: files kept between runs, and recent ones in memory.

A file is its content and, after it, a mark with the SHA-256 of the content. Without the mark, or with one that does not
fit, the file is none: it is made again, so that a damaged cache costs time and nothing else.
"""

import fcntl
import hashlib
import os
import tempfile
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Generic, TypeVar

from optiplan.files import user_folder, write_bytes

MARK = b"\noptiplan-cache "
"""Stands between content and checksum; a shared library may be followed by it and still be loaded."""

PATIENCE = 60.0
"""s to wait for what another process makes; then it is made here as well."""

LOOK = 0.02
"""s between two looks whether it has ended."""

Made = TypeVar("Made")


class MostRecent(Generic[Made]):
    """The results used last, in memory, by key; safe to share between threads.

    Args:
        most: results kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._made = most, OrderedDict[str, Made]()
        self._lock = threading.RLock()

    def __len__(self) -> int:
        """Return the number of results kept."""
        return len(self._made)

    def get(self, key: str, make: Callable[[], Made]) -> Made:
        """Return the result of `key`; make it where there is none."""
        with self._lock:
            return self.keep(key, self._made.pop(key) if key in self._made else make())

    def find(self, key: str) -> Made | None:
        """Return the result of `key`; None where there is none."""
        with self._lock:
            return self.keep(key, self._made.pop(key)) if key in self._made else None

    def keep(self, key: str, made: Made) -> Made:
        """Keep a result that was made, and return it."""
        with self._lock:
            self._made[key] = made
            while len(self._made) > self._most:
                self._made.popitem(last=False)
        return made


def cache_dir() -> Path:
    """`$XDG_CACHE_HOME/optiplan`, by default `~/.cache/optiplan`.

    Raises:
        FileNotFoundError: this user has no home.
    """
    return user_folder("XDG_CACHE_HOME", ".cache") / "optiplan"


def digest(parts: Iterable[bytes]) -> str:
    """SHA-256, in hex, of several byte strings; where one ends and the next begins counts."""
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())
    return total.hexdigest()


def kept(name: str, make: Callable[[], bytes]) -> bytes:
    """Return the content cached under `name`; if there is none, make it with `make` and cache it.

    Whoever changes what `make` gives for the same input changes `name`: it holds a digest of all that the content
    depends on, the version of the code that makes it included. While another process makes it, this one waits.
    """
    content = load(name)
    if content is None:
        with _turn(name):
            content = load(name)
            if content is None:
                content = make()
                store(name, content)
    return content


def load(name: str) -> bytes | None:
    """Content of a cached file; None if it is not there or not whole."""
    try:
        path = cache_dir() / name
        whole = path.read_bytes() if path.is_file() else b""
    except OSError:
        return None
    content, seal = whole[: -len(_seal(b""))], whole[-len(_seal(b"")) :]
    return content if seal == _seal(content) else None


def has(name: str) -> bool:
    """Whether there is a cached file, whole or not."""
    try:
        return (cache_dir() / name).is_file()
    except OSError:
        return False


def store(name: str, content: bytes) -> None:
    """Write a cached file whole or not at all; a cache that cannot be written is no error."""
    with suppress(OSError):
        write_bytes(cache_dir() / name, content + _seal(content))


def writable() -> bool:
    """Whether files can be kept: what is made only to be found here is not worth making otherwise."""
    try:
        cache_dir().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=cache_dir()):
            return True
    except OSError:
        return False


@contextmanager
def _turn(name: str) -> Iterator[None]:
    """Wait while another thread or process is here with the same `name`; `PATIENCE` seconds at most.

    The lock on a file ends with its process, however that ends. Where no file can be locked nobody waits.
    """
    path = handle = None
    with suppress(OSError):
        path = cache_dir() / f"{name}.lock"
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_CREAT | os.O_WRONLY, 0o600)
    if path is None or handle is None:
        yield
        return
    try:
        until = time.monotonic() + PATIENCE
        while not _free(handle) and time.monotonic() < until:
            time.sleep(LOOK)
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)  # who waits has it open, and will find what is cached
            fcntl.flock(handle, fcntl.LOCK_UN)  # also for a child of this process, which has it open as well
        os.close(handle)


def _free(handle: int) -> bool:
    """Lock a file, and return whether there is no lock of others; False only where there is one."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _seal(content: bytes) -> bytes:
    return MARK + hashlib.sha256(content).hexdigest().encode()
