"""Measure how cost grows with joints, obstacles, triangles, spans and samples; each point has a process of its own.

    python benchmarks/scaling.py                                  # all curves, a few minutes
    python benchmarks/scaling.py --curves obstacles --markdown scaling.md --picture scaling.png

*Joints*: a chain of boxes among which nothing stands. *Obstacles*: the Panda among small boxes. *Triangles*: of the
meshes among which it goes. *Spans* and *samples*: of the curve that `trajopt` optimises, on the shelf example, with
one round of attempts. Samples are the first instants checked for contacts. *Load* is the second
load of the file in the process, *first* the first verified answer, *proof* one call of the verifier, *memory* the
largest resident memory of the process. Load, plan and proof are processor time. The last line printed is one JSON
object.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from published import ROOT, commit, print_json, print_table, table_parser, write_markdown
from scale import triangles, write_chain, write_obstacles, write_triangles

CURVES = {
    "joints": (6, 12, 24, 48),
    "obstacles": (10, 100, 1000, 5000),
    "triangles": (300, 5_000, 80_000, 320_000),
    "spans": (12, 24, 48, 96),
    "samples": (32, 64, 128, 256, 512),
}
HEADINGS = ("curve", "value", "load s", "first s", "plan s", "proof ms", "verified", "memory MB")
WORK = """
import json, resource, sys, time
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run
from optiplan.verify.verify import verify
file, budget, options = sys.argv[1], float(sys.argv[2]), json.loads(sys.argv[3])
load_problem(file)
began = time.process_time(); problem = load_problem(file); load = time.process_time() - began
run(problem, "trajopt", options, Budget(min(budget, 1.0)), lambda *_: None)
done = run(problem, "trajopt", options, Budget(budget), lambda *_: None)
began = time.process_time()
if done.trajectory is not None:
    verify(problem, done.trajectory)
proof = time.process_time() - began
print(json.dumps({"load": load, "first": done.improvements[0][0] if done.improvements else None,
    "plan": done.plan_cpu, "proof": proof, "verified": done.verified,
    "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}))
"""


def main() -> None:
    """Measure, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--curves", nargs="*", choices=list(CURVES), default=list(CURVES))
    parser.add_argument("--budget", type=float, default=10.0, help="seconds for each problem")
    parser.add_argument("--picture", type=Path, help="draw the curves into this file")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for curve in arguments.curves:
            for value in CURVES[curve]:
                rows.append({"curve": curve, "value": value} | solve(curve, value, Path(folder), arguments.budget))
    table = [line(row) for row in rows]
    print_table(HEADINGS, table)
    write_markdown(arguments.markdown, HEADINGS, table)
    if arguments.picture is not None:
        draw(rows, arguments.picture)
    print_json({"commit": commit(), "rows": rows})


def solve(curve: str, value: int, folder: Path, budget: float) -> dict[str, Any]:
    """One point of a curve."""
    options: dict[str, int] = {}
    exact = {}
    if curve == "joints":
        file = write_chain(folder, value)
    elif curve == "obstacles":
        file = write_obstacles(folder, value)
    elif curve == "triangles":
        file = write_triangles(folder, value)
        exact = {"value": triangles(folder)}
    else:
        file, options = ROOT / "problems" / "02_shelf.yaml", {curve: value, "seeds": 1}
    command = [sys.executable, "-c", WORK, str(file), str(budget), json.dumps(options)]
    done = subprocess.run(
        command, env={**os.environ, "OMP_NUM_THREADS": "1"}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        return {**exact, "failed": done.stderr.strip().splitlines()[-1]}
    return {**exact, **json.loads(done.stdout.splitlines()[-1])}


def line(row: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table."""
    head = row["curve"], str(row["value"])
    if "failed" in row:
        return (*head, *["–"] * 4, row["failed"], "–")
    first = "–" if row["first"] is None else f"{row['first']:.3f}"
    shown = f"{row['load']:.3f}", first, f"{row['plan']:.2f}", f"{1e3 * row['proof']:.0f}"
    return (*head, *shown, "yes" if row["verified"] else "no", f"{row['memory']:.0f}")


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """A panel a curve: seconds against the value, both logarithmic."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    names = list(dict.fromkeys(row["curve"] for row in rows))
    columns = min(3, len(names))
    lines = -(-len(names) // columns)
    figure = Figure(figsize=(3.4 * columns, 2.8 * lines + 0.3), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for ax in axes[len(names) :]:
        ax.axis("off")
    for ax, name in zip(axes, names, strict=False):
        some = [row for row in rows if row["curve"] == name and "failed" not in row]
        for key in ("load", "first", "plan", "proof"):
            own = [(row["value"], row[key]) for row in some if row[key]]
            ax.plot(*zip(*own, strict=True), marker="o", markersize=4, label=key) if own else None
        ax.set(xscale="log", yscale="log", xlabel=name, ylabel="s")
        values = [row["value"] for row in some]
        ax.set_xticks(values, [f"{value:,}" for value in values])
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    figure.savefig(path)


if __name__ == "__main__":
    main()
