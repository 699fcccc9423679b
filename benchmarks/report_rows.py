"""Sixty-one things that the source reports describe, each done here by its command: a table of what works.

    python benchmarks/report_rows.py --markdown rows.md                 # six minutes on one core

Every row of `benchmarks/reports/rows.yaml` runs in a process and a folder of its own. It *works* where the command
ends with 0 and prints what the row looks for; it is *better* where it does so and the row names what it does beyond
the report. Any other outcome is *fails*, with the last line that the command printed. A row without a command says
what is *missing*. The exit code is 1 if a command fails.
"""

import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from published import print_table, table_parser, write_markdown

from optiplan.config.document import read_yaml

ROOT = Path(__file__).parent.parent
ROWS = Path(__file__).parent / "reports" / "rows.yaml"
EXERCISES = ROWS.with_name("exercises.yaml")
"""Misprints that are no rows of their own."""
SECONDS = 300
"""For one row."""
COMMAND = "import sys; from optiplan.cli.main import main; sys.exit(main())"


@dataclass(frozen=True)
class Row:
    """A row of the table; see the file for what each field means."""

    report: str
    what: str
    run: str = ""
    python: str = ""
    shows: tuple[str, ...] = ()
    better: str = ""
    missing: str = ""
    ask: str = ""
    printed: str = ""
    right: str = ""
    why: str = ""
    of: str = ""
    count_of: str = ""

    def words(self, out: str) -> list[str]:
        """The command, with this folder for what it writes."""
        if self.python:
            return [sys.executable, "-c", self.python]
        first, *rest = shlex.split(self.run.format(out=out))
        return [sys.executable, *(["-c", COMMAND] if first == "optiplan" else []), *rest]

    @property
    def shown(self) -> str:
        """The command as a cell of a table."""
        return "the code of its row" if self.python else f"`{self.run}`" if self.run else ""


@dataclass(frozen=True)
class Outcome:
    """What became of a row: `works`, `better`, `fails` or `missing`, why, and how long it took, s."""

    row: Row
    verdict: str
    words: str
    seconds: float


def rows(path: Path = ROWS) -> list[Row]:
    """All rows of a file."""
    found: list[dict[str, Any]] = read_yaml(path).data
    return [Row(**{**one, "shows": tuple(one.get("shows", ()))}) for one in found]


def outcome(row: Row) -> Outcome:
    """Run a row's command and look for what it must show."""
    if row.missing:
        return Outcome(row, "missing", row.missing, 0.0)
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        where = ROOT if any((ROOT / word).exists() for word in row.run.split() if "/" in word) else Path(folder)
        try:
            ended = subprocess.run(
                row.words(folder),
                cwd=where,
                env={**os.environ, "PYTHONPATH": path},
                capture_output=True,
                text=True,
                timeout=SECONDS,
            )
        except subprocess.TimeoutExpired:
            return Outcome(row, "fails", f"not ended within {SECONDS} s", time.perf_counter() - begun)
    seconds = time.perf_counter() - begun
    lacking = [text for text in row.shows if text not in ended.stdout + ended.stderr]  # scripts print tables there
    if ended.returncode or lacking:
        last = (ended.stderr or ended.stdout).strip().splitlines()[-1:] or ["no output"]
        why = f"exit code {ended.returncode}" if ended.returncode else f"does not show '{lacking[0]}'"
        return Outcome(row, "fails", f"{why}: {last[0][:200]}", seconds)
    return Outcome(row, "better" if row.better else "works", row.better, seconds)


HEADINGS = ("report", "what", "verdict", "beyond the report, or why not", "command", "s")


def table(found: Sequence[Outcome]) -> list[list[str]]:
    """The outcomes as rows of a table."""
    return [
        [one.row.report, one.row.what, one.verdict, one.words, one.row.shown, f"{one.seconds:.1f}"] for one in found
    ]


def counted(found: Sequence[Outcome]) -> str:
    """How many rows have which verdict."""
    counts = Counter(one.verdict for one in found)
    told = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ("better", "works", "fails", "missing"))
    return f"{len(found)} rows: {told}."


def main() -> int:
    """Run the rows and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("--only", metavar="WORD", default="", help="rows whose report or name holds it")
    parser.add_argument("--exercises", action="store_true", help="instead: what the reports got wrong")
    asked = parser.parse_args()
    every = [row for row in rows() + rows(EXERCISES) if row.ask] if asked.exercises else rows()
    found = []
    for row in every:
        if asked.only in f"{row.report} {row.what}":
            found.append(outcome(row))
            print(f"{found[-1].verdict:8}{found[-1].seconds:6.1f} s  {row.report}: {row.what}", file=sys.stderr)
    print_table(HEADINGS, table(found))
    print(counted(found))
    write_markdown(asked.markdown, HEADINGS, table(found), [counted(found)])
    return int(any(one.verdict == "fails" for one in found))


if __name__ == "__main__":
    sys.exit(main())
