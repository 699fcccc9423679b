"""Changes of speed on the way: `op.Executor` beside ros2_control's speed scaling, and pink and mink with a spline.

    python benchmarks/execution_rivals.py --python /path/to/venv/bin/python       # some minutes
    python benchmarks/execution_rivals.py --changes 3 --runs 01_reach

All execute the same verified motions at 1 kHz, and are asked for the same speeds at the same random times: to a share
of the planned speed, or a stop, and after half a second back to full speed.

- `ros2_control`: the law of its joint_trajectory_controller with on-controller scaling (doc/speed_scaling.rst): each
  cycle advances the trajectory's time by factor times cycle time, from the cycle in which the factor comes.
- `pink`, `mink`: the poses of the tool at s(t), whose speed goes from one to the next by a cubic spline of 0.2 s; see
  `benchmarks/peers/followers.py`. They run in their own environment, whose interpreter is `--python`.

The judge knows the positions at each ms alone: velocity, acceleration and jerk are their differences, torques are
Pinocchio's. *off the path* is the tool's distance from the planned tool path, *stop* is how long and how far the tool
still goes after a stop is asked for, in the median. The last line printed is JSON; the exit code is 1 where the
executor exceeds a limit or leaves its path.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from published import finish, table_parser

import optiplan as op
from optiplan.robot.batched.dynamics import inverse_dynamics

RUNS = ("01_reach", "02_shelf", "22_via_spline")
DT, RAMP, HELD = 1e-3, 0.2, 0.5  # s; of the spline between two speeds, and before full speed again
FACTORS = (0.0, 0.3, 0.6)
STILL = 1e-3  # rad/s: a robot that is no faster stands still
FOLLOWERS = Path(__file__).parent / "peers" / "followers.py"
HEADINGS = (
    "run",
    "by",
    "changes",
    "velocity",
    "acceleration",
    "jerk",
    "torque",
    "off the path, mm",
    "stop, s",
    "stop, mm",
    "tick 50 / 99 % µs",
)


class Change(NamedTuple):
    """At `at`, s, the speed is to become `factor` of the planned one."""

    at: float
    factor: float


class Followed(NamedTuple):
    """Positions (k, n) at each ms, rad, and the time that each took, s."""

    q: np.ndarray
    seconds: np.ndarray


def by_executor(run: op.Run, change: Change) -> Followed:
    """Ours."""
    executor, q, seconds = op.Executor(run), [run.trajectory.start], [0.0]
    while executor.status.phase != "done":
        if abs(executor.time - change.at) < 0.5 * DT:
            executor.override = change.factor
        elif abs(executor.time - change.at - HELD) < 0.5 * DT:
            executor.override = 1.0
        began = time.thread_time()
        q.append(executor.tick(DT).q)
        seconds.append(time.thread_time() - began)
    return Followed(np.array(q), np.array(seconds[1:]))


def by_ros2_control(run: op.Run, change: Change) -> Followed:
    """The trajectory's time advances by the factor times the cycle time."""
    s, q, seconds = 0.0, [run.trajectory.start], [0.0]
    for k in range(round(1e5)):
        held = change.at - 0.5 * DT < k * DT < change.at + HELD - 0.5 * DT
        s = min(s + DT * (change.factor if held else 1.0), run.duration)
        began = time.thread_time()
        q.append(run.trajectory(s))
        seconds.append(time.thread_time() - began)
        if s >= run.duration:
            break
    return Followed(np.array(q), np.array(seconds[1:]))


def spline(run: op.Run, change: Change) -> np.ndarray:
    """Return s(t) at each ms, whose speed changes by cubic splines."""
    t = DT * np.arange(round((run.duration + 2.0 * HELD) / DT) + 1000)

    def ramp(begin: float) -> np.ndarray:
        x = np.clip((t - begin) / RAMP, 0.0, 1.0)
        return x * x * (3.0 - 2.0 * x)

    speed = 1.0 + (change.factor - 1.0) * (ramp(change.at) - ramp(change.at + HELD))
    s = np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])
    end = int(np.searchsorted(s, run.duration)) + round(0.3 / DT)
    return np.minimum(s[:end], run.duration)


def by_peer(run: op.Run, change: Change, library: str, python: str) -> Followed:
    """Pink or mink, in its own environment."""
    robot, limits = run.problem.robot, run.problem.limits
    q = run.trajectory(spline(run, change))
    asked = {
        "library": library,
        "urdf": robot.urdf,
        "joints": list(robot.joint_names),
        "locked": dict(robot.locked),
        "frame": robot.tool_frame,
        "dt": DT,
        "postures": q.tolist(),
        "poses": [robot.fk(one).matrix.tolist() for one in q],
        **{name: getattr(limits, name).tolist() for name in ("lower", "upper", "velocity")},
    }
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [python, str(FOLLOWERS)], input=json.dumps(asked), capture_output=True, text=True, env=environment, check=False
    )
    if done.returncode != 0:
        raise SystemExit(f"{library}: {done.stderr[-1000:]}")
    answer = json.loads(done.stdout.strip().splitlines()[-1])
    return Followed(np.array(answer["q"]), np.array(answer["seconds"][1:]))


class Judged:
    """What one controller comes to on one run."""

    def __init__(self, run: op.Run) -> None:
        self._run = run
        self._grid = self._tool(run.trajectory(np.linspace(0.0, run.duration, 4000)))
        self.shares, self.off, self.changes = np.zeros(4), 0.0, 0
        self.stops: list[tuple[float, float]] = []
        self.seconds: list[np.ndarray] = []

    def see(self, found: Followed, change: Change) -> None:
        """Judge the positions after one change."""
        limits, robot = self._run.problem.limits, self._run.problem.robot
        q = np.vstack([np.repeat(found.q[:1], 3, axis=0), found.q, np.repeat(found.q[-1:], 3, axis=0)])
        v, a, jerk = (np.diff(q, n, axis=0) / DT**n for n in (1, 2, 3))
        torque = inverse_dynamics(robot, q[1:-1], 0.5 * (v[1:] + v[:-1]), a)
        bounds = (limits.velocity, limits.acceleration, limits.jerk, limits.torque)
        with np.errstate(invalid="ignore"):
            shares = [np.nanmax(np.abs(x / y)) for x, y in zip((v, a, jerk, torque), bounds, strict=True)]
        self.shares = np.maximum(self.shares, shares)
        tool = self._tool(found.q)
        self.off = max(self.off, float(self._distances(tool).max()))
        self.seconds.append(found.seconds)
        self.changes += 1
        first = round(change.at / DT)
        if change.factor == 0.0:
            moves = np.abs(np.diff(found.q[first:], axis=0)).max(axis=1) > STILL * DT
            rest = int(np.argmin(moves)) if not moves.all() else len(moves)
            way = np.linalg.norm(np.diff(tool[first : first + rest + 1], axis=0), axis=1).sum()
            self.stops.append((rest * DT, float(way)))

    def _tool(self, Q: np.ndarray) -> np.ndarray:
        return np.array([self._run.problem.robot.fk(q).matrix[:3, 3] for q in Q])

    def _distances(self, tool: np.ndarray) -> np.ndarray:
        """Distances (k,) from the planned tool path, m: to the segments between its grid's points."""
        a, b = self._grid[:-1], self._grid[1:]
        found = np.empty(len(tool))
        for k, p in enumerate(tool):
            d = b - a
            x = np.clip(((p - a) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-30), 0.0, 1.0)
            found[k] = np.linalg.norm(a + x[:, None] * d - p, axis=1).min()
        return found

    def row(self, name: str, by: str) -> list[str]:
        """Return the row of the table."""
        ticks = np.concatenate(self.seconds)
        stops = [f"{np.median(x):.3f}" for x in np.array(self.stops).T] if self.stops else ["", ""]
        way = f"{1e3 * np.median(np.array(self.stops)[:, 1]):.1f}" if self.stops else ""
        return [
            name,
            by,
            f"{self.changes}",
            *(f"{share:.3f}" for share in self.shares),
            f"{1e3 * self.off:.4f}",
            stops[0],
            way,
            " / ".join(f"{1e6 * x:.0f}" for x in np.percentile(ticks, [50, 99])),
        ]


def main() -> None:
    """Execute, judge, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--changes", type=int, default=9, help="on each run")
    parser.add_argument("--runs", nargs="+", default=list(RUNS), help="names of shipped problems of the Panda")
    parser.add_argument("--python", default="", help="interpreter of the environment of pink and mink; none: without")
    options = parser.parse_args()
    ways = {"optiplan": by_executor, "ros2_control": by_ros2_control}
    for library in ("pink", "mink") if options.python else ():
        ways[library] = lambda run, change, library=library: by_peer(run, change, library, options.python)
    rows, data, broken = [], {}, False
    for name in options.runs:
        run, rng = op.plan(op.load_problem(name), budget=5.0), np.random.default_rng(1)
        changes = [
            Change(DT * round(rng.uniform(0.1, 0.75) * run.duration / DT), FACTORS[k % len(FACTORS)])
            for k in range(options.changes)
        ]
        for by, way in ways.items():
            judged = Judged(run)
            for change in changes:
                judged.see(way(run, change), change)
            rows.append(judged.row(name, by))
            data[f"{name}, {by}"] = {"shares": judged.shares.tolist(), "off": judged.off, "stops": judged.stops}
            broken |= by == "optiplan" and ((judged.shares > 1.0 + 2e-6).any() or judged.off > 1e-6)
            print(f"{name}, {by}: {judged.changes} changes", flush=True)
    finish(options.markdown, HEADINGS, rows, data)
    sys.exit(broken)


if __name__ == "__main__":
    main()
