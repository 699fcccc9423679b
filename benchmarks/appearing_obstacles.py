"""Obstacles that appear while a run is executed: hits, goals reached, time lost, and the time to a new motion.

    python benchmarks/appearing_obstacles.py                    # 100 cases on each of two robots
    python benchmarks/appearing_obstacles.py --count 500 --markdown appearing.md
    python benchmarks/appearing_obstacles.py --count 20 --robots panda --clock wall

A sphere or a box appears during a random motion, and flies at 0.3 or 1 m/s towards where a link will be on the way. The
executor sees it every 20 ms. Each case is run with every policy, and once with a stop in the moment in which the
obstacle appears. The judge moves coal's bodies by Pinocchio at every tick of 1 ms, with bounds on the speeds of both in
between, until the obstacle has gone. A case counts as avoidable where that stop is not hit, then or at rest; "by the
ball" where no obstacle of that speed could have met the robot before it stood still, whatever its course.
With `--clock processor`, a plan is there after the processor time that it took; with `wall`, ticks come in real time.
The exit code is 1 where the policy `replan` is hit in an avoidable case. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from published import print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan.execution.scene import planning_process
from optiplan.geometry.shapes import build_geometry

ROBOTS = {"panda": "01_reach", "ur5": "09_ur5"}
BUDGET_AT_REST = planning_process.BUDGET_AT_REST  # s, budget of planning
DT, PERIOD, GONE = 1e-3, 20, 5.0  # s; ticks between two updates; s after which the obstacle is gone
FASTEST_LINK = 1.5  # m; no point of these robots is farther from an axis
HEADINGS = (
    "robot",
    "m/s",
    "policy",
    "cases",
    "avoidable (by the ball)",
    "hits: avoidable",
    "others",
    "goal reached",
    "time lost s: median / 90 %",
    "new motion ms: 50 / 90 / 99 %",
    "update ms: 50 / 99 %",
    "tick µs: 50 / 99 %",
)


@dataclass
class Case:
    """One obstacle in one motion: appears at `at`, s, at `position`, m, with `velocity`, m/s."""

    run: op.Run
    at: float
    body: op.Obstacle
    position: np.ndarray
    velocity: np.ndarray

    def seen(self, t: float) -> dict[str, Any]:
        """What is handed to `update_scene`."""
        X = pin.SE3(self.body.X_WO.rotation, self.position + (t - self.at) * self.velocity)
        return {"flying": type(self.body)("flying", self.body.shape, X)}


class Watched:
    """A planning process, with the seconds that motions took.

    Without `wall` its answers are there after their processor time, on the executor's clock.
    """

    def __init__(self, planning: planning_process.PlanningProcess, wall: bool) -> None:
        vars(self).update(_inner=planning, _wall=wall, asked=0, seconds=[])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._inner, name, value)

    def answer(self, law: Any, now: float) -> Any:
        """The answer, once its time has come; nothing where it would have been cut short."""
        inner = self._inner
        if inner._asked is None:
            return None
        asked, _ = inner._asked
        if not self._wall:
            while not inner._done and not inner.lost:
                time.sleep(1e-4)
            cut = (
                BUDGET_AT_REST if asked.law.settled <= asked.then and asked.law.target == 0.0 else inner._policy.latency
            )
            if now < asked.since + min(inner._done[0].seconds, cut):
                return None
        if inner._done and inner._done[0].path is not None:
            self.seconds.append(time.perf_counter() - self.begun if self._wall else inner._done[0].seconds)
        found = inner.answer(law, now)
        return found if self._wall or self.seconds[-1:] <= [cut] else None

    def seek(self, *arguments: Any) -> None:
        """Note when the first motion was requested."""
        if self._inner._asked is None:
            vars(self).update(begun=time.perf_counter())
        self._inner.seek(*arguments)


def main() -> None:
    """Make cases, run and judge them, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=50, help="cases of each robot and speed")
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--speeds", nargs="+", type=float, default=[0.3, 1.0], help="m/s")
    parser.add_argument("--policies", nargs="+", default=["replan", "slow", "wait"])
    parser.add_argument("--latency", type=float, default=0.05, help="s, of planning")
    parser.add_argument("--clock", choices=("processor", "wall"), default="processor")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.clock == "processor":
        planning_process.IN_TIME, planning_process.BUDGET_AT_REST = 20.0, 5.0  # no wall clock cuts a plan short
    rows, data, broken = [], {}, 0
    for robot in options.robots:
        rng = np.random.default_rng(options.seed)
        runs = motions(ROBOTS[robot], rng, max(3, options.count // 25))
        for speed in options.speeds:
            cases = [found for k in range(options.count) if (found := appear(runs[k % len(runs)], speed, rng))]
            for policy, row, hits in table(cases, options):
                rows.append([robot, f"{speed:g}", *row])
                data[f"{robot} {speed:g} {policy}"] = row
                broken += hits if policy == "replan" else 0
                print(f"{robot} at {speed:g} m/s, {policy}: {hits} avoidable hits in {len(cases)} cases", flush=True)
    print_table(HEADINGS, rows)
    if options.markdown:
        write_markdown(options.markdown, HEADINGS, rows)
    print_json(data)
    raise SystemExit(1 if broken else 0)


def motions(name: str, rng: np.random.Generator, count: int) -> list[op.Run]:
    """Verified motions between random free configurations."""
    problem, found = op.load_problem(name), []
    low, high = problem.limits.lower, problem.limits.upper
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    while len(found) < count:
        start, goal = (middle + 0.6 * np.minimum(half, 2.5) * rng.uniform(-1.0, 1.0, len(low)) for _ in range(2))
        try:
            run = op.plan(problem.with_parts(start=start, goal=goal), budget=2.0, seed=1)
            if run.verified and op.Executor(run):
                found.append(run)
        except op.InputError:
            continue
    return found


def appear(run: op.Run, speed: float, rng: np.random.Generator) -> Case | None:
    """An obstacle that does not touch the robot when it appears, and flies to where a link is or will be."""
    robot, T = run.problem.robot, run.duration
    judge = Judge(run)
    for _ in range(100):
        at = rng.uniform(0.05, 0.6) * T
        then = rng.uniform(min(at + 0.2, T), T)  # on the way: where it ends, nobody can go around
        links = [frame.name for frame in robot.model.frames[2:]]
        aim = robot.fk(run.trajectory(min(then, T)), links[rng.integers(len(links) // 2, len(links))]).matrix[:3, 3]
        direction = rng.normal(size=3)
        velocity = speed * direction / np.linalg.norm(direction)
        position = aim + rng.uniform(-0.08, 0.08, 3) - (then - at) * velocity
        if rng.random() < 0.5:
            body = op.Sphere("flying", rng.uniform(0.03, 0.1), position=tuple(position))
        else:
            rpy = tuple(rng.uniform(-3.0, 3.0, 3))
            body = op.Box("flying", size=tuple(rng.uniform(0.05, 0.2, 3)), position=tuple(position), rpy=rpy)
        case = Case(run, at, body, position, velocity)
        if judge.distance(case, run.trajectory(at), at) > 0.005:
            return case
    return None


class Judge:
    """Distances of the moving links from the obstacle, by Pinocchio and coal alone."""

    def __init__(self, run: op.Run) -> None:
        robot = run.problem.robot
        self.model, self.geometry = robot.model, robot.geometry.copy()
        self.data, self.placed = self.model.createData(), pin.GeometryData(self.geometry)
        self.bodies = [k for k, one in enumerate(self.geometry.geometryObjects) if one.parentJoint > 0]

    def distance(self, case: Case, q: np.ndarray, t: float) -> float:
        """Least distance, m, at a time, s."""
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.placed, q)
        shape = build_geometry(case.body.shape)
        X = coal.Transform3s(case.body.X_WO.rotation, case.position + (t - case.at) * case.velocity)
        request, least = coal.DistanceRequest(), np.inf
        for k in self.bodies:
            body, M = self.geometry.geometryObjects[k].geometry, self.placed.oMg[k]
            result = coal.DistanceResult()
            least = min(
                least, coal.distance(body, coal.Transform3s(M.rotation, M.translation), shape, X, request, result)
            )
        return least

    def hit(self, case: Case, path: list[tuple[float, np.ndarray]]) -> bool:
        """Whether the obstacle meets the robot, which stays where the path ends, before it has gone."""
        Q = np.array([q for _, q in path])
        rates = np.abs(np.diff(Q, axis=0)).sum(axis=1) * FASTEST_LINK + float(np.linalg.norm(case.velocity)) * DT
        way = np.concatenate([[0.0], np.cumsum(rates)])  # how much the distance may change until each tick
        k = 0
        while k < len(path):
            t, q = path[k]
            apart = self.distance(case, q, t)
            if apart <= 0.0:
                return True
            k = max(k + 1, int(np.searchsorted(way, way[k] + apart)))
        t, q = path[-1]
        while t < case.at + GONE:
            apart = self.distance(case, q, t)
            if apart <= 0.0:
                return True
            t += max(apart / float(np.linalg.norm(case.velocity)), DT)
        return False

    def in_reach(self, case: Case, path: list[tuple[float, np.ndarray]]) -> bool:
        """Whether an obstacle of any course could meet the robot before it stands still, at the end of the path."""
        speed, still = float(np.linalg.norm(case.velocity)), Case(case.run, 0.0, case.body, case.position, np.zeros(3))
        return any(self.distance(still, q, 0.0) <= speed * (t - case.at) for t, q in path[::10] + path[-1:])


def stopped(case: Case) -> list[tuple[float, np.ndarray]]:
    """The way of a robot that stops in the moment in which the obstacle appears."""
    executor, path = op.Executor(case.run), []
    while executor.time < case.at - 0.5 * DT:
        executor.tick(DT)
    case.at = executor.time
    executor.stop()
    while not path or executor.status.speed != 0.0:
        path.append((executor.time, executor.tick(DT).q))
    return [(t + DT, q) for t, q in path]


@dataclass
class Outcome:
    """What one case came to: the way from the event on, arrival, and times, s."""

    path: list[tuple[float, np.ndarray]]
    arrived: float | None
    plans: list[float]
    updates: list[float]
    ticks: list[float]


def executed(case: Case, policy: str, options: Any) -> Outcome:
    """Run one case with a policy until the robot is at its goal and the obstacle has gone."""
    policy_of = op.Policy(policy, period=PERIOD * DT, latency=options.latency, linger=GONE)
    executor, found = op.Executor(case.run, policy=policy_of), Outcome([], None, [], [], [])
    wall = options.clock == "wall"
    if policy == "replan":
        executor._planning = Watched(executor._planning, wall)
    while executor.time < case.at - 0.5 * DT:
        executor.tick(DT)
    began, clock = time.perf_counter(), time.perf_counter if wall else time.thread_time
    for k in range(round((GONE + case.run.duration) / DT)):
        if k % PERIOD == 0 and executor.time < case.at + GONE:
            seen, velocity, now = case.seen(executor.time), {"flying": tuple(case.velocity)}, clock()
            executor.update_scene(seen, velocity)
            found.updates.append(clock() - now)
        now = clock()
        tick = executor.tick(DT)
        found.ticks.append(clock() - now)
        found.path.append((executor.time, tick.q))
        if wall:
            time.sleep(max(0.0, began + (k + 1) * DT - time.perf_counter()))
        if tick.status.phase == "done":
            found.arrived = executor.time
            break
    if executor._planning is not None and executor._planning.seconds:
        found.plans.append(found.updates[0] + executor._planning.seconds[0])  # the first one counts
    executor.close()
    return found


def table(cases: list[Case], options: Any) -> Any:
    """Run all cases with all policies; yield the policy, its row, and the avoidable hits."""
    judges = [Judge(case.run) for case in cases]
    ways = [stopped(case) for case in cases]
    avoidable = [not judge.hit(case, way) for judge, case, way in zip(judges, cases, ways, strict=True)]
    by_ball = [not judge.in_reach(case, way) for judge, case, way in zip(judges, cases, ways, strict=True)]
    for policy in options.policies:
        hits, others, lost, outcomes = 0, 0, [], []
        for k, (judge, case, could) in enumerate(zip(judges, cases, avoidable, strict=True)):
            found = executed(case, policy, options)
            outcomes.append(found)
            if judge.hit(case, found.path):
                hits, others = hits + could, others + (not could)
                if could:
                    print(f"  hit: case {k} of {policy}, {case.body}, at {case.at:.3f} s", flush=True)
            if found.arrived is not None:
                lost.append(found.arrived - case.run.duration)
        plans, updates, ticks = (
            np.concatenate([getattr(one, name) for one in outcomes]) for name in ("plans", "updates", "ticks")
        )
        row = [
            policy,
            f"{len(cases)}",
            f"{sum(avoidable)} ({sum(by_ball)})",
            f"{hits}",
            f"{others}",
            f"{100 * len(lost) / len(cases):.1f} %",
            figures(lost, (50, 90), 1.0, 2),
            figures(plans, (50, 90, 99), 1e3, 0),
            figures(updates, (50, 99), 1e3, 2),
            figures(ticks, (50, 99), 1e6, 0),
        ]
        yield policy, row, hits


def figures(values: Any, shares: tuple[int, ...], scale: float, digits: int) -> str:
    """Percentiles in a cell of the table."""
    if not len(values):
        return ""
    return " / ".join(f"{scale * x:.{digits}f}" for x in np.percentile(values, shares))


if __name__ == "__main__":
    main()
