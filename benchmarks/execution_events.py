"""Random events while runs are executed: limits, path and times, judged from the set-points alone.

    python benchmarks/execution_events.py                       # 1,000 events on each of six runs
    python benchmarks/execution_events.py --events 17000 --markdown execution.md

Events: a new override, pause, resume, reverse, stop, at random ticks of 1 ms; every run is executed again until its
events are used up. The judge knows the set-points and the planned polynomials: positions on the path, velocity,
acceleration, jerk by differences of the acceleration, and torques by Pinocchio. Times are of the processor.
The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from published import print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan.problem.task.timeline import scene_parts

RUNS = ("01_reach", "09_ur5", "18_baxter_dual", "15_srra", "16_delbot", "22_via_spline", "40_panda_sorts_cubes")
DT, RATE = 1e-3, 0.02  # s; events a tick
LIMITS = ("velocity", "acceleration", "jerk", "torque")
HEADINGS = ("run", "events", "ticks", "off the path", *LIMITS, "violations", "answer 50 / 99 / 99.9 % ms", "tick µs")
BEYOND = 2e-6  # share of a limit that the verifier and differences of 1 ms round


class Judged(NamedTuple):
    """What one run came to: rad or m, and shares of the limits."""

    events: int
    ticks: int
    off: float
    shares: tuple[float, ...]
    violations: int
    answers: list[float]
    tick_times: list[float]


def main() -> None:
    """Execute, judge, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--events", type=int, default=1000, help="on each run")
    parser.add_argument("--runs", nargs="+", default=list(RUNS), help="names of shipped problems")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds of planning")
    options = parser.parse_args()
    rows, data = [], {}
    for name in options.runs:
        run = op.plan(op.load_problem(name), budget=options.budget)
        if not run.verified:
            raise SystemExit(f"{name}: {run!r}")
        found = judged(run, options.events)
        answer, tick = (np.percentile(times, [50, 99, 99.9]) for times in (found.answers, found.tick_times))
        rows.append(
            [
                name,
                f"{found.events}",
                f"{found.ticks}",
                f"{found.off:.1e}",
                *(f"{share:.6f}" for share in found.shares),
                f"{found.violations}",
                " / ".join(f"{1e3 * x:.2f}" for x in answer),
                " / ".join(f"{1e6 * x:.0f}" for x in tick),
            ]
        )
        data[name] = {"events": found.events, "violations": found.violations, "off": found.off, "shares": found.shares}
        print(f"{name}: {found.events} events, {found.violations} violations", flush=True)
    print_table(HEADINGS, rows)
    if options.markdown:
        write_markdown(options.markdown, HEADINGS, rows)
    print_json(data)


def judged(run: op.Run, events: int) -> Judged:
    """Execute a run again and again until so many events happened."""
    rng = np.random.default_rng(1)
    answers, tick_times, done, ticks, violations = [], [], 0, 0, 0
    off, shares = 0.0, np.zeros(4)
    while done < events:
        executor, path = op.Executor(run), []
        while executor.status.phase != "done":
            if done < events and rng.random() < RATE:
                began = time.thread_time()
                happen(executor, rng)
                answers.append(time.thread_time() - began)
                done += 1
            elif done == events or (executor.status.speed == 0.0 and rng.random() < 0.01):
                executor.override = 1.0
                executor.resume()
            began = time.thread_time()
            path.append(executor.tick(DT))
            tick_times.append(time.thread_time() - began)
        ticks += len(path)
        found, away = judge(run, path)
        shares, off = np.maximum(shares, found.max(axis=0)), max(off, away)
        violations += int((found > 1.0 + BEYOND).any(axis=1).sum()) + (away > 1e-9)
    return Judged(done, ticks, off, tuple(float(x) for x in shares), violations, answers, tick_times)


def happen(executor: op.Executor, rng: np.random.Generator) -> None:
    """One event."""
    match rng.integers(5):
        case 0:
            executor.override = rng.uniform()
        case 1:
            executor.pause()
        case 2:
            executor.resume()
        case 3:
            executor.reverse()
        case 4:
            executor.stop()


def judge(run: op.Run, path: list[op.Tick]) -> tuple[np.ndarray, float]:
    """Shares of the limits at every tick, (k, 4), and the largest distance from the path, rad or m."""
    limits = run.problem.limits
    q, v, a = (np.array([getattr(tick, key) for tick in path]) for key in ("q", "v", "a"))
    places = np.array([tick.status.place for tick in path])
    off = float(np.abs(q - run.trajectory(np.clip(places, 0.0, run.duration))).max())
    jerk = np.vstack([np.zeros(q.shape[1]), np.diff(a, axis=0) / DT])
    torque = np.zeros_like(q)
    for part in scene_parts(run.problem, run.trajectory):
        model = part.problem.robot.model
        data = model.createData()
        for k in np.flatnonzero((places >= part.begin) & (places < part.end)):
            torque[k] = pin.rnea(model, data, q[k], v[k], a[k])[: q.shape[1]]
    with np.errstate(invalid="ignore"):
        bounds = (limits.velocity, limits.acceleration, limits.jerk, limits.torque)
        return np.array([np.abs(x / y).max(axis=1) for x, y in zip((v, a, jerk, torque), bounds, strict=True)]).T, off


if __name__ == "__main__":
    main()
