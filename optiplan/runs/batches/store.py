"""The rows of a batch in Parquet files that appear whole, and what was requested, so that a batch can be continued.

    batch.json                     planner, options, seconds, seeds, rate: a batch is continued with the same only
    episodes/part-000000.parquet   rows in the order in which they were made, `episode.Episode` a row

A row is the last one of its file and seed: a file that changed since is planned again. Rows of files that are gone do
not count.
"""

import errno
import json
import os
import time
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.files import lock, read_bytes, replacing, write_text
from optiplan.runs.batches.episode import ANSWERS, Episode

SETTINGS, EPISODES, LOCK = "batch.json", "episodes", "lock"

ROWS, SECONDS = 500, 30.0
"""A file is written after so many rows or seconds: what a crash of the machine costs at most."""

Key = tuple[str, int]
"""File, and the requested seed (-1: the file's own)."""

_FLOATS = ("positions", "velocities", "accelerations")


def pyarrow_modules() -> tuple[Any, Any]:
    """The modules `pyarrow` and `pyarrow.parquet`.

    Raises:
        OptiPlanError: it is not installed.
    """
    if find_spec("pyarrow") is None:
        raise OptiPlanError("a batch is written as Parquet, which needs pyarrow: pip install 'optiplan[results]'")
    return import_module("pyarrow"), import_module("pyarrow.parquet")


class BatchStore:
    """The folder of a batch; a context that writes what is still in memory at its end, whatever that is."""

    def __init__(self, folder: Path, settings: Mapping[str, Any]) -> None:
        """Open a folder, or make it.

        Raises:
            InputError: the folder holds a batch of other settings, or something else, or another call writes to it.
            OptiPlanError: pyarrow is not installed.
        """
        self.folder = folder
        self._pa, self._pq = pyarrow_modules()
        self._schema = self._schema_of_rows()
        self._root = str(settings.get("root", ""))
        self._buffer: list[Episode] = []
        self._first = 0.0
        _check_settings(folder, settings)
        (folder / EPISODES).mkdir(parents=True, exist_ok=True)
        try:
            self._lock: int | None = lock(folder / LOCK)
        except BlockingIOError:
            found = "a batch is being planned into it at this moment"
            raise InputError([Issue(str(folder), None, "out", found, "one call a folder")]) from None
        except OSError as error:
            if error.errno not in (errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK):
                raise
            self._lock = None  # shared folders of some clusters have no locks
        self._next = 1 + max((int(path.stem.partition("-")[2]) for path in self.parts()), default=-1)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.flush()
        finally:
            if self._lock is not None:
                os.close(self._lock)

    def parts(self) -> list[Path]:
        """The files with rows, oldest first."""
        return sorted((self.folder / EPISODES).glob("part-*.parquet"))

    def add(self, episode: Episode) -> None:
        """Keep a row; every so often the rows kept are written."""
        if not self._buffer:
            self._first = time.monotonic()
        self._buffer.append(episode)
        if len(self._buffer) >= ROWS or time.monotonic() - self._first > SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write the rows that are in memory alone."""
        if not self._buffer:
            return
        columns = {field.name: [getattr(row, field.name) for row in self._buffer] for field in fields(Episode)}
        table = self._pa.table(columns, schema=self._schema)
        with replacing(self.folder / EPISODES / f"part-{self._next:06d}.parquet") as temporary:
            self._pq.write_table(table, temporary, compression="zstd")
        self._next += 1
        self._buffer.clear()

    def done(self) -> dict[Key, str]:
        """The digest of the file of every row that is written, and whose state is one of `ANSWERS`."""
        found: dict[Key, str] = {}
        for part in self.parts():
            table = self._pq.read_table(part, columns=["file", "wanted_seed", "file_digest", "state"]).to_pydict()
            for file, seed, digest, state in zip(*table.values(), strict=True):
                found.pop((file, seed), None)
                found |= {(file, seed): digest} if state in ANSWERS else {}
        return found

    def rows(self, columns: list[str] | None = None, asked: Container[str] = ()) -> Iterator[dict[str, Any]]:
        """Yield the last row of every file and seed, in the order in which they were written, one part in memory.

        Those of files that are gone are left out, but for files that are `asked` for.
        """
        last: dict[Key, tuple[int, int]] = {}
        for number, part in enumerate(self.parts()):
            keys = self._pq.read_table(part, columns=["file", "wanted_seed"]).to_pydict()
            for k, key in enumerate(zip(keys["file"], keys["wanted_seed"], strict=True)):
                last[key] = number, k
        gone = {file for file in self._gone(last) if file not in asked}
        wanted = None if columns is None else [*dict.fromkeys([*columns, "file", "wanted_seed"])]
        for number, part in enumerate(self.parts()):
            for k, row in enumerate(self._pq.read_table(part, columns=wanted).to_pylist()):
                if last[row["file"], row["wanted_seed"]] == (number, k) and row["file"] not in gone:
                    yield row

    def _gone(self, keys: Iterable[Key]) -> set[str]:
        """Return the files of rows that are not there any more; none where the root is not known."""
        files = {file for file, _ in keys} if self._root else ()
        return {file for file in files if not (Path(self._root) / file).is_file()}

    def _schema_of_rows(self) -> Any:
        pa = self._pa
        kinds = {str: pa.string(), int: pa.int64(), float: pa.float64(), bytes: pa.binary()}
        named = {"joints": pa.list_(pa.string()), **{name: pa.list_(pa.float32()) for name in _FLOATS}}
        return pa.schema([(one.name, named.get(one.name) or kinds[_kind(one.type)]) for one in fields(Episode)])


def _kind(annotation: Any) -> type:
    return annotation if isinstance(annotation, type) else str


def array_of(row: Mapping[str, Any], name: str) -> np.ndarray[Any, Any]:
    """The samples of a row, (k, n) float32."""
    return np.asarray(row[name], np.float32).reshape(-1, len(row["joints"]))


def _check_settings(folder: Path, settings: Mapping[str, Any]) -> None:
    path = folder / SETTINGS
    if not path.exists():
        if folder.is_dir() and any(folder.iterdir()):
            found = f"a folder without {SETTINGS}, but with other files"
            raise InputError([Issue(str(folder), None, "out", found, "a new folder, or that of a batch")])
        write_text(path, json.dumps(settings, indent=1, sort_keys=True) + "\n")
        return
    try:
        before = json.loads(read_bytes(path))
        if not isinstance(before, dict):
            raise ValueError(f"{before!r:.60}")
    except (OSError, ValueError) as error:
        raise InputError([Issue(str(path), None, "batch", str(error), f"the {SETTINGS} of a batch")]) from error
    plain = json.loads(json.dumps(settings))
    different = [key for key in sorted({*plain, *before}) if plain.get(key) != before.get(key)]
    if different:
        expected = "the same to continue it, or another folder (--out)"
        issues = [
            Issue(str(path), None, key, f"{plain.get(key)!r} in the place of {before.get(key)!r}", expected)
            for key in different
        ]
        raise InputError(issues)
