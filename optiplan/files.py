"""Read files that a user names, and write files whole or not at all.

Files to read are opened here and nowhere else: regular files, of bounded size, in the folders allowed.

While `reading` is open, every file is read once and keeps what was read: two looks at one file within one load see the
same bytes, whatever happens to the file in between, so that a hash is of what was used.
"""

import csv
import errno
import fcntl
import io
import json
import os
import stat
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from optiplan.errors import os_reason
from optiplan.records import dataclass

MOST = 256 * 2**20
"""Largest file that is read, bytes."""

NEVER = (Path("/proc"), Path("/sys"))
"""Folders whose files look regular and are none."""


Result = TypeVar("Result")


@dataclass(frozen=True)
class _Session:
    """Real paths of the folders allowed (None: all), what was read so far, and the real paths of files looked at."""

    folders: tuple[Path, ...] | None = None
    contents: dict[Path, bytes] = field(default_factory=dict)
    looked_at: set[Path] = field(default_factory=set)


_current: ContextVar[_Session | None] = ContextVar("reading", default=None)


@contextmanager
def reading(folders: Iterable[Path | str] | None = None) -> Iterator[Set[Path]]:
    """Within it only files of `folders` (and below them) can be read, each once; yields the real paths looked at.

    Args:
        folders: None allows all. Inside an outer `reading` the outer one's folders and contents hold, and further ones
            narrow them.
    """
    outer = _current.get() or _Session()
    allowed = outer.folders if folders is None else tuple(Path(os.path.realpath(folder)) for folder in folders)
    if folders is not None and outer.folders is not None:
        allowed = tuple(folder for folder in allowed or () if _inside(folder, outer.folders))
    session = _Session(allowed, outer.contents, outer.looked_at)
    token = _current.set(session)
    try:
        yield session.looked_at
    finally:
        _current.reset(token)


def bound(make: Callable[[], Result]) -> Callable[[], Result]:
    """`make`, to be called later, with the folders that are allowed now."""
    folders = allowed_folders()

    def later() -> Result:
        with reading(folders):
            return make()

    return later


def allowed_folders() -> tuple[Path, ...] | None:
    """The folders that hold now; None where all are allowed."""
    current = _current.get()
    return None if current is None else current.folders


def is_file(path: Path) -> bool:
    """Whether `read_bytes` would open it: a regular file in an allowed folder."""
    return not hindrance(path)


def is_folder(path: Path | str) -> bool:
    """Whether there is a folder; `Path.is_dir` raises for names that are too long."""
    return os.path.isdir(path)


def folder_of(path: Path) -> Path:
    """Return a path if it is a folder, else the folder it lies in."""
    return path if is_folder(path) else path.parent


def hindrance(path: Path) -> str:
    """Return why `read_bytes` would not open a file, in words; empty where it would."""
    try:
        _check(path)
    except FileNotFoundError:
        return f"there is no file {path}"
    except OSError as error:
        return f"{path}: {os_reason(error)}"
    return ""


def read_bytes(path: Path, most: int = MOST) -> bytes:
    """Content of a regular file.

    Raises:
        OSError: there is none, it cannot be read, is no regular file, larger than `most` bytes, or in no allowed
            folder; `strerror` says which.
    """
    current = _current.get() or _Session()
    where = _check(path)
    if where not in current.contents:
        handle = os.open(where, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0))
        with os.fdopen(handle, "rb") as file:
            if not stat.S_ISREG(os.fstat(handle).st_mode):  # exchanged since it was looked at
                raise OSError(0, "not a regular file", str(path))
            content = file.read(MOST + 1)
        current.contents[where] = content
    content = current.contents[where]
    if len(content) > most:
        raise OSError(0, f"more than {most / 2**20:g} MiB", str(path))
    return content


class Signature(NamedTuple):
    """What tells one version of a file from another, without reading it.

    Attributes:
        path: the real path.
        device, inode, size: of the file.
        modified: nanoseconds, as its owner says.
        changed: s, when content or name were changed last, as the file system says.
    """

    path: Path
    device: int
    inode: int
    size: int
    modified: int
    changed: float


def signatures(paths: Iterable[Path]) -> tuple[Signature, ...]:
    """Look at files that `read_bytes` would open.

    Raises:
        OSError: as `read_bytes`.
    """
    real_folder = cache(os.path.realpath)  # the way to the folder of a robot's many files is followed once
    found = []
    for path in paths:
        where = Path(os.path.realpath(path)) if path.is_symlink() else Path(real_folder(path.parent), path.name)
        status = _look(path, where)
        stamps = status.st_mtime_ns, status.st_ctime_ns * 1e-9
        found.append(Signature(where, status.st_dev, status.st_ino, status.st_size, *stamps))
    return tuple(found)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` to write to, and rename it to `path` once what is there is on the disk.

    No reader ever sees half a file. After an exception the old file is as it was, and nothing else is left. Missing
    folders are made. A link stays one, to the new file. What is no file, such as a device or a pipe, is not replaced:
    it is given the content once that is whole.

    Raises:
        OSError: `path` is a folder, or it cannot be written; it names `path`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    where = Path(os.path.realpath(path))
    stays = path.exists() and not path.is_file()
    # The name ends as the path does, since that tells some writers the format; names are limited in bytes.
    end = os.fsencode(path.name)[-200:].decode(errors="ignore")
    name = f".{os.getpid()}-{threading.get_ident()}-{end}"
    temporary = Path(tempfile.gettempdir(), name) if stays else where.with_name(name)
    try:
        yield temporary
        flush(temporary)  # else a crash of the machine can leave the name with nothing behind it
        if stays:
            path.write_bytes(temporary.read_bytes())
        else:
            temporary.replace(where)
    except OSError as error:
        named = error.filename in (None, str(temporary), str(where))  # none: of a disk that became full
        if named and error.errno is not None:
            error.filename = str(path)
        raise
    finally:
        with suppress(OSError):  # in a file system that is read-only; the error above names `path`
            temporary.unlink(missing_ok=True)


def flush(path: Path) -> None:
    """Have the disk hold what was written to a file."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def parsed_json(text: str) -> Any:
    """Return parsed JSON, in which every object has a key once: programs differ in which of two they take.

    Raises:
        ValueError: no JSON, or a key twice; a `JSONDecodeError` where the line is known.
    """
    return json.loads(text, object_pairs_hook=lambda pairs: _once(pairs, text))


def _once(pairs: Sequence[tuple[str, Any]], text: str) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        at = max(text.rfind(json.dumps(twice)), 0)
        raise json.JSONDecodeError(f"a duplicate key: '{twice[:60]}'", text, at)
    return found


def csv_text(head: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as CSV."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([head, *rows])
    return text.getvalue()


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, as `replacing`."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text whole or not at all, as `replacing`."""
    write_bytes(path, text.encode())


def write_together(folder: Path, files: Mapping[str, bytes], last: str, older: Iterable[str] = ()) -> None:
    """Write the files of one result: where their content cannot be written, an earlier result is as it was.

    Args:
        folder: made when it is not there.
        files: content by name.
        last: the file of these by which a folder is known to hold a whole result. It is taken away before the others
            change, and renamed into place after them.
        older: names of files of an earlier result that are taken away, too, where they are not among `files`.

    Raises:
        OSError: as `replacing`.
    """
    with ExitStack() as stack:
        for name in sorted(files, key=last.__ne__):  # the stack is left in reverse order
            temporary = stack.enter_context(replacing(folder / name))
            temporary.write_bytes(files[name])
            flush(temporary)  # before anything of the earlier result is taken away
        if (folder / last).is_file():
            Path(os.path.realpath(folder / last)).unlink()  # of a link the link stays, as in `replacing`
        for name in set(older) - files.keys():
            (folder / name).unlink(missing_ok=True)


def user_folder(variable: str, default: str) -> Path:
    """The folder that an environment variable names, by default one in the user's home.

    A relative path is passed over, as the XDG Base Directory Specification has it, and so is that of the home: it
    would mean another folder wherever the program is called.

    Raises:
        FileNotFoundError: there is no home: a user of whom the system knows a number only, as in many a container.
    """
    named = Path(os.environ.get(variable, ""))
    if named.is_absolute():
        return named
    with suppress(RuntimeError):
        if (home := Path.home()).is_absolute():
            return home / default
    raise FileNotFoundError(errno.ENOENT, "this user has no home folder")


def lock(path: Path) -> int:
    """Lock a file, which is made, and return its descriptor: closing it, or the end of this process, frees it.

    Raises:
        BlockingIOError: it is locked.
        OSError: it cannot be made or locked.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise
    return handle


def _check(path: Path) -> Path:
    """The real path of a file that may be opened."""
    try:
        where = Path(os.path.realpath(path))
    except ValueError as error:  # a name that no file can have
        raise OSError(0, str(error), str(path)) from error
    _look(path, where)
    return where


def _look(path: Path, where: Path) -> os.stat_result:
    """What the system tells of a file, whose real path is `where`.

    Raises:
        OSError: it may not be opened; the path that the user gave is named.
    """
    folders = allowed_folders()
    if folders is not None and not _inside(where, folders):  # said before anything is told about the file
        raise OSError(0, "outside the folders that may be read (`optiplan serve --folder DIR`)", str(path))
    found = where.stat()
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(0, "a folder", str(path))
    if not stat.S_ISREG(found.st_mode) or _inside(where, NEVER):
        raise OSError(0, "not a regular file", str(path))
    if (session := _current.get()) is not None:
        session.looked_at.add(where)
    return found


def _inside(path: Path, folders: Iterable[Path]) -> bool:
    return any(path.is_relative_to(folder) for folder in folders)
