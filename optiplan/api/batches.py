"""`plan_batch`: folders of thousands of problem files, resumable, into Parquet and LeRobot data sets."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from optiplan.api.planning import BUDGET, positive_seconds
from optiplan.cores import cores
from optiplan.errors import (
    InputError,
    Issue,
    described,
    flag_argument,
    options_argument,
    path_argument,
    progress_argument,
    whole_argument,
    wrong_argument,
)
from optiplan.files import is_folder
from optiplan.planners.base import Progress
from optiplan.planners.registry import make_planner
from optiplan.records import dataclass
from optiplan.runs.batches.episode import BAD_INPUT, STATES, VERIFIED, EpisodeRequest, digest_of
from optiplan.runs.batches.lerobot import write_lerobot
from optiplan.runs.batches.store import BatchStore
from optiplan.runs.batches.workers import in_processes, is_dask_client, on_cluster
from optiplan.runs.run_folder import check_folder

RATE = 50
"""Hz of the samples, when none is given."""
MOST_RATE = 10_000
"""Hz; more samples of thousands of episodes are more than a memory holds."""

LEROBOT = "lerobot"
"""Folder of the data sets within that of the batch."""


@dataclass(frozen=True)
class Batch:
    """What came of a batch.

    Attributes:
        out: its folder.
        counts: episodes of each state: verified, unverified, no-plan, bad-input, crashed.
        made: episodes that this call added, bad files included.
        kept: episodes that were there already.
        bad: files that cannot be used and why, with file, line and field.
        failed: other episodes without a verified motion, as `FILE` or `FILE, seed N`, and why: state and detail.
        data_sets: folders of LeRobot data sets.
    """

    out: Path
    counts: Mapping[str, int]
    made: int
    kept: int
    bad: tuple[tuple[str, str], ...]
    failed: tuple[tuple[str, str], ...]
    data_sets: tuple[Path, ...]


def plan_batch(  # noqa: PLR0913  # what a caller may say of a batch
    problems: Path | str | Sequence[Path | str],
    out: Path | str,
    planner: str | None = None,
    options: Mapping[str, Any] | None = None,
    budget: float = BUDGET,
    *,
    seeds: int | None = None,
    rate: int = RATE,
    lerobot: bool = False,
    workers: int | Any = None,
    progress: Progress | None = None,
) -> Batch:
    """Plan and verify every problem file of a folder, and keep all results; called again, it continues.

    Each episode is a row of `out/episodes/part-*.parquet`: state, verdict with every check, the motion in pieces, and
    samples. An episode is planned once: a later call leaves out those whose file has not changed. A file that cannot
    be used, or that kills its worker, is a row as well and ends no other; a later call tries it again.

    Args:
        problems: a folder, whose `*.yaml` are taken at any depth, or files.
        out: the folder of the batch; a new one, or that of a batch with the same arguments.
        planner: a name of `op.planners()`, or `module:Class`; None: each problem's own.
        options: of that planner, as of `op.plan`.
        budget: seconds of wall time for planning and proof of each.
        seeds: plan every file with the seeds 0 to seeds - 1; None: once, with its own.
        rate: of the samples, Hz.
        lerobot: also write `out/lerobot/ROBOT`, a data set of LeRobot (v3.0) of all verified episodes.
        workers: how many processes, each on one core; None: as many as this process may use cores. Or a Dask client
            (`distributed.Client`), whose workers have the same versions and see the same files.
        progress: called with the last file that is done and the fraction (0 to 1) of all that is to be done.

    Returns:
        What came of it.

    Raises:
        InputError: an argument does not fit, no such planner, no problem file, a file name that is not UTF-8, or `out`
            is of another batch or in use by another call.
        OptiPlanError: pyarrow is not installed, or the Dask cluster failed; rows that came before are kept.

    A script that calls it guards its own start with `if __name__ == "__main__":`, since the processes import it.

    Example:
        >>> import optiplan as op
        >>> op.plan_batch("problems", "runs/batch", seeds=10, lerobot=True).counts  # doctest: +SKIP
        {'verified': 420, 'no-plan': 30}
    """
    progress_argument("plan_batch", progress)
    options_argument("plan_batch", options)
    check_folder(target := path_argument("plan_batch", "out", out, "the path of a folder"))
    if planner is not None and not isinstance(planner, str):
        raise wrong_argument("plan_batch", "planner", described(planner), "the name of a planner, or `module:Class`")
    if seeds is not None:
        whole_argument("plan_batch", "seeds", seeds, 1)
    whole_argument("plan_batch", "rate", rate, 1, f"a whole number of Hz from 1 to {MOST_RATE}", most=MOST_RATE)
    flag_argument("plan_batch", "lerobot", lerobot)
    if workers is not None and not is_dask_client(workers):
        expected = "a whole number >= 1, or a Dask client (distributed.Client)"
        whole_argument("plan_batch", "workers", workers, 1, expected)
    if planner is not None:
        make_planner(planner, options or {})
    root, files = _files(problems)
    _check_names(root, files)
    seconds = positive_seconds("plan_batch", budget)
    told = {"planner": planner, "options": options and dict(options), "budget": seconds, "seeds": seeds, "rate": rate}
    with BatchStore(target, {**told, "root": str(root)}) as store:
        done = store.done()
        wanted = [(file, seed) for file in files for seed in (range(seeds) if seeds else (None,))]
        left = [(file, seed) for file, seed in wanted if done.get((file, _shown(seed))) != digest_of(root / file)]
        requests = (EpisodeRequest(root, file, seed, planner, options, seconds, float(rate)) for file, seed in left)
        for k, episode in enumerate(_episodes(requests, workers, len(left)), 1):
            store.add(episode)
            if progress is not None:
                progress(episode.file, k / len(left))
        store.flush()
        counts, wrong = Counter[str](), list[Mapping[str, Any]]()
        for row in store.rows(["state", "detail"], set(files)):
            counts[row["state"]] += 1
            if row["state"] != VERIFIED:
                wrong.append(row)
        data_sets = write_lerobot(store, target / LEROBOT) if lerobot else []
    ordered = {state: counts[state] for state in STATES if counts[state]}
    bad = {row["file"]: row["detail"] for row in wrong if row["state"] == BAD_INPUT}
    failed = [(_named(row), f"{row['state']}: {row['detail']}") for row in wrong if row["state"] != BAD_INPUT]
    kept = len(wanted) - len(left)
    return Batch(target, ordered, len(left), kept, tuple(bad.items()), tuple(failed), tuple(data_sets))


def _named(row: Mapping[str, Any]) -> str:
    return row["file"] if row["wanted_seed"] < 0 else f"{row['file']}, seed {row['wanted_seed']}"


def _shown(seed: int | None) -> int:
    return -1 if seed is None else seed


def _episodes(requests: Iterator[EpisodeRequest], workers: Any, count: int) -> Iterator[Any]:
    first = next(requests, None)
    if first is None:
        return iter(())
    requests = chain([first], requests)
    if is_dask_client(workers):
        return on_cluster(requests, workers)
    return in_processes(requests, min(workers or cores(), count))


def _check_names(root: Path, files: Sequence[str]) -> None:
    """Refuse names that no row can hold, before anything is planned."""
    shown = {path: path.encode("utf-8", "replace").decode() for path in (str(root / file) for file in files)}
    odd = [name for path, name in shown.items() if name != path]
    if odd:
        raise InputError([Issue(name, None, "problems", "a name that is not UTF-8", "one that is") for name in odd])


def _files(problems: Any) -> tuple[Path, list[str]]:
    """The folder that file names are relative to, and the names in order."""
    if isinstance(problems, str | Path):
        root = Path(problems)
        files = chain(root.rglob("*.yaml"), root.rglob("*.yml")) if is_folder(root) else ()
        found = sorted(path for path in files if path.name != "robot.yaml")
        if not found:
            told = "a folder without any *.yaml" if is_folder(root) else "no folder"
            raise InputError([Issue(str(root), None, "problems", told, "a folder with problem files")])
        return root.resolve(), [str(path.relative_to(root)) for path in found]
    if not isinstance(problems, Sequence) or not all(isinstance(path, str | Path) for path in problems) or not problems:
        raise wrong_argument("plan_batch", "problems", described(problems), "a folder, or the paths of problem files")
    paths = [Path(path).resolve() for path in problems]
    root = Path(paths[0].anchor)
    common = next(folder for folder in (*paths[0].parents, root) if all(path.is_relative_to(folder) for path in paths))
    return common, [str(path.relative_to(common)) for path in paths]
