"""The way in: a problem file becomes a `Problem`, or every reason why it cannot."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel, Contact
from optiplan.config.document import Document, Place, read_yaml, validate
from optiplan.errors import InputError, Issue
from optiplan.files import reading
from optiplan.geometry.scene import Scene
from optiplan.problem.builder import Compiler, RobotLoader
from optiplan.problem.hashing import meshes_of, problem_hash
from optiplan.problem.partial import Draft, LocatedValue
from optiplan.problem.problem import Goal, JointGoal, Objective, PoseGoal, Problem, Via
from optiplan.problem.schema import ProblemSpec
from optiplan.problem.to_data import goal_data, scene_data, via_data
from optiplan.resources import robots_dir
from optiplan.robot.robot import Robot, load_robot, robot_names

TOUCHING = 1e-12
"""Bodies nearer than this, m, are in collision: contact itself is refused, rounding of a zero apart."""

DECIDES_COLLISIONS = ("robot", "group", "locked", "scene.allowed_collisions", "scene.attached")
"""Where an issue stands in these fields, collisions found would be no news about the file."""


@dataclass(frozen=True)
class _Loaded:
    """What a file gave: the problem if there are no issues."""

    problem: Problem | None
    issues: tuple[Issue, ...]


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the motion begins, ends and passes, as far as that can be used."""

    start: Array | None
    goal: Sequence[LocatedValue[JointGoal | PoseGoal]]
    vias: Sequence[LocatedValue[Via]]


def load_problem(path: Path | str, folders: Iterable[Path | str] | None = None, **overrides: Any) -> Problem:
    """Read a problem file.

    Args:
        path: the YAML file; meshes and robot files are looked for beside it.
        folders: the only ones from which any file is read, that of the problem, robots and meshes included, besides
            the robots that come with OptiPlan; None allows all. Links are followed before it is looked where they lead.
        overrides: values that stand in for the file's at the top level, such as `seed=3` or `planner="quintic"`.

    Raises:
        InputError: the file cannot be used; holds every issue found, in file order.
    """
    with reading(_with_robots(folders)):
        document = read_yaml(path)
        if overrides and isinstance(document.data, dict):
            document = replace(document, data=document.data | overrides)
        return _problem(_read(document, Path(path).resolve().parent))


def problem_from_dict(
    data: Mapping[str, Any],
    base: Path | str = ".",
    robots: RobotLoader = load_robot,
    folders: Iterable[Path | str] | None = None,
) -> Problem:
    """A problem from the content of a problem file; numpy arrays and paths may stand for lists and text.

    Also the inverse of `Problem.source`.

    Args:
        data: as in a file.
        base: folder that meshes and robot files are relative to.
        robots: loads a robot; for whoever keeps those that were loaded before.
        folders: as of `load_problem`.

    Raises:
        InputError: as `load_problem`, without lines.
    """
    with reading(_with_robots(folders)):
        return _problem(_read(Document(Path("<problem>"), _plain(data), {}), Path(base).resolve(), robots))


def check_file(path: Path | str, folders: Iterable[Path | str] | None = None) -> list[Issue]:
    """Everything that is wrong with a problem file, in file order; a part that does not fit hides no other."""
    with reading(_with_robots(folders)):
        try:
            document = read_yaml(path)
        except InputError as error:
            return list(error.issues)
        return list(_read(document, Path(path).resolve().parent).issues)


def _with_robots(folders: Iterable[Path | str] | None) -> list[Path | str] | None:
    return None if folders is None else [*folders, robots_dir()]


def _problem(reading: _Loaded) -> Problem:
    if reading.problem is None:
        raise InputError(reading.issues)
    return reading.problem


def _read(document: Document, base: Path, robots: RobotLoader = load_robot) -> _Loaded:
    spec, issues = _schema(document)
    compiler = Compiler(document, base, Draft.of_data(document.data) if spec is None else Draft.of_spec(spec))
    robot = compiler.robot(robots)
    scene = compiler.scene(robot)
    places = _Places(None, (), ())
    if robot is not None:
        places = _Places(compiler.start(robot), compiler.goal(robot), compiler.vias(robot))
    issues += compiler.issues
    if robot is not None and not any(issue.field.startswith(DECIDES_COLLISIONS) for issue in issues):
        issues += _collisions(document, CollisionModel(robot, scene), compiler.draft, places)
    if issues or spec is None or robot is None or places.start is None:
        return _Loaded(None, tuple(sorted(issues, key=lambda issue: issue.line or 0)))
    goal, vias = tuple(part.value for part in places.goal), tuple(part.value for part in places.vias)
    return _Loaded(_assemble(spec, document, base, (robot, scene, places.start, goal, vias)), ())


def _schema(document: Document) -> tuple[ProblemSpec | None, list[Issue]]:
    try:
        return validate(ProblemSpec, document), []
    except InputError as error:
        return None, list(error.issues)


def _assemble(
    spec: ProblemSpec,
    document: Document,
    base: Path,
    parts: tuple[Robot, Scene, Array, Goal, tuple[Via, ...]],
) -> Problem:
    robot, scene, start, goal, vias = parts
    source, digest = source_of(spec, document.path.stem.strip("<>"), base, robot)
    return Problem(
        name=source["name"],
        robot=robot,
        scene=scene,
        start=start,
        goal=goal,
        vias=vias,
        limits=robot.limits.scaled(**spec.limits.model_dump()),
        objective=Objective(spec.objective.time, spec.objective.jerk),
        planner=spec.planner.name,
        options=dict(spec.planner.model_extra or {}),
        seed=spec.seed,
    ).identified(source, digest, _changed)


def source_of(spec: ProblemSpec, name: str, base: Path, robot: Robot) -> tuple[dict[str, Any], str]:
    """`Problem.source` and `Problem.hash`: the file's content with absolute paths, and its identity.

    Args:
        spec: the validated file.
        name: of the problem, when the file gives none.
        base: folder that meshes are relative to.
        robot: as loaded for the problem.
    """
    source = spec.model_dump(mode="json", exclude_none=True)
    source["name"] = spec.name or name
    digest = problem_hash(source, base, robot)
    if spec.robot not in robot_names():
        source["robot"] = str(robot.source)
    for mesh in meshes_of(source):
        mesh["file"] = str((base / mesh["file"]).resolve())
    return source, digest


def _changed(problem: Problem, changes: Mapping[str, Any]) -> Problem:
    """The problem with other parts, read from its source with these in it; it keeps its robot and its seed.

    Raises:
        InputError: what a file with these parts would be refused for.
    """
    data = dict(problem.source) | {_AS_DATA[part][0]: _AS_DATA[part][1](value) for part, value in changes.items()}
    return problem_from_dict(data, "/", lambda *_: problem.robot).with_seed(problem.seed)


_AS_DATA: Mapping[str, tuple[str, Callable[[Any], Any]]] = {
    "start": ("start", lambda start: {"joints": np.asarray(start, dtype=float).tolist()}),
    "goal": ("goal", goal_data),
    "vias": ("via", via_data),
    "scene": ("scene", scene_data),
    "limits": ("limits", dict),
}
"""Parts that `Problem.with_…` changes: key of the file, and how the part stands there."""


def _collisions(
    document: Document,
    model: CollisionModel,
    draft: Draft,
    places: _Places,
) -> list[Issue]:
    """The start in collision, a via, or every alternative of the goal."""
    issues = []
    cure = "bodies that are apart (or a pair of scene.allowed_collisions)"
    if places.start is not None and draft.start is not None:
        found = _touching(model, places.start)
        if found:
            place = (*draft.start.place, draft.start.value.kind)
            issues.append(document.issue(place, f"the start is in collision: {found}", cure))
    for via in places.vias:
        found = _touching(model, via.value.at.q) if isinstance(via.value.at, JointGoal) else ""
        if found:
            issues.append(document.issue(via.place, f"the via is in collision: {found}", cure))
    hits: list[tuple[Place, str]] = []
    for part in places.goal:
        if isinstance(part.value, JointGoal):
            found = _touching(model, part.value.q)
            if found:
                hits.append((part.place, found))
    if len(hits) == len(draft.goal):
        issues += [document.issue(place, f"the goal is in collision: {found}", cure) for place, found in hits]
    return issues


def _touching(model: CollisionModel, q: Array) -> str:
    """The bodies that touch at q, the deepest first, in words; empty when none do."""
    contacts = sorted(model.contacts(q, TOUCHING), key=lambda contact: contact.distance)
    nearest = model.clearance(q) if not contacts and model.collides(q) else None
    contacts += [] if nearest is None else [nearest]  # touching by one query of coal, a rounding apart by the other
    words = [_depth(contact) for contact in contacts[:3]]
    rest = len(contacts) - len(words)
    within = None if contacts else model.contained(q)
    if within is not None:
        return f"'{within[0]}' is inside '{within[1]}'"
    return "; ".join(words) + (f"; and {rest} more pairs" if rest else "")


def _depth(contact: Contact) -> str:
    names = f"'{contact.pair.name_a}' and '{contact.pair.name_b}'"
    depth = max(0.0, -contact.distance) * 1e3
    return f"{names} overlap by {depth:.3g} mm" if depth >= 1e-3 else f"{names} touch"


def _plain(value: Any) -> Any:
    """Lists, mappings, numbers and text, as a YAML file would give them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value
