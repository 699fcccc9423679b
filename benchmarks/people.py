"""A person walks through the cell of a robot at 1.6 m/s: the separation kept, and what is left of the throughput.

    python benchmarks/people.py --markdown people.md --picture docs/pictures/people.png    # some minutes on one core

The Panda sorts cubes, the UR5 goes around its column and back, again and again. The person is a cylinder of 0.3 m
radius on three courses: past the cell, towards it and away again, and to its side, where it stands for 5 s. A sensor
measures the person 30 times a second, up to 3 cm beside the truth, and its data arrive 50 ms later. Three ways to keep
the person apart: `separation` (speed and separation monitoring by `op.Separation`), `distance` (a stop where robot and
person are nearer than a fixed distance) and `fence` (a stop where the person is nearer than a fixed distance to any
place of the robot's way). The fixed distances are those of the standards for the worst case: v_h (T_r + T_s) + C + Z_d
+ Z_r, and for `distance` also the robot's way while it reacts and stops. T_s and that way are those that 95 % of the
places of the motion do not exceed, which favours the fixed distances: the worst places are twice as long. Each is worth
the share of the path that the robot ran in 15 s of what it runs alone, in the mean of the passes.

The judge knows where the person is, and the set-points that the executor is committed to if no more data come. At every
ms at which the robot moves it computes distances by coal, the protective distance S_h + S_r + S_s + C after ISO/TS
15066 from the committed way until standstill, and the separation. Exit code 1 where the separation is less in any of
them, or the robot moves while it touches the person. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import coal
import matplotlib as mpl
import numpy as np
import pinocchio as pin
from published import print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.problem.task.timeline import scene_parts

DT, DELAY, RATE, NOISE = 1e-3, 50, 30.0, 0.03  # s; ticks until data arrive; 1/s; m
RADIUS, HEIGHT, SPEED = 0.3, 1.8, 1.6  # m, m, m/s
RULE = op.Separation("person", reaction=0.1, intrusion=0.1, sensor_uncertainty=NOISE, robot_uncertainty=0.005)
AWAY = np.array([8.0, 0.0, 0.9])
MOST = 95.0  # %, of the places of a motion
GRID = 0.01  # s, between the judge's places of the committed way
BACK = 0.05  # m beyond a fixed distance at which the robot goes on
METHODS = ("separation", "distance", "fence")
COURSES: dict[str, tuple[tuple[float, float], ...]] = {  # corners, m; one that is named twice is a stay of 5 s
    "past": ((1.3, -5.0), (1.3, 5.0)),
    "towards and away": ((5.0, 0.0), (1.15, 0.0), (5.0, 0.0)),
    "stops beside": ((3.0, 4.0), (0.4, 1.0), (0.4, 1.0), (3.0, 4.0)),
}
STAY, BEGIN, LATER, WINDOW = 5.0, 1.5, 1.7, 15.0  # s; each pass begins later by LATER
HEADINGS = (
    *("robot", "course", *(f"{method}, %" for method in METHODS)),
    *("least S - S_p, m", "least S moving, m", "update 50 / 99 % ms", "violations"),
)
Course = Callable[[float], np.ndarray]


class Cell(NamedTuple):
    """A robot, the runs of its cycle, and the fixed distances for it, m."""

    name: str
    runs: list[op.Run]
    fixed: dict[str, float]


class Walk(NamedTuple):
    """What happened in a window: at each ms, separation, protective distance (nan at rest) and speed; path time, s."""

    separation: np.ndarray
    needed: np.ndarray
    speed: np.ndarray
    done: float
    updates: list[float]


def main() -> None:
    """Walk, judge, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--picture", type=Path, help="a PNG of separation and protective distance over time")
    parser.add_argument("--robots", nargs="+", default=["panda", "ur5"], choices=["panda", "ur5"])
    parser.add_argument("--courses", nargs="+", default=list(COURSES), choices=list(COURSES))
    parser.add_argument("--passes", type=int, default=3, help="of each course, which begin at other times")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds of planning")
    options = parser.parse_args()
    rows, data, shown, broken = [], {}, {}, 0
    for name in options.robots:
        cell = cell_of(name, options.budget)
        for which in options.courses:
            begins = [BEGIN + LATER * k for k in range(options.passes)]
            courses = [course_of(COURSES[which], begin) for begin in begins]
            walks = {method: [walk(cell, course, method) for course in courses] for method in METHODS}
            ours = walks["separation"]
            slack = min(np.nanmin(one.separation - one.needed) for one in ours)
            least = min(one.separation[one.speed != 0.0].min() for one in ours)
            bad = int(sum((one.separation < one.needed).sum() for one in ours) + (least <= 0.0))
            updates = np.percentile([t for one in ours for t in one.updates], [50, 99])
            shares = [100.0 * np.mean([one.done for one in found]) / WINDOW for found in walks.values()]
            rows.append([name, which, *(f"{x:.0f}" for x in shares), f"{slack:.3f}", f"{least:.2f}"])
            rows[-1] += [" / ".join(f"{1e3 * x:.1f}" for x in updates), f"{bad}"]
            data[f"{name}, {which}"] = {"shares": shares, "slack": float(slack), "violations": bad, "fixed": cell.fixed}
            shown[name, which], broken = ours[0], broken + bad
            print(*rows[-1], sep=" | ", flush=True)
    print_table(HEADINGS, rows)
    if options.markdown:
        write_markdown(options.markdown, HEADINGS, rows)
    if options.picture:
        draw(shown, options.picture)
    print_json(data)
    raise SystemExit(broken > 0)


def cell_of(name: str, budget: float) -> Cell:
    """Plan the cycle of a robot, and compute the fixed distances."""
    person = op.Cylinder("person", radius=RADIUS, length=HEIGHT, position=tuple(AWAY))
    problem = op.load_problem("40_panda_sorts_cubes" if name == "panda" else "09_ur5")
    problem = problem.with_scene([*problem.scene.obstacles, person])
    runs = [op.plan(problem, budget=budget)]
    if name == "ur5":
        back = problem.with_start(runs[0].trajectory.end).with_goal(op.JointGoal(problem.start))
        runs.append(op.plan(back, budget=budget))
    for run in runs:
        if not run.verified:
            raise SystemExit(f"{name}: {run!r}")
    stops = [op.Executor(run).stopping() for run in runs]
    approach = RULE.human_speed * (RULE.reaction + max(np.percentile(stop.time, MOST) for stop in stops)) + RULE.margin
    way = max(longest_way(run, stop) for run, stop in zip(runs, stops, strict=True))
    return Cell(name, runs, {"fence": float(approach), "distance": float(approach + way)})


def longest_way(run: op.Run, stop: op.Stopping) -> float:
    """The way of a link's origin or the tool while the robot reacts and stops, m: what most places do not exceed."""
    t = np.arange(0.0, run.duration, 2e-3)
    places = np.array(
        [[run.problem.robot.fk(q, frame).matrix[:3, 3] for frame in frames(run)] for q in run.trajectory(t)]
    )
    along = np.vstack([np.zeros(places.shape[1]), np.linalg.norm(np.diff(places, axis=0), axis=2).cumsum(axis=0)])
    ends = np.searchsorted(t, stop.place + stop.travel + RULE.reaction).clip(max=len(t) - 1)
    ways = along[ends] - along[np.searchsorted(t, stop.place).clip(max=len(t) - 1)]
    return float(np.percentile(ways.max(axis=1), MOST))


def frames(run: op.Run) -> list[str]:
    """Frames of the moving links."""
    model = run.problem.robot.model
    return [one.name for one in model.frames if one.parentJoint > 0 and one.type == pin.FrameType.BODY]


def course_of(corners: tuple[tuple[float, float], ...], begin: float) -> Course:
    """The place of the person's middle, m, at each time, s; it begins to walk at one."""
    points = np.array(corners)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    times = begin + np.append(0.0, np.where(length > 0.0, length / SPEED, STAY).cumsum())
    return lambda t: np.array([np.interp(t, times, points[:, 0]), np.interp(t, times, points[:, 1]), 0.5 * HEIGHT])


def walk(cell: Cell, course: Course, method: str) -> Walk:
    """Run the robot's cycle for a window of time beside a person."""
    rng, count = np.random.default_rng(1), round(WINDOW / DT)
    judges = [Judge(run) for run in cell.runs]
    samples = {round(k / RATE / DT) + DELAY: k / RATE for k in range(int(WINDOW * RATE))}
    separation, needed, speed = np.full(count, np.nan), np.full(count, np.nan), np.zeros(count)
    turn, done, updates = 0, 0.0, []
    executor, seen = executor_of(cell, turn, method), (0.0, AWAY)
    for k in range(count):
        if executor.status.phase == "done":
            done, turn = done + executor.run.duration, turn + 1
            executor = executor_of(cell, turn, method)
        judge, there = judges[turn % len(judges)], course(k * DT)
        if k in samples:
            seen = samples[k], course(samples[k]) + within(rng, NOISE)
        if k in samples or executor.time == 0.0:
            began = time.thread_time()
            react(executor, judge, seen[1], k * DT - seen[0], method, cell.fixed.get(method, 0.0))
            updates.append(time.thread_time() - began)
            judge.commit(executor)
        if method == "separation":
            separation[k], needed[k] = judge.look(executor, there)
        speed[k] = executor.tick(DT).status.speed
    return Walk(separation, needed, speed, done + executor.status.place, updates)


def executor_of(cell: Cell, turn: int, method: str) -> op.Executor:
    """The executor of the next motion of the cycle."""
    rule = RULE if method == "separation" else None
    return op.Executor(cell.runs[turn % len(cell.runs)], separation=rule)


def react(executor: op.Executor, judge: "Judge", seen: np.ndarray, age: float, method: str, fixed: float) -> None:
    """Hand over a measurement, or stop within a fixed distance of it."""
    if method == "separation":
        executor.update_scene({"person": op.Pose(tuple(seen))}, age=age)
        return
    places = judge.swept if method == "fence" else [judge.bodies(executor.state_in(0.0).q, executor.status.place)]
    distance = min(judge.distance(bodies, seen) for bodies in places)
    if distance < fixed:
        executor.pause()
    elif distance > fixed + BACK:
        executor.resume()


def within(rng: np.random.Generator, radius: float) -> np.ndarray:
    """A place within a ball."""
    direction = rng.normal(size=3)
    return radius * rng.uniform() * direction / np.linalg.norm(direction)


class Placed(NamedTuple):
    """A moving body of the robot: its shape, where it is, and a ball about it."""

    shape: coal.CollisionGeometry
    X: coal.Transform3s
    centre: np.ndarray
    radius: float


class Judge:
    """Distances from where the person is, by coal, and the protective distance of what is committed."""

    def __init__(self, run: op.Run) -> None:
        self.person = coal.Cylinder(RADIUS, HEIGHT)
        self.ends, self.models = [], []
        for part in scene_parts(run.problem, run.trajectory):
            model = CollisionModel(part.problem.robot, part.problem.scene)
            self.ends.append(part.end)
            self.models.append((model, model.model.createData(), pin.GeometryData(model.geometry)))
        t = np.arange(0.0, run.duration, 0.04)
        self.swept = [self.bodies(q, place) for q, place in zip(run.trajectory(t), t, strict=True)]
        self.horizon = RULE.reaction + op.Executor(run).stopping(50).time.max() + 0.1
        self.way: list[tuple[float, list[Placed]]] = []
        self.moves, self.last = False, AWAY

    def bodies(self, q: np.ndarray, place: float) -> list[Placed]:
        """The bodies that joints move, at a place of the motion."""
        model, data, placed = self.models[min(int(np.searchsorted(self.ends, place, side="right")), len(self.ends) - 1)]
        pin.updateGeometryPlacements(model.model, data, model.geometry, placed, q)
        found = []
        for body, X in zip(model.geometry.geometryObjects, placed.oMg, strict=True):
            if body.parentJoint > 0:
                body.geometry.computeLocalAABB()
                centre, radius = X.act(np.array(body.geometry.aabb_center)), body.geometry.aabb_radius
                found.append(Placed(body.geometry, coal.Transform3s(X.rotation, X.translation), centre, radius))
        return found

    def distance(self, bodies: list[Placed], there: np.ndarray) -> float:
        """The least distance of the bodies from the person."""
        X = coal.Transform3s(np.eye(3), there)
        low = [float(np.hypot(*(one.centre - there)[:2])) - RADIUS - one.radius for one in bodies]
        least = np.inf
        for k in np.argsort(low):
            if low[k] > least:
                break
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            least = min(least, coal.distance(bodies[k].shape, bodies[k].X, self.person, X, request, result))
        return least

    def commit(self, executor: op.Executor) -> None:
        """Remember what the executor does from now on if no more data come."""
        times = GRID * np.arange(round(self.horizon / GRID))
        q = np.array([executor.state_in(t).q for t in times])
        moving = np.flatnonzero((q != q[-1]).any(axis=1))
        count = moving[-1] + 2 if len(moving) else 1
        place = executor.status.place
        self.way = [(executor.time + times[k], self.bodies(q[k], place)) for k in range(min(count, len(q)))]
        self.moves, self.last = len(moving) > 0, AWAY

    def look(self, executor: op.Executor, there: np.ndarray) -> tuple[float, float]:
        """Separation and protective distance, m; nan where the robot stands still."""
        now = self.distance(self.bodies(executor.state_in(0.0).q, executor.status.place), there)
        left = [(t, bodies) for t, bodies in self.way if t > executor.time]
        if not self.moves or not left:
            return now, np.nan
        if np.linalg.norm(there - self.last) > 0.02:
            self.gaps = {t: self.distance(bodies, there) for t, bodies in left}
            self.last = there
        off = float(np.linalg.norm(there - self.last))
        ahead = max(RULE.human_speed * (t - executor.time) - self.gaps[t] + off for t, _ in left)
        if ahead + RULE.intrusion > 0.0 and off > 0.0:  # that was a bound
            ahead = max(RULE.human_speed * (t - executor.time) - self.distance(bodies, there) for t, bodies in left)
        return now, RULE.intrusion + max(0.0, now + ahead)


def draw(shown: dict[tuple[str, str], Walk], path: Path) -> None:
    """Separation, protective distance and speed over time."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    robots, courses = (list(dict.fromkeys(key[k] for key in shown)) for k in range(2))
    figure, grid = plt.subplots(
        len(courses),
        len(robots),
        figsize=(10, 2.3 * len(courses)),
        squeeze=False,
        sharex=True,
        sharey=True,
        layout="constrained",
    )
    for (robot, course), walked in shown.items():
        axes, t = grid[courses.index(course), robots.index(robot)], DT * np.arange(len(walked.speed))
        axes.fill_between(t, 0.0, np.abs(walked.speed), color="0.85", lw=0, label="speed, 1 = as planned")
        axes.plot(t, walked.separation, color="C0", lw=1.2, label="separation, m")
        axes.plot(t, walked.needed, color="C3", lw=1.0, label="protective distance, m")
        axes.set(title=f"{robot}: {course}", ylim=(0.0, 2.0), xlim=(0.0, WINDOW))
        axes.grid(alpha=0.3)
    for axes in grid[-1]:
        axes.set_xlabel("t, s")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), ncols=3, loc="outside lower center")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
