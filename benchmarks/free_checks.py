"""Configurations a second that `problem.is_free` checks in one call, on one core.

    python benchmarks/free_checks.py                          # a minute
    python benchmarks/free_checks.py --markdown free-checks.md

Configurations are drawn evenly within the limits of position. *One by one* is `is_free` of single configurations.
*Agree* is the share of those for which both say the same. Processor time, the quickest of several calls. The last line
printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from published import commit, print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan.problem.free_space import FreeChecks

PROBLEMS = ("01_reach", "02_shelf", "03_table", "04_box", "05_cage", "06_attached", "09_ur5")
HEADINGS = ("problem", "robot", "bodies", "share free", "µs each", "million a second", "one by one, µs", "agree")


def main() -> None:
    """Check, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=100_000, help="configurations of a call")
    parser.add_argument("--singly", type=int, default=300, help="configurations checked one by one")
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    rows = [measured(name, options.count, options.singly, options.repeats) for name in PROBLEMS]
    table = [
        [
            row["problem"],
            row["robot"],
            f"{row['bodies']}",
            f"{row['free']:.2f}",
            f"{row['seconds'] * 1e6:.2f}",
            f"{1e-6 / row['seconds']:.2f}",
            f"{row['singly'] * 1e6:.0f}",
            f"{row['agree']:.3f}",
        ]
        for row in rows
    ]
    print_table(HEADINGS, table)
    write_markdown(options.markdown, HEADINGS, table, [f"{options.count} configurations a call."])
    print_json({"commit": commit(), "runs": rows})


def measured(name: str, count: int, singly: int, repeats: int) -> dict[str, Any]:
    """Seconds for each configuration of a problem, at once and one by one."""
    problem = op.load_problem(name)
    limits = problem.robot.limits
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    Q = np.random.default_rng(0).uniform(lower, upper, (count, problem.robot.n))
    found = problem.is_free(Q)
    assert isinstance(found, FreeChecks)
    seconds = min(spent(lambda: problem.is_free(Q)) for _ in range(repeats))
    each: list[bool] = []
    alone = spent(lambda: each.extend(bool(problem.is_free(q)) for q in Q[:singly]))
    return {
        "problem": problem.name,
        "robot": problem.robot.name,
        "bodies": problem.robot.geometry.ngeoms + len(problem.scene.obstacles),
        "free": float(np.mean(found.free)),
        "seconds": seconds / count,
        "singly": alone / singly,
        "agree": float(np.mean(found.free[:singly] == each)),
    }


def spent(work: Callable[[], object]) -> float:
    """Processor seconds of a call."""
    began = time.process_time()
    work()
    return time.process_time() - began


if __name__ == "__main__":
    main()
