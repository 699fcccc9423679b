"""Best known durations: tables of the shortest verified motion of each problem, with the recipe that makes it again."""

import csv
import fcntl
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import astuple, fields
from pathlib import Path

from optiplan.bench.results.database import Store
from optiplan.errors import InputError, Issue
from optiplan.files import csv_text, read_bytes, write_text
from optiplan.records import dataclass

LESS = 1e-9
"""Share of a duration by which another must be shorter to replace it: less is rounding."""


@dataclass(frozen=True)
class BestKnown:
    """The shortest verified motion of a problem that anybody found: a line of a table.

    Attributes:
        problem: its id, `<set>/<name>`.
        hash: `Problem.hash`, by which it is known.
        duration: s, of the motion that the verifier confirmed.
        planner: name in the registry.
        options: its options, JSON.
        seed: that it was planned with.
        budget: s.
        version: of OptiPlan: version, commit, digest.
        trajectory: SHA-256 of the motion, hex, as in column `trajectory` of a suite's results.
    """

    problem: str
    hash: str
    duration: float
    planner: str
    options: str
    seed: int
    budget: float
    version: str
    trajectory: str


class BestKnownTable:
    """A table of best known durations, read from a CSV file; a file that is not there yet is an empty one.

    Raises:
        InputError: the file cannot be read as such a table.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows: dict[str, BestKnown] = {}
        self._take_file()

    def _take_file(self) -> None:
        """Offer every line of the file: of two lines about one problem the shorter duration counts."""
        for row in _read(self.path) if self.path.exists() else ():
            self.offer(row)

    def __len__(self) -> int:
        """Return the number of problems."""
        return len(self._rows)

    def get(self, problem_hash: str) -> BestKnown | None:
        """The entry of a problem, by its hash."""
        return self._rows.get(problem_hash)

    def rows(self) -> list[BestKnown]:
        """Every entry, by the problem's id."""
        return sorted(self._rows.values(), key=lambda row: (row.problem, row.hash))

    def offer(self, found: BestKnown) -> bool:
        """Take a verified motion if its problem is new here, or no motion as short was known; return whether it was."""
        known = self.get(found.hash)
        if known is not None and found.duration >= known.duration * (1.0 - LESS):
            return False
        self._rows[found.hash] = found
        return True

    def ratio(self, problem_hash: str, duration: float) -> float | None:
        """Duration, s, over the best known; None for a problem that is not here."""
        known = self.get(problem_hash)
        return None if known is None else duration / known.duration

    def write(self) -> None:
        """Write the file whole or not at all, with what others wrote into it meanwhile."""
        with _alone_in(Path(os.path.realpath(self.path)).parent):
            self._take_file()
            write_text(self.path, csv_text(_NAMES, map(astuple, self.rows())))


@dataclass(frozen=True)
class Standing:
    """How the runs of a suite stand against a table of best known durations.

    Attributes:
        known: problems of the suite with a verified run.
        new: problems that it did not have.
        beaten: problems of which a run was shorter than what it had.
        ratio: by planner, the durations of its verified runs over the best known, ascending.
    """

    known: int
    new: int
    beaten: int
    ratio: Mapping[str, list[float]]


def hold_against(store: Store, table: BestKnownTable) -> Standing:
    """Offer every verified run of a suite to the table, and compare all of them with what it has then."""
    runs = store.query(_VERIFIED)
    before = {row["hash"] for row in runs if table.get(row["hash"])}
    beaten = set()
    budget = float(store.meta("parts")["budget"])
    for row in runs:
        recipe = row["planner"], row["options"], row["seed"], budget, row["optiplan"] or "", row["trajectory"] or ""
        if table.offer(BestKnown(row["problem"], row["hash"], row["duration"], *recipe)):
            beaten.add(row["hash"])
    ratio: dict[str, list[float]] = {}
    for row in runs:
        share = table.ratio(row["hash"], row["duration"])
        ratio.setdefault(row["label"], []).append(float("nan") if share is None else share)
    every = {row["hash"] for row in runs}
    best = {row["problem"]: known.duration for row in runs if (known := table.get(row["hash"]))}
    store.set_meta("best_known", best)  # a report measures quality against these
    return Standing(len(every), len(every - before), len(beaten & before), {k: sorted(v) for k, v in ratio.items()})


_VERIFIED = """
SELECT problems.id AS problem, problems.hash AS hash, runs.duration AS duration, planners.name AS planner,
    planners.options AS options, planners.label AS label, runs.seed AS seed, runs.optiplan AS optiplan,
    runs.trajectory AS trajectory
FROM runs JOIN problems ON problems.id = runs.problem JOIN planners ON planners.label = runs.planner
WHERE runs.verified AND runs.duration IS NOT NULL ORDER BY problems.position, planners.position, runs.seed
"""

_NAMES = tuple(field.name for field in fields(BestKnown))


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait while another process writes a table into the folder; the lock on the folder leaves no file behind."""
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _read(path: Path) -> Iterable[BestKnown]:
    try:
        lines = list(csv.reader(io.StringIO(read_bytes(path).decode())))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _unusable(path, None, str(error)) from error
    if not lines or tuple(lines[0]) != _NAMES:
        raise _unusable(path, 1, f"the columns {', '.join(lines[0]) if lines else 'of an empty file'}")
    for number, cells in enumerate(lines[1:], 2):
        try:
            row = dict(zip(_NAMES, cells, strict=True))
            duration, seed, budget = float(row["duration"]), int(row["seed"]), float(row["budget"])
            if not (0.0 < duration < float("inf") and isinstance(json.loads(row["options"]), dict)):
                raise ValueError("no duration, or no options")
        except ValueError as error:
            raise _unusable(path, number, f"a line that is none: {error}") from error
        yield BestKnown(**{**row, "duration": duration, "seed": seed, "budget": budget})  # type: ignore[arg-type]


def _unusable(path: Path, line: int | None, found: str) -> InputError:
    expected = f"a table of best known durations, with the columns {', '.join(_NAMES)}"
    return InputError([Issue(str(path), line, "file", found, expected)])
