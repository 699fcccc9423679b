"""Failures grouped by reason: details that differ only in names and numbers are one reason."""

import re
from collections import Counter
from typing import NamedTuple

from optiplan.bench.results.database import Store
from optiplan.bench.results.records import Key

EXAMPLES = 12
"""Runs of a reason that are listed: of as many problems and planners as there are."""

REASONS = 40
"""Reasons that are listed, the most frequent ones; the rest is one line."""

WORDS = 200
"""Characters of a detail that are looked at."""

SELECT = f"""
SELECT problem, planner, seed, repetition, failure_kind, substr(failure_detail, 1, {WORDS}) AS detail,
    witness IS NOT NULL AS seen
FROM runs WHERE failure_kind IS NOT NULL ORDER BY problem, planner, seed, repetition
"""

_VARIABLE = re.compile(r"'[^']*'|(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")


class Failed(NamedTuple):
    """A run that failed: which, in what words, and whether there is a witness to look at."""

    problem: str
    planner: str
    seed: int
    repetition: int
    detail: str
    seen: bool

    @property
    def key(self) -> Key:
        """Of the run."""
        return self[:4]


class Reason(NamedTuple):
    """Failures of one reason: kind, the words without names and numbers, how many by planner, some of them."""

    kind: str
    words: str
    runs: int
    planners: dict[str, int]
    problems: int
    examples: tuple[Failed, ...]


def reasons(store: Store) -> list[Reason]:
    """All failures by reason, the most frequent first."""
    groups: dict[tuple[str, str], list[Failed]] = {}
    for batch in store.batches(SELECT):
        for row in batch:
            problem, planner, seed, repetition, kind, detail, seen = row
            run = Failed(problem, planner, seed, repetition, detail or "", bool(seen))
            groups.setdefault((kind, alike(run.detail)), []).append(run)
    found = [
        Reason(
            kind,
            words,
            len(runs),
            dict(Counter(run.planner for run in runs).most_common()),
            len({run.problem for run in runs}),
            _various(runs),
        )
        for (kind, words), runs in groups.items()
    ]
    return sorted(found, key=lambda reason: (-reason.runs, reason.kind, reason.words))


def alike(detail: str) -> str:
    """Return the part of a detail common to runs: its first line without quoted names and numbers."""
    return _VARIABLE.sub("…", detail.split("\n", 1)[0]).strip()


def _various(runs: list[Failed]) -> tuple[Failed, ...]:
    """Some runs: one of every planner before a second one of any, of problems not seen yet if there are."""
    seen: Counter[str] = Counter()
    ranked = []
    for run in runs:
        rank = seen[f"planner {run.planner}"], seen[f"problem {run.problem}"]
        seen.update((f"planner {run.planner}", f"problem {run.problem}"))
        ranked.append((rank, run))
    return tuple(run for _, run in sorted(ranked, key=lambda pair: pair[0])[:EXAMPLES])
