"""`generate: NAME` as a source of a suite: scenes drawn at random until the robot can stand at both ends."""

import json
from collections.abc import Callable, Iterator
from functools import cache as once
from functools import partial
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

import optiplan
from optiplan import cache
from optiplan.arrays import Array
from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.sources.base import Found, Place
from optiplan.bench.sources.room_scenes import Aisle, Clutter, Machine, Slot
from optiplan.bench.sources.tabletop_scenes import (
    Arm,
    Cage,
    DrawnScene,
    Generator,
    OpenBox,
    Shelf,
    Table,
    UnderTable,
    rounded,
)
from optiplan.collision.model import CollisionModel
from optiplan.config.messages import choices
from optiplan.errors import InputError
from optiplan.geometry.poses import pose_to_data
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.problem.goals import GoalOptions, goal_configurations
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.robot.robot import Robot
from optiplan.runs.run import versions
from optiplan.workspace.reach import sampling_range, shoulder_point

GENERATORS: dict[str, type[Generator]] = {
    "shelf": Shelf,
    "cage": Cage,
    "box": OpenBox,
    "table": Table,
    "under_table": UnderTable,
    "slot": Slot,
    "clutter": Clutter,
    "machine": Machine,
    "aisle": Aisle,
}
"""Generators by the name that a suite has for them."""

LEVELS = ("easy", "medium", "hard")
_ROBOTS = {"aisle": {"robot": "delbot", "group": "all"}}  # the others: panda
_ARM = 7  # joints of an arm; more is a mobile one
_DRAWS = 150  # scenes drawn for one problem before giving up
_ENDS = GoalOptions(count=1, solutions=8, attempts=20)


def generated(place: Place) -> Iterator[Found]:
    """`count` problems of one generator; problem k depends on the seed and k alone.

    Raises:
        InputError: there is no such generator, or a parameter is unknown or unfit, or nothing drawn can be used.
    """
    spec = place.spec
    level, generator = _generator(place)
    robots = RobotCache()
    robot = _ROBOTS.get(str(spec.generate), {"robot": "panda"})
    if spec.robot is not None:
        robot = robot | {"robot": str(place.robot())}
    loaded = robots(robot["robot"], None, None, robot.get("group"))
    arm = Arm(np.zeros(3), 1.0) if spec.generate in _ROBOTS else _arm(loaded)
    identity = [_code(), loaded.fingerprint, json.dumps([robot, spec.generate, vars(generator), spec.seed])]
    for k in range(spec.count):
        rng = np.random.default_rng([spec.seed, k])
        data = _kept([*identity, str(k)], partial(_problem, generator, arm, rng, robot, loaded, robots))
        if data is None:
            expected = "other params:, another seed: or another robot:"
            raise place.refuse("generate", f"{_DRAWS} scenes in which '{loaded.name}' cannot stand", expected)
        origin = {"generate": spec.generate, "seed": spec.seed, "index": k, "params": dict(spec.params)}
        yield Found(f"{level}-{k:04d}", spec.set or str(spec.generate), data, place.scratch, origin, level)


def _kept(identity: list[str], make: Callable[[], dict[str, Any] | None]) -> dict[str, Any] | None:
    """Return cached scenes, or draw and cache them: drawing takes longer than reading."""
    file = f"scenes/{cache.digest(part.encode() for part in identity)}.json"
    kept = cache.load(file)
    if kept is None:
        kept = json.dumps(make()).encode()
        cache.store(file, kept)
    data: dict[str, Any] | None = json.loads(kept)
    return data


@once
def _code() -> str:
    """Return a hash of all code that determines a scene, in place of a version number."""
    folder = Path(optiplan.__file__).parent
    rooms = ("bench/sources", "geometry", "robot", "kinematics", "collision", "workspace", "problem")
    files = [path for room in rooms for path in sorted((folder / room).rglob("*.py"))]
    return cache.digest([json.dumps(versions()).encode(), *(path.read_bytes() for path in files)])


def _arm(robot: Robot) -> Arm:
    """Shoulder and reach; the farthest of some thousand random configurations is near enough for a scale."""
    Q = np.random.default_rng(0).uniform(*sampling_range(robot), (4096, robot.n))
    shoulder = shoulder_point(robot)
    tools = ToolKinematics(robot).evaluate(Q)[0][:, :3, 3]
    return Arm(shoulder, round(float(np.linalg.norm(tools - shoulder, axis=1).max()), 3))


def _generator(place: Place) -> tuple[str, Generator]:
    """Its level and the generator itself, parameters checked."""
    spec = place.spec
    if spec.generate not in GENERATORS:
        expected = choices(str(spec.generate), sorted(GENERATORS))
        raise place.refuse("generate", f"unknown generator '{spec.generate}'", expected)
    cls = GENERATORS[spec.generate]
    given = dict(spec.params)
    level = given.pop("level", "medium")
    if level not in LEVELS:
        raise place.refuse("params", f"level {level!r}", f"one of: {', '.join(LEVELS)}")
    known = get_type_hints(cls)
    known.pop("LEVELS")
    for key, value in given.items():
        if key not in known:
            raise place.refuse("params", f"unknown parameter '{key}'", choices(key, ["level", *known]))
        try:
            TypeAdapter(known[key], config=ConfigDict(strict=True)).validate_python(value)
        except ValidationError:
            raise place.refuse("params", f"{key} = {value!r}", f"a number ({known[key].__name__})") from None
        if not 0.0 < value <= 1000.0:
            raise place.refuse("params", f"{key} = {value!r}", "a number above 0, at most 1000")
    return level, cls(**{**cls.LEVELS.get(level, {}), **given})


def _problem(
    generator: Generator,
    arm: Arm,
    rng: np.random.Generator,
    names: dict[str, str],
    robot: Robot,
    robots: RobotCache,
) -> dict[str, Any] | None:
    """Content of a problem file; None when no scene drawn can be used."""
    for _ in range(_DRAWS):
        draft = generator.draw(rng, arm)
        blank = {"version": 1, **names, "scene": {"obstacles": draft.obstacles}}
        start = _start(blank, draft, rng, robot, robots)
        if start is None:
            continue
        data = blank | {"start": start, "goal": {"pose": pose_to_data(draft.goal)}}
        q = _solved(data, rng, robots)
        if q is not None and robot.n <= _ARM:
            return data
        if q is not None:  # with many joints another search might find no configuration
            return data | {"goal": {"joints": rounded(q)}}
    return None


def _start(
    blank: dict[str, Any], draft: DrawnScene, rng: np.random.Generator, robot: Robot, robots: RobotCache
) -> dict[str, Any] | None:
    """Return the start: the scene's pose, or the first free configuration of the robot; or None."""
    goal = {"pose": pose_to_data(draft.goal if draft.start is None else draft.start)}
    for name in robot.configurations:
        start = {"configuration": name}
        if draft.start is None:
            if _loaded(blank | {"start": start, "goal": goal}, robots) is not None:
                return start
            continue
        q = _solved(blank | {"start": start, "goal": goal}, rng, robots)
        if q is not None:
            return {"joints": rounded(q)}
    return None


def _solved(data: dict[str, Any], rng: np.random.Generator, shelf: RobotCache) -> Array | None:
    """A free configuration at the goal of a problem whose start is free, or None."""
    problem = _loaded(data, shelf)
    if problem is None:
        return None
    found = goal_configurations(problem, CollisionModel(problem.robot, problem.scene), rng, _ENDS)
    return found.configurations[0] if found.configurations else None


def _loaded(data: dict[str, Any], shelf: RobotCache) -> Problem | None:
    """The problem, or None where its start collides."""
    try:
        return problem_from_dict(data, robots=shelf)
    except InputError:
        return None
