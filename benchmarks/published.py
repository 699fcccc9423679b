"""What the benchmarks share: problems of MotionBenchMaker, and Markdown tables that name their command and commit."""

import argparse
import json
import math
import os
import shlex
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import optiplan

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("OPTIPLAN_SHARED", ROOT.parent / "shared"))
Rows = Sequence[Sequence[str]]


def commit() -> str:
    """Short hash of the commit of the optiplan that is measured, with `-dirty` where its files differ from it."""
    head = _git("rev-parse", "--short", "HEAD")
    return f"{head}-dirty" if _git("status", "--porcelain", "--untracked-files=no", "--", "optiplan") else head


def script_parser(description: str | None) -> argparse.ArgumentParser:
    """Return a parser of the command line whose `--help` is the script's docstring."""
    return argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)


def table_parser(description: str | None) -> argparse.ArgumentParser:
    """Return a parser of the command line of a script that makes a table, with the option `--markdown`."""
    parser = script_parser(description)
    parser.add_argument("--markdown", type=Path, help="write the table to this file")
    return parser


def sets_parser(description: str | None) -> argparse.ArgumentParser:
    """Return the parser of a script that makes a table of MotionBenchMaker's sets: which of them, and for how long."""
    parser = table_parser(description)
    parser.add_argument("--robot", choices=("panda", "ur5", "fetch"), default="panda")
    parser.add_argument("--sets", nargs="*", help="only these sets, such as box cage")
    parser.add_argument("--every", type=int, default=1, help="only every so many problems of each set")
    parser.add_argument("--offset", type=int, default=0, help="index of the first of them")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds for each problem")
    return parser


def command_line() -> str:
    """The command that this process was started with, as one would type it in the checkout, folders left out."""
    script = Path(sys.argv[0]).resolve()
    shown = script.relative_to(ROOT) if script.is_relative_to(ROOT) else script
    rest = (Path(word).name if word.startswith("/") else word for word in _without_markdown(sys.argv[1:]))
    return shlex.join(["python", str(shown), *rest])


def print_table(headings: Sequence[str], rows: Rows) -> None:
    """Print the table to stderr."""
    table = Table(*headings, box=None, pad_edge=False, header_style="dim")
    for row in rows:
        table.add_row(*row)
    Console(stderr=True, width=160).print(table)


def write_markdown(path: Path | None, headings: Sequence[str], rows: Rows, remarks: Iterable[str] = ()) -> None:
    """Write command, commit, date, table and remarks to a file that `publish.py` can put into the README."""
    if path is None:
        return
    today = datetime.now(UTC).date().isoformat()
    text = [f"    {command_line()}", "", f"Commit `{commit()}`, {today}.", ""]
    text += markdown(headings, rows)
    for remark in remarks:
        text += ["", remark]
    path.write_text("\n".join(text) + "\n")


def markdown(headings: Sequence[str], rows: Rows) -> list[str]:
    """The lines of a Markdown table."""
    lines = [headings, ["---"] * len(headings), *rows]
    return [f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines]


def print_json(data: Mapping[str, Any]) -> None:
    """Print one line of JSON to stdout, null for what is not finite."""
    print(json.dumps(_finite(data)), flush=True)


def finish(
    path: Path | None, headings: Sequence[str], rows: Rows, data: Mapping[str, Any], remarks: Iterable[str] = ()
) -> None:
    """Print the table, write it with its remarks to a file where one is given, and print the data as JSON."""
    print_table(headings, rows)
    write_markdown(path, headings, rows, remarks)
    print_json(data)


def by_set(rows: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """The rows of each set, in the order in which sets come first, and `all` of them last."""
    groups: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        groups[row["set"]].append(row)
    return {**groups, "all": list(rows)}


def import_sets(robot: str, folder: Path, every: int = 1, offset: int = 0) -> dict[str, list[Path]]:
    """Problem files of MotionBenchMaker by set: those with the indices offset, offset + every, … of each set.

    Args:
        robot: name of the folders `mbm/<robot>` and `robots/mbm_<robot>` of $OPTIPLAN_SHARED.
        folder: gets the files.
        every: distance of two indices within a set.
        offset: first index.
    """
    from optiplan.importers.motion_bench_maker import (  # here, for tables of versions that have no such reader
        Importer,
        find_pairs,
    )

    root = SHARED / "mbm" / robot
    importer = Importer(str(SHARED / "robots" / f"mbm_{robot}" / "robot.yaml"))
    pairs, _ = find_pairs(root)
    sets: dict[str, list[tuple[Path, Path]]] = defaultdict(list)
    for scene, request in pairs:
        sets[scene.parent.name].append((scene, request))
    return {
        name: [importer.write(scene, request, folder / name) for scene, request in sorted(group)[offset::every]]
        for name, group in sorted(sets.items())
    }


def percentiles(values: Iterable[float | None], *which: float) -> list[float]:
    """Percentiles of the values that are known, of which some may be infinite; nan without any."""
    known = [value for value in values if value is not None]
    method = "linear" if np.isfinite(known).all() else "inverted_cdf"  # no value lies between a number and infinity
    return [float(np.percentile(known, p, method=method)) if known else float("nan") for p in which]


def _without_markdown(arguments: list[str]) -> list[str]:
    """Drop `--markdown FILE`, which says only where the table goes."""
    if "--markdown" not in arguments:
        return arguments
    k = arguments.index("--markdown")
    return arguments[:k] + arguments[k + 2 :]


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _git(*arguments: str) -> str:
    checkout = Path(optiplan.__file__).resolve().parents[1]
    done = subprocess.run(["git", "-C", str(checkout), *arguments], capture_output=True, text=True, check=False)
    return done.stdout.strip() or ("unknown" if done.returncode else "")
