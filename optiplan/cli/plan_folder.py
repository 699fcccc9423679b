"""`optiplan plan DIR`: a folder of problem files as a batch."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from optiplan.cli.output import (
    Exit,
    interruptible,
    messages,
    print_json,
    results,
    say,
    stdout_is_ours,
    tell_interrupted,
)
from optiplan.cli.progress import ProgressLine

NAMED = 20
"""Bad files and failed episodes that are named on the terminal; --json names all."""


def is_folder_of_problems(file: str) -> bool:
    """Return whether `plan` is given a folder that is not that of a run."""
    return Path(file).is_dir() and not (Path(file) / "run.json").is_file()


def plan_folder(
    folder: Path, out: Path | None, planner: str | None, budget: float, as_json: bool, asked: dict[str, Any]
) -> int:
    """Plan every problem file of a folder; `asked` holds seeds, rate, lerobot, workers and dask.

    Ctrl-C writes the rows of what is done, and ends with 130; the same command goes on.
    """
    from optiplan.api.batches import plan_batch

    if out is None:
        raise typer.BadParameter("a folder of problems needs a folder for the results", param_hint="--out")
    address = asked.pop("dask")
    try:
        with interruptible(), stdout_is_ours(), _workers(address, asked.pop("workers")) as workers:
            with ProgressLine() as progress:
                batch = plan_batch(folder, out, planner, budget=budget, workers=workers, progress=progress, **asked)
    except KeyboardInterrupt:
        return tell_interrupted("what is done is kept, the same command goes on", as_json)
    counts = dict(batch.counts)
    code = next((code for state, code in _CODES if counts.get(state)), Exit.VERIFIED)
    if as_json:
        bad = [{"file": file, "reason": reason} for file, reason in batch.bad]
        failed = [{"episode": episode, "reason": reason} for episode, reason in batch.failed]
        sets = [str(path) for path in batch.data_sets]
        told = {"out": str(batch.out), "counts": counts, "planned": batch.made, "kept": batch.kept}
        print_json({**told, "bad": bad, "failed": failed, "data_sets": sets, "exit_code": int(code)})
        return code
    wrong = [*(reason for _, reason in batch.bad), *(f"{episode}: {reason}" for episode, reason in batch.failed)]
    for words in wrong[:NAMED]:
        messages().print(words, style="yellow", markup=False, soft_wrap=True)
    if len(wrong) > NAMED:
        messages().print(f"… and {len(wrong) - NAMED} more (--json names all)", style="yellow")
    listed = ", ".join(f"{count} {state}" for state, count in counts.items())
    results().print(f"{listed}; {batch.made} new, {batch.kept} kept", highlight=False)
    for path in (batch.out / "episodes", *batch.data_sets):
        say(f"written: {path}")
    return code


_CODES = (
    ("bad-input", Exit.BAD_INPUT),
    ("unverified", Exit.NOT_VERIFIED),
    ("crashed", Exit.NO_PLAN),
    ("no-plan", Exit.NO_PLAN),
)
"""The exit code of a batch is that of the first of these states that some episode has."""


@contextmanager
def _workers(address: str, count: int | None) -> Iterator[Any]:
    """Yield the number of processes, or a client of a Dask scheduler."""
    if not address:
        yield count
        return
    if count is not None:
        raise typer.BadParameter("goes with processes of this machine, not with --dask", param_hint="--workers")
    from optiplan.bench.dask.cluster import connected_client

    with connected_client(address) as client:
        yield client
