"""Random events while runs are executed: limits, path, clearance and times, judged from the set-points alone.

    python benchmarks/execution_events.py                       # 1,000 events on each of ten runs, some minutes
    python benchmarks/execution_events.py --events 10010 --markdown execution.md     # 100,100 events, about an hour

Events at random ticks of 1 ms, each followed by ticks of 0.1 ms: a new override, pause, resume, reverse, a stop along
the path or of joints, an obstacle that moves, often into the way, and another motion that takes over. Every run is
executed again until its events are used up. The judge knows set-points, planned polynomials and where obstacles are:
positions on the path, velocity, acceleration, jerk by differences of the acceleration, torques by Pinocchio, distances
by coal while the robot moves. An obstacle counts from where it was put if a stop from there was possible at all. Times
are of the processor. The last line printed is JSON; the exit code is 1 where anything is violated.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import copy
import itertools
import sys
import time
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pinocchio as pin

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.problem.task.timeline import ScenePart, scene_parts

RUNS = (
    "01_reach",
    "09_ur5",
    "18_baxter_dual",
    "15_srra",
    "16_delbot",
    "22_via_spline",
    "40_panda_sorts_cubes",
    "41_delbot_fetches",
    "42_srra_tends_and_drills",
    "43_baxter_carries_a_tray",
)
EVENTS = ("override", "pause", "resume", "reverse", "stop", "joints", "obstacle", "splice")
DT, FINE_DT, FINE = 1e-3, 1e-4, 20  # s; ticks after an event are fine ones
RATE, RARELY = 0.02, 0.002  # events a tick; while another motion is to take over
LIMITS = ("position", "velocity", "acceleration", "jerk", "torque")
HEADINGS = (
    "run",
    "events",
    "splices",
    "off path",
    "waited",
    "ticks",
    "off the path, m",
    *LIMITS[1:],
    "least distance, mm",
    "violations",
    "answer 50 / 99 / 99.9 % ms",
    "stop of joints ms",
    "tick µs",
)
BEYOND = 2e-6  # share of a limit that the verifier and differences of 1 ms round
CLEARANCE, BALLS, RADIUS = 0.005, 2, 0.06  # m
TOUCH = 1e-6  # m; coal's own rounding
FAR = (0.0, 0.0, -30.0)  # m, where obstacles wait
JOINS = 6  # motions that take over, planned in advance


def happen(executor: op.Executor, event: str, rng: np.random.Generator) -> None:
    """Let one of the events that need nothing else happen."""
    match event:
        case "override":
            executor.override = rng.uniform()
        case "pause":
            executor.pause()
        case "resume":
            executor.resume()
        case "reverse":
            executor.reverse()
        case "stop":
            executor.stop()
        case "joints":
            executor.stop("test", "joints")


@dataclass
class Found:
    """What a run came to: m, and shares of the limits."""

    events: int = 0
    splices: int = 0
    detours: int = 0
    waited: int = 0
    ticks: int = 0
    off: float = 0.0
    nearest: float = np.inf
    shares: np.ndarray = field(default_factory=lambda: np.zeros(5))
    violations: list[str] = field(default_factory=list)
    answers: list[float] = field(default_factory=list)
    off_answers: list[float] = field(default_factory=list)
    tick_times: list[float] = field(default_factory=list)

    def note(self, words: str) -> None:
        """Remember a violation."""
        self.violations.append(words)


class Bodies:
    """How near an obstacle is to the robot, or without a name how near all is, at configurations in order."""

    def __init__(self, robot: op.Robot, scene: op.Scene, name: str = "") -> None:
        self._model, self._name = CollisionModel(robot, scene), name
        self._enough = 2.0 * CLEARANCE if name else 0.1 * CLEARANCE
        model = robot.model
        self._reach = 0.5 + sum(float(np.linalg.norm(M.translation)) for M in model.jointPlacements)
        self._spare, self._q = 0.0, np.full(robot.n, np.inf)

    def distance(self, q: np.ndarray) -> float:
        """Distance, m, or a lower bound on it that is enough: what the robot has travelled since is subtracted."""
        self._spare -= self._reach * float(np.abs(q - self._q).sum())
        self._q = q.copy()
        if not self._spare > self._enough:
            far = 60.0 * self._enough
            near = self._model.contacts(q, far)
            mine = [x.distance for x in near if not self._name or self._name in (x.pair.name_a, x.pair.name_b)]
            self._spare = min(mine, default=far)
        return self._spare


class Cell:
    """Where the obstacles are, as the judge knows it."""

    def __init__(self, run: op.Run) -> None:
        self.poses = dict.fromkeys((f"ball{k}" for k in range(BALLS)), FAR)
        self.counts = dict.fromkeys(self.poses, False)
        self._bodies: dict[str, Bodies] = {}
        self._robot = run.problem.robot
        grid = np.linspace(0.0, run.duration, 60)
        frame = run.problem.robot.model.frames[-1].name
        self._tool = [run.problem.robot.fk(q, frame).matrix[:3, 3] for q in run.trajectory(grid)]

    def move(self, executor: op.Executor, rng: np.random.Generator) -> dict[str, op.Pose]:
        """Put a ball into the way, beside it, or away, and return what is to be reported."""
        name = f"ball{rng.integers(BALLS)}"
        ahead = int(executor.status.progress * (len(self._tool) - 1))
        place = self._tool[rng.integers(ahead, len(self._tool))] + rng.uniform(-0.25, 0.25, 3)
        self.poses[name] = tuple(place) if rng.random() < 0.5 else FAR
        ball = op.Sphere(name, radius=RADIUS, position=self.poses[name])
        self._bodies[name] = Bodies(self._robot, op.Scene([ball]), name)
        self.counts[name] = self.poses[name] == FAR or self._can_stop(executor, name)
        return {name: op.Pose(self.poses[name])}

    def _can_stop(self, executor: op.Executor, name: str) -> bool:
        """Whether the robot would stay away from a ball if it stopped now."""
        twin = object.__new__(op.Executor)
        vars(twin).update(vars(executor))
        twin._predicted = copy.copy(executor._predicted)
        twin.stop()
        nearest, q = np.inf, twin.tick(0.0).q
        while True:
            nearest = min(nearest, self._bodies[name].distance(q))
            tick = twin.tick(DT)
            if np.array_equal(tick.q, q) or nearest < CLEARANCE:
                return nearest > CLEARANCE
            q = tick.q

    def nearest(self, q: np.ndarray) -> float:
        """The least distance, m, from the balls that count."""
        counted = (name for name, counts in self.counts.items() if counts and self.poses[name] != FAR)
        return min((self._bodies[name].distance(q) for name in counted), default=np.inf)


class Judge:
    """Looks at the ticks of one execution."""

    def __init__(self, found: Found, dts: list[float]) -> None:
        self._found, self._dts = found, dts
        self._ticks: list[op.Tick] = []
        self._runs: list[op.Run] = []

    def see(self, tick: op.Tick, run: op.Run) -> None:
        """Remember a tick."""
        self._ticks.append(tick)
        self._runs.append(run)

    def judge(self) -> None:
        """Compare all of it with limits and path."""
        found, limits = self._found, self._runs[0].problem.limits
        q, v, a = (np.array([getattr(tick, key) for tick in self._ticks]) for key in ("q", "v", "a"))
        jerk = np.vstack([np.zeros(q.shape[1]), np.diff(a, axis=0) / np.array(self._dts[1:])[:, None]])
        torque, beyond = np.zeros_like(q), np.maximum(q - limits.upper, limits.lower - q)
        for first, last in _stretches(self._runs):
            part = slice(first, last)
            self._on_path(q[part], part)
            torque[part] = _torques(self._runs[first], self._ticks[part], q[part], v[part], a[part])
        with np.errstate(invalid="ignore"):
            bounds = (limits.velocity, limits.acceleration, limits.jerk, limits.torque)
            rates = [np.abs(x / y).max(axis=1) for x, y in zip((v, a, jerk, torque), bounds, strict=True)]
        shares = np.array([1.0 + beyond.max(axis=1), *rates])
        found.shares = np.maximum(found.shares, shares.max(axis=1))
        for k, name in enumerate(LIMITS):
            for i in np.flatnonzero(shares[k] > 1.0 + BEYOND):
                found.note(f"{name} {shares[k, i]:.6f} at {self._ticks[i].t:.4f} s, {self._ticks[i].status}")

    def _on_path(self, q: np.ndarray, part: slice) -> None:
        run, ticks = self._runs[part.start], self._ticks[part]
        places = np.array([tick.status.place for tick in ticks])
        there = np.array([not tick.status.off_path for tick in ticks])
        away = np.abs(q - run.trajectory(np.clip(places, 0.0, run.duration))).sum(axis=1)[there]
        reach = 0.5 + sum(float(np.linalg.norm(M.translation)) for M in run.problem.robot.model.jointPlacements)
        off = float(away.max(initial=0.0)) * reach
        self._found.off = max(self._found.off, off)
        if off > 1e-9:
            self._found.note(f"{off:.1e} m off the path")


def _stretches(runs: list[op.Run]) -> list[tuple[int, int]]:
    """Begin and end of what each run gave."""
    edges = [0, *(k for k in range(1, len(runs)) if runs[k] is not runs[k - 1]), len(runs)]
    return list(itertools.pairwise(edges))


@cache
def _parts(run: op.Run) -> list[ScenePart]:
    return scene_parts(run.problem, run.trajectory)


def _torques(run: op.Run, ticks: list[op.Tick], q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    places, torque = np.array([tick.status.place for tick in ticks]), np.zeros_like(q)
    for part in _parts(run):
        model = part.problem.robot.model
        data = model.createData()
        for k in np.flatnonzero((places >= part.begin) & (places < part.end)):
            torque[k] = pin.rnea(model, data, q[k], v[k], a[k])[: q.shape[1]]
    return torque


def execute(run: op.Run, joins: list[tuple[float, op.Run]], events: int) -> Found:
    """Execute a run again and again until so many events happened."""
    rng, found = np.random.default_rng(1), Found()
    while found.events < events:
        once(run, joins, events, rng, found)
    return found


def once(run: op.Run, joins: list[tuple[float, op.Run]], events: int, rng: np.random.Generator, found: Found) -> None:
    """Execute a run to its end."""
    executor, dts, cell = op.Executor(run, clearance=CLEARANCE), list[float](), Cell(run)
    judge, fine, off, wanted, last = Judge(found, dts), 0, False, False, None
    own: dict[int, Bodies] = {}
    executor.update_scene({name: op.Pose(FAR) for name in cell.poses})  # it prepares the watch
    while executor.status.phase != "done":
        wanted = wanted and any(place > executor.status.place for place, _ in joins)
        if found.events < events and rng.random() < (RARELY if wanted else RATE):
            fine = FINE
            found.events += 1
            wanted |= _happen(executor, cell, rng, found)
        elif found.events == events or (executor.status.speed == 0.0 and rng.random() < 0.01):
            for name in cell.poses:
                cell.poses[name] = FAR
            executor.update_scene({name: op.Pose(FAR) for name in cell.poses})
            executor.override = 1.0
            executor.resume()
        second = _state_for(executor, joins) if wanted else None
        if second is not None:
            wanted, fine = False, FINE
            found.splices += executor.splice(second)
        dts.append(FINE_DT if fine > 0 else DT)
        fine -= 1
        began = time.thread_time()
        tick = executor.tick(dts[-1])
        found.tick_times.append(time.thread_time() - began)
        judge.see(tick, executor.run)
        found.detours += tick.status.off_path and not off
        off = tick.status.off_path
        found.waited += tick.status.phase == "waiting" and (last is None or last.status.phase != "waiting")
        if last is not None and not np.array_equal(tick.q, last.q):
            near = cell.nearest(tick.q)
            found.nearest = min(found.nearest, near)
            if off:
                near = min(near, _own(own, executor, tick).distance(tick.q))
            if near < -TOUCH or (near < TOUCH and not off):
                found.note(f"distance {near:.6f} m at {tick.t:.4f} s, {tick.status}")
        last = tick
    found.ticks += len(dts)
    judge.judge()


def _own(own: dict[int, Bodies], executor: op.Executor, tick: op.Tick) -> Bodies:
    """The robot beside itself and what stands, off the path."""
    parts = _parts(executor.run)
    k = next(k for k, part in enumerate(parts) if tick.status.place < part.end or k == len(parts) - 1)
    if (id(executor.run), k) not in own:
        own[id(executor.run), k] = Bodies(parts[k].problem.robot, parts[k].problem.scene)
    return own[id(executor.run), k]


def _happen(executor: op.Executor, cell: Cell, rng: np.random.Generator, found: Found) -> bool:
    """One event, with its time; return whether a splice is to follow."""
    event, seen = EVENTS[rng.integers(len(EVENTS))], dict[str, op.Pose]()
    if event == "obstacle":
        seen = cell.move(executor, rng)
    began = time.thread_time()
    if event == "obstacle":
        executor.update_scene(seen)
    elif event == "splice":  # as soon as it runs at full speed
        executor.override = 1.0
        executor.resume()
    else:
        happen(executor, event, rng)
    (found.off_answers if event == "joints" else found.answers).append(time.thread_time() - began)
    return event == "splice"


def _state_for(executor: op.Executor, joins: list[tuple[float, op.Run]]) -> op.Run | None:
    """Return the next motion that can take over, if there is one."""
    status = executor.status
    ahead = [(place, run) for place, run in joins if 0.0 < place - status.place < 0.3]
    if status.phase != "running" or status.speed != 1.0 or not ahead:
        return None
    executor.state_in(ahead[0][0] - status.place)
    return ahead[0][1]


def prepared(name: str, budget: float) -> tuple[op.Run, list[tuple[float, op.Run]]]:
    """Plan a shipped problem with balls far away, and motions that take over on its way."""
    problem = op.load_problem(name)
    balls = [op.Sphere(f"ball{k}", radius=RADIUS, position=FAR) for k in range(BALLS)]
    problem = problem.with_scene(problem.scene.with_(*balls))
    run = op.plan(problem, budget=budget)
    if not run.verified:
        raise SystemExit(f"{name}: {run!r}")
    joins = []
    for place in np.linspace(0.1, 0.8, JOINS) * run.duration if not problem.task else ():
        state = op.State(*(run.trajectory(float(place), order) for order in range(3)))
        second = op.plan(problem.with_start(state), budget=2.0)
        if second.verified:
            joins.append((float(place), second))
    return run, joins


def main() -> None:
    """Execute, judge, print."""
    from published import finish, percentiles, table_parser  # here, for tests import this file

    parser = table_parser(__doc__)
    parser.add_argument("--events", type=int, default=1000, help="on each run")
    parser.add_argument("--runs", nargs="+", default=list(RUNS), help="names of shipped problems")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds of planning")
    options = parser.parse_args()
    rows, data = [], {}
    for name in options.runs:
        began = time.monotonic()
        found = execute(*prepared(name, options.budget), options.events)
        times = (found.answers, found.off_answers, found.tick_times)
        answer, stop, tick = (np.array(percentiles(one, 50, 99, 99.9)) for one in times)
        counts = (found.events, found.splices, found.detours, found.waited, found.ticks)
        rows.append(
            [
                name,
                *(f"{count}" for count in counts),
                f"{found.off:.1e}",
                *(f"{share:.6f}" for share in found.shares[1:]),
                f"{1e3 * found.nearest:.1f}",
                f"{len(found.violations)}",
                *(" / ".join(f"{1e3 * x:.2f}" for x in one) for one in (answer, stop)),
                " / ".join(f"{1e6 * x:.0f}" for x in tick),
            ]
        )
        data[name] = {
            "events": found.events,
            "violations": found.violations[:20],
            "off": found.off,
            "shares": found.shares.tolist(),
            "nearest": found.nearest,
            "answer_ms": (1e3 * answer).tolist(),
            "stop_of_joints_ms": (1e3 * stop).tolist(),
            "tick_us": (1e6 * tick).tolist(),
        }
        print(
            f"{name}: {found.events} events, {len(found.violations)} violations, {time.monotonic() - began:.0f} s",
            flush=True,
        )
        for words in found.violations[:5]:
            print(f"    {words}", flush=True)
    finish(options.markdown, HEADINGS, rows, data)
    sys.exit(any(one["violations"] for one in data.values()))


if __name__ == "__main__":
    main()
