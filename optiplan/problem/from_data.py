"""Turn problem data into models and arrays, or report every issue."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optiplan.collision.floors import with_built
from optiplan.collision.kept_models import collision_model
from optiplan.config.document import Document, validate
from optiplan.config.messages import field_name
from optiplan.errors import InputError, Issue
from optiplan.geometry.safety import WISHED
from optiplan.geometry.scene import Scene
from optiplan.problem.builder import HIT, Compiler, RobotLoader
from optiplan.problem.free_space import touching
from optiplan.problem.goals_and_vias import GoalEnd, JointGoal, Via
from optiplan.problem.hashing import source_of
from optiplan.problem.nonzero_ends import StatedState, impossible_states
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.partial import LocatedValue, mapping
from optiplan.problem.schema.frames import in_world
from optiplan.problem.schema.joint_names import Orders, joint_orders, with_lists, with_names
from optiplan.problem.schema.loops import written_out
from optiplan.problem.schema.problem import ProblemSpec
from optiplan.problem.schema.safety import safety_of
from optiplan.problem.schema.side_by_side import in_words_of, with_groups_of_arms, with_one_robot
from optiplan.problem.tools.reading import ToolsInUse, as_frames, read_tools, without_tools
from optiplan.problem.tools.tool import MountedTool
from optiplan.problem.tracking_error import StatedEnd, error_of_joints, nearer_than_error
from optiplan.records import dataclass
from optiplan.robot.frames import link_names
from optiplan.robot.given_configurations import wrong_names
from optiplan.robot.robot import Robot, load_robot

if TYPE_CHECKING:
    from optiplan.problem.constraints.statements import PathConstraint
    from optiplan.problem.task.steps import TaskStep


DECIDES_COLLISIONS = (("robot",), ("group",), ("locked",), ("scene", "allowed_collisions"), ("scene", "attached"))
"""Where an issue stands in these fields, collisions found would be no news about the file."""


@dataclass(frozen=True, eq=False)
class _ProblemParts:
    """The robot where it stands, its scene, and the valid start, goal, vias, steps and constraints."""

    robot: Robot
    scene: Scene
    start: JointGoal | None
    goal: Sequence[LocatedValue[GoalEnd]]
    vias: Sequence[LocatedValue[Via]]
    task: "Sequence[LocatedValue[TaskStep]]"
    constraints: "Sequence[LocatedValue[PathConstraint]]"
    tools: tuple[MountedTool, ...] = ()

    @property
    def joint_goals(self) -> list[LocatedValue[JointGoal]]:
        """The goals of joint values."""
        return [LocatedValue(end.place, end.value) for end in self.goal if isinstance(end.value, JointGoal)]

    @property
    def joint_vias(self) -> list[LocatedValue[JointGoal]]:
        """The vias of joint values."""
        return [LocatedValue(via.place, via.value.at) for via in self.vias if isinstance(via.value.at, JointGoal)]


def read_problem(document: Document, base: Path, robots: RobotLoader = load_robot) -> Mapping[str, Any]:
    """Read a problem file: the attributes of its `Problem` by name.

    Args:
        document: the file.
        base: folder that meshes and robot files are relative to.
        robots: loads a robot.

    Raises:
        InputError: all issues, in file order.
    """
    document, wrong = written_out(document)
    if wrong:
        raise _error(wrong)
    document, wrong = _without_picks(document, base, robots)
    if wrong:
        raise _error(wrong)
    document, wrong = _without_frames(document, base, robots)
    stated = document
    document, twice = with_one_robot(document)
    document, _ = with_groups_of_arms(document)
    if wrong or twice:
        rest = _issues_of(document, base, robots)
        raise _error([*wrong, *twice, *in_words_of(stated, rest)])
    try:
        return _read_named(document, base, robots)
    except InputError as error:
        raise _error(in_words_of(stated, error.issues)) from None


def _without_frames(document: Document, base: Path, robots: RobotLoader) -> tuple[Document, list[Issue]]:
    """Return a problem file whose poses are all in the world, and what is wrong with those in frames."""
    return in_world(document, lambda: _robot_of(document, base, robots)[0])


def _without_picks(document: Document, base: Path, robots: RobotLoader) -> tuple[Document, list[Issue]]:
    """Return a problem file in which picks and places are plain steps, and what is wrong with them."""
    if not mapping(document.data).get("task"):
        return document, []
    from optiplan.problem.schema.picks import with_picks

    return with_picks(document, lambda: _robot_of(document, base, robots))


def _robot_of(document: Document, base: Path, robots: RobotLoader) -> tuple[Robot | None, Sequence[str]]:
    whole, _ = with_one_robot(document)
    compiler = Compiler(whole, base, whole.data)
    return compiler.robot(robots), compiler.main_joints


def planned_robot(document: Document, base: Path, robots: RobotLoader = load_robot) -> Robot:
    """Return the robot of a problem file in one form, with all joints that its steps move, as `Problem.hash` takes it.

    Raises:
        InputError: there is no such robot.
    """
    compiler = Compiler(document, base, document.data)
    if (robot := compiler.robot(robots)) is None:
        raise _error(compiler.issues)
    return robot


def _issues_of(document: Document, base: Path, robots: RobotLoader) -> Sequence[Issue]:
    try:
        _read_named(document, base, robots)
    except InputError as error:
        return error.issues
    return ()


def in_one_form(document: Document, base: Path, robots: RobotLoader = load_robot) -> Document:
    """Return a problem file as the schema has it: without loops, frames and `robots`, joint values as lists.

    Raises:
        InputError: what is wrong with these; not with the rest.
    """
    document, wrong = written_out(document)
    if not wrong:
        document, wrong = _without_picks(document, base, robots)
    if not wrong:
        document, wrong = _without_frames(document, base, robots)
    if not wrong:
        document, wrong = with_one_robot(document)
    if not wrong:
        document, wrong = with_groups_of_arms(document)
    if wrong:
        raise _error(wrong)
    given, wanted, wrong = _orders(document, base, robots)
    if wrong:
        raise _error(wrong)
    return with_lists(document, wanted) if given else document


def _orders(document: Document, base: Path, robots: RobotLoader) -> "tuple[Orders, Orders, list[Issue]]":
    """Return the orders of joint values by name as written and as the robot has them; and wrong names."""
    given = joint_orders(document.data)
    if not given:
        return given, given, []
    listed = with_lists(document, given)
    compiler = Compiler(listed, base, listed.data)
    robot = compiler.robot(robots)
    if robot is None:
        return given, given, []
    wanted = {place: compiler.joints_at(robot, place) or names for place, names in given.items()}
    return given, wanted, _wrong_names(document, given, wanted)


def _read_named(document: Document, base: Path, robots: RobotLoader) -> Mapping[str, Any]:
    """Read a problem file whose poses are in the world."""
    given, wanted, wrong = _orders(document, base, robots)
    if not given:
        return _read_lists(document, base, robots)
    if wrong:
        raise _error(wrong + with_names(document, _schema(with_lists(document, given))[1], given))
    try:
        return _read_lists(with_lists(document, wanted), base, robots)
    except InputError as error:
        raise _error(with_names(document, error.issues, wanted)) from None


def _wrong_names(document: Document, given: "Orders", wanted: "Orders") -> list[Issue]:
    """Report joints that are unknown at their place, and values that do not name every joint."""
    issues = []
    for place, names in given.items():
        for joint, found, expected in wrong_names(wanted[place], names):
            issues.append(document.issue(place if joint is None else (*place, joint), found, expected))
    return issues


def _error(issues: Iterable[Issue]) -> InputError:
    return InputError(sorted(issues, key=lambda issue: issue.line or 0))


def _read_lists(document: Document, base: Path, robots: RobotLoader) -> Mapping[str, Any]:
    """Read a problem file whose joint values are lists."""
    spec, issues = _schema(document)
    compiler = Compiler(document, base, spec or document.data)
    robot = compiler.robot(robots)
    scene, unsafe = _with_safety(compiler, spec, robot)
    parts = None if robot is None else _parts(compiler, without_tools(robot), scene)
    issues += [] if any(issue.field == "file" for issue in issues) else goal_or_task(document)
    issues += compiler.issues + (unsafe if robot is not None else [])
    limits = error = None
    if parts is not None:
        limits = parts.robot.limits.scaled(**({} if spec is None else dict(spec.limits)))
        issues += _moving_first(document, parts)
        issues += _constraints(document, parts, len(compiler.goal_specs))
        error, wrong = error_of_joints(document, parts.robot, None if spec is None else spec.tracking_error)
        issues += wrong + nearer_than_error(
            document, parts.robot, limits, error, _alternatives(parts, len(compiler.goal_specs))
        )
        issues += impossible_states(document, parts.robot, limits, _states(parts))
        if not any(issue.path[: len(place)] == place for issue in issues for place in DECIDES_COLLISIONS):
            issues += _collisions(document, parts, compiler)
    if issues or spec is None or parts is None or limits is None or error is None or parts.start is None:
        raise _error(issues)
    source, digest = source_of(spec, document.path.stem.strip("<>"), base, parts.robot)
    return {
        "name": source["name"],
        "robot": parts.robot,
        "scene": parts.scene,
        "tools": parts.tools,
        "start": parts.start.state.q,
        "start_velocity": parts.start.state.v,
        "start_acceleration": parts.start.state.a,
        "goal": tuple(part.value for part in parts.goal),
        "limits": limits,
        "tracking_error": error,
        "wished_clearance": WISHED if spec.clearance is None else 0.0,
        "vias": tuple(part.value for part in parts.vias),
        "task": tuple(part.value for part in parts.task),
        "objective": Objective(**{part: weight for part, weight in spec.objective if weight is not None}),
        "path_constraints": tuple(part.value for part in parts.constraints),
        "planner": spec.planner.name,
        "options": dict(spec.planner.model_extra or {}),
        "seed": spec.seed,
        "source": source,
        "hash": digest,
    }


def _with_safety(compiler: Compiler, spec: ProblemSpec | None, robot: Robot | None) -> tuple[Scene, list[Issue]]:
    """Return the scene with the clearance that is required in it, and what is wrong with that."""
    scene = compiler.scene(robot)
    tools = [body for _, name, tool in compiler.tools for body in tool.bodies_of(name)]
    links = () if robot is None else link_names(robot.model)
    clearance = None if spec is None else spec.clearance
    safety, unsafe = safety_of(compiler.document, clearance, scene, [*links, *tools], robot)
    safety = safety if robot is None else with_built(safety, robot)
    unwished = clearance is not None and safety is None
    return scene if clearance is None else replace(scene, safety=safety, unwished=unwished), unsafe


def _parts(compiler: Compiler, bare: Robot, stated: Scene) -> _ProblemParts:
    tools = ToolsInUse(read_tools(compiler, bare, stated), stated)
    scene = tools.at_first(stated)
    mounted = compiler.mounted(bare, scene)
    seen = tools.seen(mounted)
    ends = compiler.start(seen), compiler.goal(seen), compiler.vias(seen)
    constraints = compiler.constraints(seen, scene)
    steps = _steps(compiler, mounted, scene, tools, constraints) if compiler.task else []
    scene = as_frames(scene, compiler.followed)
    robot = tools.all_tools(mounted, scene)
    return _ProblemParts(robot, scene, *ends, steps, constraints, tuple(tools.by_name.values()))


def _steps(
    compiler: Compiler,
    robot: Robot,
    scene: Scene,
    tools: ToolsInUse,
    constraints: "Sequence[LocatedValue[PathConstraint]]",
) -> "list[LocatedValue[TaskStep]]":
    from optiplan.problem.task.reading import TaskReader

    reader = TaskReader(compiler, robot, scene, tools)
    steps = reader.steps()
    reader.check_whole(constraints)
    return steps


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
    given = {key for key in ("goal", "task") if data.get(key) is not None}
    if not given:
        return [document.issue(("goal",), "nothing", "this key, or `task`, one of which is required")]
    if "task" not in given:
        return []
    beside = [key for key in ("goal", "via") if data.get(key)]
    where = {"goal": "a step of the task", "via": "`via` of a step of the task"}
    return [document.issue((key,), f"`{key}` beside a task", where[key]) for key in beside]


def _moving_first(document: Document, parts: _ProblemParts) -> list[Issue]:
    """Report joints that move at the start of a task and that its first step does not move."""
    if parts.start is None or not parts.task:
        return []
    from optiplan.problem.task.steps import Move

    state, first = parts.start.state, parts.task[0].value
    moved = first.action.joints if isinstance(first.action, Move) else ()
    issues = []
    for key, values in (("velocity", state.v), ("acceleration", state.a)):
        rates = zip(parts.robot.joint_names, values, strict=True)
        names = [name for name, rate in rates if rate and name not in moved]
        if names:
            found = f"{', '.join(names)} moving before {first.words}"
            issues.append(document.issue(("start", key), found, "a task whose first step is a `move` of these joints"))
    return issues


def _states(parts: _ProblemParts) -> "list[StatedState]":
    """The start and the goals of joint values, with what each is."""
    start = [] if parts.start is None else [StatedState(("start",), parts.start, True)]
    return [*start, *(StatedState(end.place, end.value, False) for end in parts.joint_goals)]


def _constraints(document: Document, parts: _ProblemParts, alternatives: int) -> list[Issue]:
    """Report constraints that the start, a via or every goal of joint values violates, and pairs that none can hold."""
    issues: list[Issue] = []
    if not parts.constraints:
        return issues
    from optiplan.problem.constraints.base import WHOLE
    from optiplan.problem.constraints.states import BrokenConstraint

    for part in parts.constraints:
        low, high = part.value.during
        kept = BrokenConstraint(part.value, parts.robot, parts.scene)
        expected = f"one that holds {field_name(part.place)}"
        for k, why in kept.unchecked():
            issues.append(document.issue((*part.place, "pairs", k), why, "two bodies that are checked for collision"))
        if low == 0.0 and parts.start is not None:
            broken = kept.words(parts.start.state)
            issues += [document.issue(("start",), f"a start that is {words}", expected) for words in broken]
        if not kept.decided_by_an_end:
            continue
        for via in parts.joint_vias:
            broken = kept.words(via.value.state) if (low, high) == WHOLE and via.value.tolerance <= HIT else []
            issues += [document.issue(via.place, f"a via that is {words}", expected) for words in broken]
        found = [(end.place, words) for end in parts.joint_goals for words in kept.words(end.value.state)[:1]]
        if high == 1.0 and found and len(found) == alternatives:
            issues += [document.issue(place, f"a goal that is {words}", expected) for place, words in found]
    return issues


def _alternatives(parts: _ProblemParts, goals: int) -> Iterator[list[StatedEnd]]:
    """Yield lists of joint values, one of each of which the motion comes to; `goals`: how many alternatives there are.

    They are the start, vias, a goal, and the ends of the moves of a task.
    """
    names = parts.robot.joint_names
    if parts.start is not None:
        yield [StatedEnd(("start",), parts.start.q, names)]
    yield from ([StatedEnd(via.place, via.value.q, names)] for via in parts.joint_vias if via.value.tolerance <= HIT)
    if len(parts.joint_goals) == goals:
        yield [StatedEnd(end.place, end.value.q, names) for end in parts.joint_goals]
    if not parts.task:
        return
    from optiplan.problem.task.steps import Move

    for action, place in ((part.value.action, (*part.place, part.value.kind)) for part in parts.task):
        if isinstance(action, Move):
            ends = [end for end in action.goal if isinstance(end, JointGoal)]
            yield [StatedEnd(place, end.q, action.joints) for end in ends if len(ends) == len(action.goal)]


def _collisions(document: Document, parts: _ProblemParts, compiler: Compiler) -> list[Issue]:
    """Report a start, a via, or a goal with all alternatives, in collision."""
    scene = parts.scene
    model = collision_model(parts.robot, scene)
    # by the time of a via or a goal, what moves may be elsewhere
    later = collision_model(parts.robot, scene.standing) if scene.dynamic_obstacles else model
    issues = []
    cure = "bodies that are apart (or a pair of scene.allowed_collisions)"
    if parts.start is not None and compiler.start_spec is not None:
        at_start, of_task = model, ""
        if parts.task:
            from optiplan.problem.task.scene_change import scene_at_start

            of_task = ", or of allowed_collisions of the first step"
            at_start = collision_model(parts.robot, scene_at_start(scene, [part.value for part in parts.task]))
        found = touching(at_start, parts.start.q)
        if found is not None:
            place = ("start", compiler.start_spec.kind)
            issues.append(document.issue(place, f"the start is in collision: {found.reason}", f"{cure[:-1]}{of_task})"))
    for via in parts.joint_vias:
        found = touching(later, via.value.q)
        if found is not None:
            issues.append(document.issue(via.place, f"the via is in collision: {found.reason}", cure))
    ends = [(end.place, touching(later, end.value.q)) for end in parts.joint_goals]
    hits = [(place, found) for place, found in ends if found is not None]
    if len(hits) == len(compiler.goal_specs):
        issues += [document.issue(place, f"the goal is in collision: {met.reason}", cure) for place, met in hits]
    return issues
