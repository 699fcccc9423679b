"""Episodes by the thousand: a Panda at a table among a few bodies, every motion proved, as a LeRobot data set.

    python benchmarks/episodes.py /tmp/episodes --count 20000 --workers 1     # call it again to continue

A thousand problem files are drawn at a time, `--seed` and number give each its own: a table, one to four boxes or posts
on it, a start and a goal that are free and differ by 1 rad or more in some joint. Draws that the program refuses are
drawn anew. `op.plan_batch` plans them, with `--planner` and `--budget` a problem; the data set is written in the end.
The last line printed is one JSON object: episodes a second of processor time, of which counting what was there and
writing the data set take a part, and bytes on disk.
"""

import resource
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
from published import commit, print_json, print_table, table_parser, write_markdown
from rich.console import Console

import optiplan as op
from optiplan.problem.write import problem_text

A_FOLDER = 1000
"""Problem files in a folder."""

HEADINGS = ("episodes", "verified", "others", "processor s", "a second", "kB a row", "kB an episode of LeRobot")


def main() -> None:
    """Draw what is missing, plan what is missing, count."""
    parser = table_parser(__doc__)
    parser.add_argument("out", type=Path, help="folder for problems, rows and data set")
    parser.add_argument("--count", type=int, default=20_000, help="episodes")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    parser.add_argument("--planner", default="rrtconnect", help="of all problems")
    parser.add_argument("--budget", type=float, default=2.0, help="seconds for planning and proof of each")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    options = parser.parse_args()
    problems, batch = options.out / "problems", options.out / "batch"
    spent, began, new, kept = 0.0, time.perf_counter(), 0, None
    for count in [*range(A_FOLDER, options.count, A_FOLDER), options.count]:
        draw(problems, count, options.seed)
        before = processor_seconds()
        made = op.plan_batch(
            problems,
            batch,
            options.planner,
            budget=options.budget,
            lerobot=count == options.count,
            workers=options.workers,
            progress=Progress(time.perf_counter()),
        )
        spent += processor_seconds() - before
        new += made.made
        kept = made.kept if kept is None else kept
    total = sum(made.counts.values())
    verified = made.counts.get("verified", 0)
    rows, data = (bytes_in(batch / name) / 1e3 for name in ("episodes", "lerobot"))
    row = {
        "episodes": total,
        "counts": dict(made.counts),
        "made": new,
        "kept": kept,
        "processor s": spent,
        "wall s": time.perf_counter() - began,
        "a second": new / spent if spent > 0.0 else None,
        "kB a row": rows / max(total, 1),
        "kB an episode of LeRobot": data / max(verified, 1),
    }
    others = ", ".join(f"{count} {state}" for state, count in made.counts.items() if state != "verified") or "none"
    cells = [str(total), str(verified), others, f"{spent:.0f}", f"{row['a second'] or 0.0:.2f}"]
    cells += [f"{row['kB a row']:.1f}", f"{row['kB an episode of LeRobot']:.1f}"]
    print_table(HEADINGS, [cells])
    write_markdown(options.markdown, HEADINGS, [cells], [f"{kept} of them were there before this call."])
    print_json({"commit": commit(), **row})


class Progress:
    """Tells every 500 episodes how far it is."""

    def __init__(self, began: float) -> None:
        self.began, self.done = began, 0

    def __call__(self, stage: str, fraction: float) -> None:
        """Count one more episode."""
        self.done += 1
        if self.done % 500 == 0:
            seconds = time.perf_counter() - self.began
            Console(stderr=True).print(f"{self.done} episodes, {fraction:.1%}, {self.done / seconds:.2f} a second")


def processor_seconds() -> float:
    """Of this process and of those that it ended, s."""
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def bytes_in(folder: Path) -> int:
    """The sizes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def draw(folder: Path, count: int, seed: int) -> None:
    """Write the problem files that are missing."""
    robot = op.load_robot("panda")
    for k in range(count):
        path = folder / f"reach_{k // A_FOLDER:03d}" / f"{k:06d}.yaml"
        if path.exists():
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        rng = np.random.default_rng([seed, k])
        while not written(path, drawn(robot, rng)):
            pass


def written(path: Path, data: dict[str, Any]) -> bool:
    """Write a problem file; one that is refused is taken away again."""
    making = path.with_suffix(".making")
    making.write_text(problem_text(data))
    try:
        op.load_problem(making)
    except op.InputError:
        making.unlink()
        return False
    shutil.move(making, path)
    return True


def drawn(robot: op.Robot, rng: np.random.Generator) -> dict[str, Any]:
    """A problem as data: a table of 0.8 m × 1.2 m, bodies on it, two configurations."""
    bodies: list[dict[str, Any]] = [
        {"name": "table", "shape": {"box": [0.8, 1.2, 0.04]}, "pose": {"position": [0.55, 0.0, -0.02]}}
    ]
    for k in range(int(rng.integers(1, 5))):
        height = float(rng.uniform(0.1, 0.6))
        x, y = (float(v) for v in (rng.uniform(0.3, 0.85), rng.uniform(-0.5, 0.5)))
        if rng.random() < 0.5:
            shape: dict[str, Any] = {
                "box": [*(round(float(v), 3) for v in rng.uniform(0.04, 0.2, 2)), round(height, 3)]
            }
        else:
            shape = {"cylinder": {"radius": round(float(rng.uniform(0.02, 0.08)), 3), "length": round(height, 3)}}
        pose = {"position": [round(x, 3), round(y, 3), round(0.5 * height + 0.001, 4)]}
        bodies.append({"name": f"body_{k + 1}", "shape": shape, "pose": pose})
    lower, upper = robot.limits.lower, robot.limits.upper
    while True:
        ends = rng.uniform(lower + 0.1, upper - 0.1, (2, len(lower)))
        if np.abs(ends[1] - ends[0]).max() > 1.0:
            break
    start, goal = ([round(float(q), 4) for q in end] for end in ends)
    return {
        "version": 1,
        "robot": "panda",
        "start": {"joints": start},
        "goal": {"joints": goal},
        "scene": {"obstacles": bodies},
        "seed": int(rng.integers(2**31)),
    }


if __name__ == "__main__":
    main()
