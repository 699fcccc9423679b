"""Chunks of set-points through `op.certify`: time by outcome, and agreement with `op.verify`.

    python benchmarks/certify_chunks.py                          # 400 chunks a row, every 4th judged
    python benchmarks/certify_chunks.py --count 2000 --judge 2 --markdown chunks.md
    python benchmarks/certify_chunks.py --robots baxter srra ur3 --sizes 50 --count 100 --judge 1

Each robot stands among 20 boxes. A chunk is a smooth random motion at 50 Hz from a random free state, at rest or in
motion; every second one has noise of 1 mrad on its set-points, as policies have. The judge is `op.verify`: a motion
that was sent and that it refuses is a false proof. Where a chunk is not proved as it is, the judge looks at that
motion, too: one that it accepts was refused without need. Times are of the processor. The last line printed is JSON;
the exit code is 1 after a false proof.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import sys
import time
from collections import defaultdict

import numpy as np
from published import percentiles, print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan._core import core
from optiplan.problem.goals_and_vias import JointGoal
from optiplan.problem.problem import derived

RATE, NOISE = 50.0, 1e-3  # Hz; rad or m
HEADINGS = ("robot, set-points", "chunks", "proved", "nearest", "stopped", "refused", "proved ms", "nearest ms")
HEADINGS = (*HEADINGS, "stopped ms", "false proofs", "refused without need", "change, mrad")


def main() -> None:
    """Certify, judge, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=400, help="chunks of each row")
    parser.add_argument("--judge", type=int, default=4, help="judge every so many")
    parser.add_argument("--robots", nargs="+", default=["panda", "ur5"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[10, 25, 50])
    parser.add_argument("--untimed", action="store_true", help="give no times")
    options = parser.parse_args()
    rows, data, wrong = [], {}, 0
    for robot in options.robots:
        problem = cell(robot, np.random.default_rng(0))
        for size in options.sizes:
            found = row(problem, size, options.count, options.judge, options.untimed)
            wrong += found["false"]
            data[f"{robot} {size}"] = found
            rows.append(cells(f"{robot}, {size}", found))
            print(f"{robot}, {size}: {found['false']} false proofs of {found['judged']}", file=sys.stderr, flush=True)
    print_table(HEADINGS, rows)
    remark = "Times: median and 99th percentile, ms. Change: median of the largest change of a nearest chunk."
    write_markdown(options.markdown, HEADINGS, rows, [remark])
    print_json(data)
    sys.exit(1 if wrong else 0)


def cell(name: str, rng: np.random.Generator) -> op.Problem:
    """A robot among 20 boxes that leave its home free."""
    robot = op.load_robot(name)
    home = next(iter(robot.configurations))
    problem, boxes = op.Problem(robot, home, home), []
    while len(boxes) < 20:
        box = op.Box(
            f"box{len(boxes)}", size=rng.uniform(0.04, 0.15, 3), position=rng.uniform([-0.8, -0.8, 0], [0.8, 0.8, 1.1])
        )
        try:
            problem = problem.with_scene([*boxes, box])
        except op.InputError:
            continue
        boxes.append(box)
    return problem


def chunk(
    problem: op.Problem, size: int, noisy: bool, rng: np.random.Generator
) -> tuple[op.State, np.ndarray, np.ndarray]:
    """A state, set-points (size, n) and their times."""
    n, limits = problem.robot.n, problem.limits
    t = np.arange(1, size + 1) / RATE
    frequency, phase = rng.uniform(0.5, 4.0, (2, n)), rng.uniform(0.0, 6.3, (2, n))
    if rng.random() < 0.5:
        phase[:] = 0.0  # 1 - cos: from rest
    amplitude = rng.uniform(-0.15, 0.15, (2, n)) * np.minimum(limits.velocity, 2.0)

    def wave(t: np.ndarray, order: int) -> np.ndarray:
        angle = frequency * t[:, None, None] + phase + order * np.pi / 2
        return (amplitude * frequency**order * -np.cos(angle)).sum(axis=1)

    first = np.zeros(1)
    while True:
        q = problem.start + rng.normal(0.0, 0.3, n)
        if (q > limits.lower).all() and (q < limits.upper).all() and problem.is_free(q):
            break
    Q = q + wave(t, 0) - wave(first, 0) + (rng.normal(0.0, NOISE, (size, n)) if noisy else 0.0)
    return op.State(q, wave(first, 1)[0], wave(first, 2)[0]), Q, t


def row(problem: op.Problem, size: int, count: int, judge: int, untimed: bool) -> dict:
    """Certify so many chunks."""
    rng, seconds, change = np.random.default_rng(size), defaultdict(list), []
    judged = false = needless = plain = 0
    first = chunk(problem, size, False, rng)
    op.certify(problem, first[1], first[2], start=first[0])  # prepares
    for k in range(count):
        state, Q, t = chunk(problem, size, k % 2 == 1, rng)
        times = None if untimed else t
        began = time.thread_time()
        found = op.certify(problem, Q, times, start=state)
        seconds[found.outcome].append(1e3 * (time.thread_time() - began))
        if found.outcome == "nearest":
            change.append(1e3 * found.max_change)
        if k % judge:
            continue
        judged += 1
        if found.is_proved and not op.verify(found.problem, found.trajectory).verified:
            false += 1
            print(f"false: {found!r} {op.verify(found.problem, found.trajectory)!r}", file=sys.stderr, flush=True)
        plain += found.outcome == "proved"
        if found.outcome != "proved" and not untimed:
            accepted = accepts(problem, state, Q, t)
            needless += accepted
            plain += accepted
    return {
        "chunks": count,
        "judged": judged,
        "false": false,
        "needless": needless,
        "accepted": plain,
        "outcomes": {name: len(each) for name, each in seconds.items()},
        "ms": {name: percentiles(each, 50, 99) for name, each in seconds.items()},
        "change": percentiles(change, 50)[0],
    }


def accepts(problem: op.Problem, state: op.State, Q: np.ndarray, t: np.ndarray) -> bool:
    """Whether the verifier accepts the chunk as it is."""
    limits = problem.limits
    rows = np.array([limits.lower, limits.upper, *limits.rates])
    b, c = core.chunk_curve(np.array([state.q, state.v, state.a]), np.ascontiguousarray(Q), t, False, rows)
    motion = op.Trajectory(problem.robot.joint_names, b, c)
    start = {"start": state.q, "start_velocity": state.v, "start_acceleration": state.a}
    return op.verify(derived(problem, **start, goal=(JointGoal(motion.end),)), motion).verified


def cells(name: str, found: dict) -> list[str]:
    """A row of the table."""
    outcomes, ms = found["outcomes"], found["ms"]
    shares = [
        f"{100 * outcomes.get(one, 0) / found['chunks']:.0f} %" for one in ("proved", "nearest", "stopped", "refused")
    ]
    times = [" / ".join(f"{x:.2f}" for x in ms[one]) if one in ms else "–" for one in ("proved", "nearest", "stopped")]
    judged = f"{found['false']} of {found['judged']}", f"{found['needless']} of {found['accepted']}"
    return [name, f"{found['chunks']}", *shares, *times, *judged, f"{found['change']:.2g}"]


if __name__ == "__main__":
    main()
