"""Planning with a tracking error: what a tube around the motion costs, and an outside check of every tube.

    python benchmarks/tracking_tube.py                             # thirteen problems, four sizes of tubes
    python benchmarks/tracking_tube.py --count 3 --budget 2        # a minute
    python benchmarks/tracking_tube.py --markdown tube.md

Each problem is planned with joints that may be off by 0, 0.002, 0.005 and 0.02 rad or m. In the table: s of planning and
proof until the first proved motion, and the duration of the last one beside that without a tube. The judge puts the
robot at random places of the motion, with random errors, half of them in the corners of the tube, and asks coal for
contacts of all pairs of bodies, those proved once for a robot too; position limits as well. The exit code is 1 where
anything touches or leaves its limits. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import sys
from typing import Any

import numpy as np
from published import print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.problem.task.timeline import scene_parts

PROBLEMS = (
    "01_reach",
    "02_shelf",
    "03_table",
    "04_box",
    "05_cage",
    "06_attached",
    "08_pose",
    "09_ur5",
    "11_baxter",
    "13_mesh",
    "15_srra",
    "16_delbot",
    "18_baxter_dual",
)
ERRORS = (0.0, 0.002, 0.005, 0.02)
LIMITS_ROUNDED = 2e-6  # rad or m, what the verifier lets a position limit be passed by


def main() -> None:
    """Plan, judge, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=len(PROBLEMS), help="only so many problems")
    parser.add_argument("--budget", type=float, default=5.0, help="seconds of planning")
    parser.add_argument("--samples", type=int, default=2000, help="configurations of each tube that are judged")
    options = parser.parse_args()
    found = {name: [judged(name, e, options) for e in ERRORS] for name in PROBLEMS[: options.count]}
    rows = [[name, *(cell(one, of_name[0]) for one in of_name)] for name, of_name in found.items()]
    rows.append(["solved", *(f"{sum(one['verified'] for one in column)} of {len(found)}" for column in columns(found))])
    rows.append(["longer, median", *(f"{longer(found, k):+.1%}" for k in range(len(ERRORS)))])
    headings = ("problem", *(f"{e:g} rad: first s, duration" for e in ERRORS))
    print_table(headings, rows)
    checked, false = (sum(one[key] for column in columns(found) for one in column) for key in ("checked", "false"))
    remark = f"Judged from outside: {checked:,} configurations of tubes, {false} that touch or leave their limits."
    print(remark, file=sys.stderr)
    if options.markdown:
        write_markdown(options.markdown, headings, rows, [remark])
    print_json({"problems": found, "checked": checked, "false": false})
    raise SystemExit(int(false > 0))


def columns(found: dict[str, list[dict[str, Any]]]) -> list[list[dict[str, Any]]]:
    """What was found for each error, of all problems."""
    return [[of_name[k] for of_name in found.values()] for k in range(len(ERRORS))]


def longer(found: dict[str, list[dict[str, Any]]], k: int) -> float:
    """Median share by which motions are longer than without a tube, of the problems solved with both."""
    both = [
        (one[0]["duration"], one[k]["duration"]) for one in found.values() if one[0]["verified"] and one[k]["verified"]
    ]
    return float(np.median([wide / plain - 1.0 for plain, wide in both])) if both else float("nan")


def cell(one: dict[str, Any], plain: dict[str, Any]) -> str:
    """First proved motion, duration and how much longer that is; or why there is none."""
    if not one["verified"]:
        return str(one["why"])
    share = f" ({one['duration'] / plain['duration'] - 1.0:+.1%})" if plain["verified"] and one["error"] else ""
    return f"{one['first']:.2f}, {one['duration']:.3f}{share}"


def judged(name: str, error: float, options: Any) -> dict[str, Any]:
    """Plan a problem with an error and judge its tube."""
    problem = op.load_problem(name)
    blank = {"error": error, "verified": False, "first": None, "duration": None, "checked": 0, "false": 0}
    try:
        run = op.plan(problem, budget=options.budget, tracking_error=error)
    except InputError as refused:
        return blank | {"why": "start at a limit" if "limit" in str(refused) else str(refused)}
    if not run.verified:
        why = run.failure.kind if run.failure else ", ".join(check.name for check in run.report.failures)
        print(f"{name}, {error:g}: {run!r}", file=sys.stderr, flush=True)
        return blank | {"why": why}
    false = outside(run, error, options.samples)
    print(f"{name}, {error:g}: {run.duration:.3f} s, {false} false", file=sys.stderr, flush=True)
    first = run.improvements[0][0]
    data = {"verified": True, "first": first, "duration": run.duration, "checked": options.samples, "false": false}
    return blank | data | {"why": ""}


def outside(run: op.Run, error: float, samples: int) -> int:
    """How many of so many random configurations of the tube touch or leave their limits."""
    rng, motion, limits = np.random.default_rng(0), run.trajectory, run.problem.limits
    false = 0
    for part in scene_parts(run.problem, motion):
        model = CollisionModel(part.problem.robot.with_proved_checked(), part.problem.scene)
        count = int(np.ceil(samples * (part.end - part.begin) / motion.duration))
        off = rng.uniform(-1.0, 1.0, (count, motion.n))
        off[::2] = np.sign(off[::2])
        for q in motion(rng.uniform(part.begin, part.end, count)) + error * off:
            beyond = (q < limits.lower - LIMITS_ROUNDED).any() or (q > limits.upper + LIMITS_ROUNDED).any()
            false += bool(beyond or model.collides(q))
    return false


if __name__ == "__main__":
    main()
