"""Turn problem data into models and arrays, or report every issue."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from optiplan.collision.kept_models import collision_model
from optiplan.collision.model import CollisionModel
from optiplan.config.document import Document, validate
from optiplan.config.messages import field_name
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.scene import Scene
from optiplan.problem.builder import Compiler, RobotLoader
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.constraints.states import BrokenConstraint
from optiplan.problem.free_space import free_check
from optiplan.problem.goals_and_vias import GoalEnd, JointGoal, Via
from optiplan.problem.hashing import problem_hash, shape_files_of
from optiplan.problem.nonzero_ends import StatedState, impossible_states
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.partial import Draft, LocatedValue
from optiplan.problem.schema.joint_names import Orders, joint_orders, with_lists, with_names
from optiplan.problem.schema.problem import ProblemSpec
from optiplan.problem.task.reading import TaskReader
from optiplan.problem.task.steps import Move, TaskStep
from optiplan.robot.given_configurations import wrong_names
from optiplan.robot.robot import Robot, load_robot, robot_names

DECIDES_COLLISIONS = (("robot",), ("group",), ("locked",), ("scene", "allowed_collisions"), ("scene", "attached"))
"""Where an issue stands in these fields, collisions found would be no news about the file."""


@dataclass(frozen=True)
class Reading:
    """What a file holds: the attributes of its `Problem` by name, or the issues because of which it has none."""

    parts: Mapping[str, Any]
    issues: tuple[Issue, ...] = ()

    def whole(self) -> Mapping[str, Any]:
        """Return the attributes.

        Raises:
            InputError: all issues.
        """
        if not self.parts:
            raise InputError(self.issues)
        return self.parts


@dataclass(frozen=True, eq=False)
class _Places:
    """Valid start, goal and vias."""

    start: JointGoal | None
    goal: Sequence[LocatedValue[GoalEnd]]
    vias: Sequence[LocatedValue[Via]]
    task: Sequence[LocatedValue[TaskStep]]
    constraints: Sequence[LocatedValue[PathConstraint]]


def read_problem(document: Document, base: Path, robots: RobotLoader = load_robot) -> Reading:
    """Read a problem file: its parts, or its issues in file order.

    Args:
        document: the file.
        base: folder that meshes and robot files are relative to.
        robots: loads a robot.
    """
    orders = joint_orders(document.data)
    if not orders:
        return _read_lists(document, base, robots)
    listed = with_lists(document, orders)
    compiler = Compiler(listed, base, Draft.of(listed.data))
    robot = compiler.robot(robots)
    if robot is not None:
        wanted = {place: compiler.joints_at(robot, place) or names for place, names in orders.items()}
        issues = _wrong_names(document, orders, wanted)
        if issues:
            issues += with_names(document, _schema(listed)[1], orders)
            return Reading({}, _in_file_order(issues))
        orders = wanted
    reading = _read_lists(with_lists(document, orders), base, robots)
    return replace(reading, issues=_in_file_order(with_names(document, reading.issues, orders)))


def _wrong_names(document: Document, given: Orders, wanted: Orders) -> list[Issue]:
    """Report joints that are unknown at their place, and values that do not name every joint."""
    issues = []
    for place, names in given.items():
        for joint, found, expected in wrong_names(wanted[place], names):
            issues.append(document.issue(place if joint is None else (*place, joint), found, expected))
    return issues


def _in_file_order(issues: Iterable[Issue]) -> tuple[Issue, ...]:
    return tuple(sorted(issues, key=lambda issue: issue.line or 0))


def _read_lists(document: Document, base: Path, robots: RobotLoader) -> Reading:
    """Read a problem file whose joint values are lists."""
    spec, issues = _schema(document)
    compiler = Compiler(document, base, Draft.of(spec or document.data))
    robot = compiler.robot(robots)
    scene = compiler.scene(robot)
    robot = None if robot is None else compiler.mounted(robot, scene)
    places = _Places(None, (), (), (), ())
    if robot is not None:
        ends = compiler.start(robot), compiler.goal(robot), compiler.vias(robot)
        steps = TaskReader(compiler, robot, scene).steps()
        places = _Places(*ends, steps, compiler.constraints(robot, scene))
    issues += [] if any(issue.field == "file" for issue in issues) else goal_or_task(document)
    issues += compiler.issues
    issues += [] if robot is None else _moving_first(document, robot, places)
    limits = None if robot is None else robot.limits.scaled(**({} if spec is None else spec.limits.model_dump()))
    if robot is not None and limits is not None:
        issues += _constraints(document, robot, scene, compiler.draft, places)
        issues += impossible_states(document, robot, limits, _states(compiler.draft, places))
    if robot is not None and not any(
        issue.path[: len(place)] == place for issue in issues for place in DECIDES_COLLISIONS
    ):
        model = collision_model(robot, scene)
        # by the time of a via or a goal, what moves may be elsewhere
        later = collision_model(robot, scene.standing) if scene.dynamic_obstacles else model
        issues += _collisions(document, (model, later), compiler.draft, places)
    if issues or spec is None or robot is None or limits is None or places.start is None:
        return Reading({}, _in_file_order(issues))
    source, digest = source_of(spec, document.path.stem.strip("<>"), base, robot)
    parts = {
        "name": source["name"],
        "robot": robot,
        "scene": scene,
        "start": places.start.state.q,
        "start_velocity": places.start.state.v,
        "start_acceleration": places.start.state.a,
        "goal": tuple(part.value for part in places.goal),
        "limits": limits,
        "vias": tuple(part.value for part in places.vias),
        "task": tuple(part.value for part in places.task),
        "objective": Objective(**spec.objective.model_dump(exclude_none=True)),
        "path_constraints": tuple(part.value for part in places.constraints),
        "planner": spec.planner.name,
        "options": dict(spec.planner.model_extra or {}),
        "seed": spec.seed,
        "source": source,
        "hash": digest,
    }
    return Reading(parts)


def _schema(document: Document) -> tuple[ProblemSpec | None, list[Issue]]:
    try:
        return validate(ProblemSpec, document), []
    except InputError as error:
        return None, list(error.issues)


def goal_or_task(document: Document) -> list[Issue]:
    """Report a file with neither a goal nor a task, or with both, or with vias beside a task."""
    data = document.data
    if not isinstance(data, Mapping):
        return []
    if "goal" not in data and "task" not in data:
        return [document.issue(("goal",), "nothing", "this key, or `task`, one of which is required")]
    if "task" not in data:
        return []
    beside = [key for key in ("goal", "via") if data.get(key)]
    where = {"goal": "a step of the task", "via": "`via` of a step of the task"}
    return [document.issue((key,), f"`{key}` beside a task", where[key]) for key in beside]


def _moving_first(document: Document, robot: Robot, places: _Places) -> list[Issue]:
    """Report joints that move at the start of a task and that its first step does not move."""
    if places.start is None or not places.task:
        return []
    state, first = places.start.state, places.task[0].value.action
    moved = first.joints if isinstance(first, Move) else ()
    issues = []
    for key, values in (("velocity", state.v), ("acceleration", state.a)):
        names = [name for name, rate in zip(robot.joint_names, values, strict=True) if rate and name not in moved]
        if names:
            found = f"{', '.join(names)} moving before {places.task[0].value.words}"
            issues.append(document.issue(("start", key), found, "a task whose first step is a `move` of these joints"))
    return issues


def source_of(spec: ProblemSpec, name: str, base: Path, robot: Robot) -> tuple[dict[str, Any], str]:
    """`Problem.source` and `Problem.hash`: the file's content with absolute paths, and its identity.

    Args:
        spec: the validated file.
        name: of the problem, when the file gives none.
        base: folder that meshes are relative to.
        robot: as loaded for the problem.
    """
    source = spec.model_dump(mode="json", exclude_none=True, by_alias=True)
    source["name"] = spec.name or name
    _in_one_form(source["scene"])
    digest = problem_hash(source, base, robot)
    source["robot"] = _named(spec, robot)
    for mesh in shape_files_of(source):
        mesh["file"] = str((base / mesh["file"]).resolve())
    return source, digest


def _in_one_form(scene: dict[str, Any]) -> None:
    """Say in one way what may be said in several: pairs in any order, polynomials with zeros at their end."""
    scene["allowed_collisions"] = sorted(sorted(pair) for pair in scene["allowed_collisions"])
    for body in scene["obstacles"]:
        if "motion" in body:
            body["motion"]["polynomial"] = ObstacleMotion.of_data(body["motion"]["polynomial"]).to_data()["polynomial"]


def _named(spec: ProblemSpec, robot: Robot) -> Any:
    """Return `robot:` with absolute paths."""
    if isinstance(spec.robot, str):
        return spec.robot if spec.robot in robot_names() else str(robot.source)
    return robot.reference.robot


def _states(draft: Draft, places: _Places) -> list[StatedState]:
    """The start and the goals of joint values, with what each is."""
    states = [StatedState(part.place, part.value, False) for part in places.goal if isinstance(part.value, JointGoal)]
    if places.start is None or draft.start is None:
        return states
    return [StatedState(draft.start.place, places.start, True), *states]


def _constraints(document: Document, robot: Robot, scene: Scene, draft: Draft, places: _Places) -> list[Issue]:
    """Report constraints that the start, or every goal of joint values, violates, and pairs that none can hold."""
    issues = []
    for part in places.constraints:
        low, high = part.value.during
        kept, expected = BrokenConstraint(part.value, robot, scene), f"one that holds {_name(part)}"
        for k, why in kept.unchecked():
            issues.append(document.issue((*part.place, "pairs", k), why, "two bodies that are checked for collision"))
        if low == 0.0 and places.start is not None and draft.start is not None:
            broken = kept.words(places.start.state)
            issues += [document.issue(draft.start.place, f"a start that is {words}", expected) for words in broken]
        ends = [(end.place, end.value.state) for end in places.goal if isinstance(end.value, JointGoal)]
        found = [(place, words) for place, state in ends for words in kept.words(state)[:1]]
        if high == 1.0 and found and len(found) == len(draft.goal):
            issues += [document.issue(place, f"a goal that is {words}", expected) for place, words in found]
    return issues


def _name(part: LocatedValue[PathConstraint]) -> str:
    return field_name(part.place)


def _collisions(
    document: Document,
    models: tuple[CollisionModel, CollisionModel],
    draft: Draft,
    places: _Places,
) -> list[Issue]:
    """Report a start, or by the second model a via, or a goal with all alternatives, in collision."""
    model, later = models
    issues = []
    cure = "bodies that are apart (or a pair of scene.allowed_collisions)"
    if places.start is not None and draft.start is not None:
        found = free_check(model, places.start.q).reason
        if found:
            place = (*draft.start.place, draft.start.value.kind)
            issues.append(document.issue(place, f"the start is in collision: {found}", cure))
    for via in places.vias:
        found = free_check(later, via.value.at.q).reason if isinstance(via.value.at, JointGoal) else ""
        if found:
            issues.append(document.issue(via.place, f"the via is in collision: {found}", cure))
    hits: list[tuple[Place, str]] = []
    for part in places.goal:
        if isinstance(part.value, JointGoal):
            found = free_check(later, part.value.q).reason
            if found:
                hits.append((part.place, found))
    if len(hits) == len(draft.goal):
        issues += [document.issue(place, f"the goal is in collision: {found}", cure) for place, found in hits]
    return issues
