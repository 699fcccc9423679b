"""What is kept for how long: old runs go, the oldest first where they are too many bytes, and what nobody refers to."""

from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.problem_table import ProblemTable
from optiplan.service.store.run_table import ENDED, RunTable

YOUNG = 3600.0
"""s: contents younger than that may belong to a run that is being recorded."""


def outdated(runs: RunTable, settings: ServiceSettings) -> list[str]:
    """The runs that have ended and are too old, or too many bytes after newer ones."""
    ended = sorted(runs.of_states(ENDED), key=lambda record: record["submitted"], reverse=True)
    oldest, total, found = runs.now() - settings.keep_days * 86400.0, 0, []
    for record in ended:
        total += record["bytes"]
        if record["submitted"] < oldest or total > settings.keep_bytes:
            found.append(record["id"])
    return found


def sweep(contents: ContentFolder, runs: RunTable, problems: ProblemTable, young: float = YOUNG) -> int:
    """Delete contents that no run and no problem refers to; return how many."""
    there = contents.older_than(young)
    used = runs.digests_in_use() | problems.digests_in_use()
    for digest in there - used:
        contents.delete(digest)
    return len(there - used)
