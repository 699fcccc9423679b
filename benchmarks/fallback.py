"""The reference path beside the native core, on the same problems: verdicts, and how much slower.

    python benchmarks/fallback.py --every 25
    python benchmarks/fallback.py --every 10 --budget 20 --markdown fallback.md

Each runs in a process of its own. `OPTIPLAN_CORE=none` is what runs where no extension could be built. The verifier
never uses the core: its time is in
both columns. The last line printed is one JSON object.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from published import commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown

HEADINGS = ("core", "n", "verified", "first s 50 / 95", "plan s 50 / 95", "duration sum s", "slower: first / plan")
WORK = """
import json, sys
from optiplan._core import variant
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run
files, budget = sys.argv[2:], float(sys.argv[1])
problems = [load_problem(file) for file in files]
run(problems[0], "trajopt", {}, Budget(5.0), lambda *_: None)  # imports
for file, problem in zip(files, problems, strict=True):
    done = run(problem, "trajopt", {}, Budget(budget), lambda *_: None)
    first = done.improvements[0][0] if done.improvements else None
    print(json.dumps({"core": variant, "file": file, "verified": done.verified, "first": first,
                      "plan": done.timings["plan"], "duration": done.duration}), flush=True)
"""


def main() -> None:
    """Run both, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--robot", choices=("panda", "ur5", "fetch"), default="panda")
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--budget", type=float, default=10.0, help="seconds for each problem")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets(arguments.robot, Path(folder), arguments.every)
        files = [str(file) for group in sets.values() for file in group]
        rows = {kind: solve(kind, files, arguments.budget) for kind in ("", "none")}
    native, reference = rows[""], rows["none"]
    table = [line(native, native), line(reference, native)]
    print_table(HEADINGS, table)
    differ = [a["file"] for a, b in zip(native, reference, strict=True) if a["verified"] != b["verified"]]
    write_markdown(
        arguments.markdown, HEADINGS, table, [f"Verdicts differ on {len(differ)} of {len(native)} problems."]
    )
    print_json({"commit": commit(), "verdicts_differ": differ, "native": native, "reference": reference})


def solve(kind: str, files: list[str], budget: float) -> list[dict[str, Any]]:
    """Plan all problems in one process with this build of the core; the empty text is what the machine chooses."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"} | ({"OPTIPLAN_CORE": kind} if kind else {})
    command = [sys.executable, "-c", WORK, str(budget), *files]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return [json.loads(text) for text in done.stdout.splitlines() if text.startswith("{")]


def line(rows: list[dict[str, Any]], native: list[dict[str, Any]]) -> tuple[str, ...]:
    """A line of the table."""
    first, plan = (percentiles((row[key] for row in rows), 50, 95) for key in ("first", "plan"))
    base = [percentiles((row[key] for row in native), 50)[0] for key in ("first", "plan")]
    total = sum(row["duration"] for row in rows if row["verified"])
    return (
        rows[0]["core"],
        str(len(rows)),
        str(sum(row["verified"] for row in rows)),
        f"{first[0]:.2f} / {first[1]:.2f}",
        f"{plan[0]:.2f} / {plan[1]:.2f}",
        f"{total:.2f}",
        f"{first[0] / base[0]:.1f} / {plan[0] / base[1]:.1f}",
    )


if __name__ == "__main__":
    main()
