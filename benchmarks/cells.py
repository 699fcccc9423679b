"""Eight cells as an engineer writes them: lines of the file, the motion, and what it costs to plan and prove it.

    python benchmarks/cells.py                                    # a few minutes
    python benchmarks/cells.py --pages /tmp/cells --markdown /tmp/cells.md
    python benchmarks/publish.py cells /tmp/cells.md --readme docs/how-to/cells.md

Lines are those of the problem file, with its comments and scene. *Clearance* says whether the wished 5 mm are kept.
With `--pages` each cell's page is written there, as `optiplan view --export` does.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from pathlib import Path
from typing import Any

from published import finish, table_parser

import optiplan as op
from optiplan.viewer.page import render_page
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene

PROBLEMS = Path(__file__).parent.parent / "problems"
CELLS = {
    "bin picking": "57_bin_picking",
    "spot welding tour": "45_spot_tour",
    "glue line": "53_glue_line",
    "machine tending": "58_machine_tending",
    "two arms": "50_arms_sort",
    "conveyor": "56_conveyor_pick",
    "polishing": "54_polishing",
    "mobile base": "41_delbot_fetches",
}
HEADINGS = ("cell", "problem", "lines", "verified", "motion, s", "clearance", "planning, s", "proof, s")


def measured(name: str, budget: float, pages: Path | None) -> dict[str, Any]:
    """Plan one cell; write its page into the folder of pages, if there is one."""
    path = PROBLEMS / f"{name}.yaml"
    run = op.plan(op.load_problem(path), budget=budget)
    if pages is not None:
        pages.mkdir(parents=True, exist_ok=True)
        page = render_page(build_scene(run.problem, [ViewedRun.of(run)]))
        (pages / f"{name}.html").write_text(page, encoding="utf-8")
    return {
        "problem": name,
        "lines": len(path.read_text(encoding="utf-8").splitlines()),
        "verified": run.verified,
        "duration": None if run.trajectory is None else run.duration,
        "failure": None if run.failure is None else str(run.failure),
        "wish": run.info.get("wish"),
        "planning": run.timings["plan"] + run.timings.get("wish", 0.0),
        "proof": run.timings.get("verify"),
    }


def cells(cell: str, one: dict[str, Any]) -> list[str]:
    """Return the row of one cell."""
    wish = one["wish"]
    return [
        cell,
        one["problem"],
        str(one["lines"]),
        "yes" if one["verified"] else "no",
        "–" if one["duration"] is None else f"{one['duration']:.2f}",
        "–" if wish is None else f"{1e3 * wish['clearance']:g} mm" if wish["kept"] else "not kept",
        f"{one['planning']:.1f}",
        "–" if one["proof"] is None else f"{one['proof']:.1f}",
    ]


def main() -> None:
    """Plan all of them and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("cells", nargs="*", default=list(CELLS), help=f"which: {', '.join(CELLS)}")
    parser.add_argument("--budget", type=float, default=60.0, help="s, of each plan")
    parser.add_argument("--pages", type=Path, help="folder for the pages")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.cells if name not in CELLS]
    if unknown:
        parser.error(f"unknown cells {', '.join(unknown)}; expected some of {', '.join(CELLS)}")
    found = {name: measured(CELLS[name], arguments.budget, arguments.pages) for name in arguments.cells}
    rows = [cells(name, one) for name, one in found.items()]
    finish(arguments.markdown, HEADINGS, rows, {"budget": arguments.budget, "runs": found})


if __name__ == "__main__":
    main()
