"""Statements of a problem, and whether a check was made of each: what nothing was checked of is not verified."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from optiplan.config.messages import some
from optiplan.geometry.scene import Attachment, Scene
from optiplan.problem.problem import Problem
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.verify.report import Check

if TYPE_CHECKING:
    from optiplan.problem.task.steps import Move, StraightLine, TaskStep


MOST_NAMED = 6
"""Statements without a check that a report names."""


def covering(check: Check, *statements: str) -> Check:
    """Return the check with these among the statements that it is a check of."""
    return replace(check, covers=(*check.covers, *statements))


def complete(problem: Problem, checks: Sequence[Check], besides: Sequence[str] = ()) -> Check:
    """Check that every statement of the problem, and those `besides`, have a check that was made of them."""
    stated = list(dict.fromkeys([*statements(problem), *besides]))
    covered = {one for check in checks for one in check.covers}
    lacking = [one for one in stated if one not in covered]
    if not lacking:
        return Check("statements", "exact", True, detail=f"{len(stated)} statements of the problem, each with a check")
    return Check("statements", "exact", False, detail=f"no check was made of {some(lacking, MOST_NAMED)}")


def statements(problem: Problem) -> Iterator[str]:
    """Yield a name of everything that a motion for this problem must keep to.

    A field that is not known here is a statement too, of which no check is made: who adds one says what it means.
    """
    for name in (field.name for field in fields(problem)):
        if name in _OF_PROBLEM:
            yield from _OF_PROBLEM[name](problem)
        elif name not in _LABELS:
            yield name


def steps(k: int, step: "TaskStep") -> list[str]:
    """Return the statements of step k of a task."""
    kind, known = type(step.action), _of_actions()
    own = known[kind](step.action) if kind in known else [kind.__name__]
    constraints = [constraint(i, step_place(k)) for i in range(len(step.constraints))]
    waits = [f"wait[{number}]" for number in step.waits]
    rides = [] if step.ride is None else ["ride"]
    return [f"{step_place(k)}.{one}" for one in ("standstill", *own, *rides, *waits)] + constraints


def arms(problem: Problem) -> list[str]:
    """Return the statement that arms beside each other stand still between their steps."""
    from optiplan.problem.task.arms import several_arms

    return ["task.arms"] if several_arms(problem.task) else []


def tours(problem: Problem) -> list[str]:
    """Return the statements of the orders of tours, by the numbers of their steps."""
    from optiplan.problem.task.steps import TargetTour

    return [tour(step) for step in problem.task if isinstance(step.action, TargetTour)]


def tour(step: "TaskStep") -> str:
    """Return the statement that the targets of a tour are visited in an order as stated."""
    return f"tour of step {step.number}"


def choices(problem: Problem) -> list[str]:
    """Return the statements that of the alternatives of each choice one is done."""
    from optiplan.problem.task.choices import choices_of

    return [choice(number) for number in choices_of(problem.task)]


def choice(number: int) -> str:
    """Return the statement that one alternative of a choice is done."""
    return f"task.either[{number}]"


def tool(name: str) -> str:
    """Return the statement that a tool has its TCP, bodies and mass."""
    return f"tools.{name}"


def step_place(k: int) -> str:
    """Return what the statements of step k begin with."""
    return f"task[{k}]"


def constraint(k: int, place: str = "") -> str:
    """Return the statement of the k-th path constraint, of a step at `place`."""
    return f"{place}{'.' if place else ''}path_constraints[{k}]"


def bodies_of_file(problem: Problem) -> list[str]:
    """Return the statements of the bodies that the file of a problem has, whatever its scene was made of."""
    scene = problem.source.get("scene", {})
    return [body(one["name"]) for key in ("obstacles", "attached") for one in scene.get(key, ())]


def repeated(scene: Scene) -> list[str]:
    """Return the names that several bodies of a scene have: a check of one would pass for that of another."""
    return [name for name, count in Counter(scene.names).items() if count > 1]


def body(name: str) -> str:
    """Return the statement that a body of the scene is in the way."""
    return f"scene.{name}"


def motion(name: str) -> str:
    """Return the statement that an obstacle moves."""
    return f"scene.{name}.motion"


def tube(problem: Problem, *of: str) -> list[str]:
    """Return the statements that these hold wherever joints are within the tracking error; none where it is 0."""
    return [f"tracking_error.{one}" for one in of] if problem.tracking_error.any() else []


def masses(scene: Scene, robot: Robot) -> list[str]:
    """Return the statements of masses of attached objects that the robot carries."""
    return [_mass(held) for held in scene.attached if held.mass and _carried(held, robot)]


def safety(scene: Scene) -> list[str]:
    """Return the statement that bodies stay apart by a distance; none where it is 0."""
    return [] if scene.safety is None else ["scene.safety"]


def _mass(held: Attachment) -> str:
    return f"scene.{held.name}.mass"


def _carried(held: Attachment, robot: Robot) -> bool:
    own = held.inertia_in_link()
    return any(link == held.link and inertia.isApprox(own, 1e-9) for link, inertia in robot.mounting.payload)


def _scene(problem: Problem) -> list[str]:
    scene = problem.scene
    bodies = [body(name) for name in scene.names]
    bodies += [f"{body(name)}, of which there are {scene.names.count(name)}" for name in repeated(scene)]
    moving = [motion(one.name) for one in scene.dynamic_obstacles]
    heavy = [_mass(held) for held in scene.attached if held.mass]
    unknown = [f"scene.{field.name}" for field in fields(Scene) if field.name not in _OF_SCENE]
    return bodies + moving + heavy + safety(scene) + unknown


def _task(problem: Problem) -> list[str]:
    return [*(one for k, step in enumerate(problem.task) for one in steps(k, step)), *arms(problem)]


_OF_SCENE = frozenset({"obstacles", "attached", "allowed", "safety", "unwished"})
"""Fields of a scene that are known; what may touch, and that nothing is wished, is no requirement."""

_LABELS = frozenset({"name", "planner", "options", "seed", "source", "hash", "objective", "wished_clearance"})
"""Fields of a problem that require nothing of a motion; the objective is what it costs."""

_OF_PROBLEM: Mapping[str, Callable[[Problem], Iterable[str]]] = {
    "robot": lambda problem: ["robot.joints", "robot.links"],
    "scene": _scene,
    "start": lambda problem: ["start"],
    "start_velocity": lambda problem: ["start_velocity"],
    "start_acceleration": lambda problem: ["start_acceleration"],
    "goal": lambda problem: ["goal"] if problem.goal or not problem.task else [],
    "tracking_error": lambda problem: tube(problem, "clearance", "limits"),
    "limits": lambda problem: [f"limits.{field.name}" for field in fields(Limits)],
    "tools": lambda problem: [tool(one.name) for one in problem.tools],
    "vias": lambda problem: [f"vias[{k}]" for k in range(len(problem.vias))],
    "task": lambda problem: _task(problem) if problem.task else [],
    "path_constraints": lambda problem: [constraint(k) for k in range(len(problem.path_constraints))],
}


def _move(action: "Move") -> list[str]:
    rest = ["rest"] if action.rests else []
    return ["end", *rest, *(f"via[{k}]" for k in range(len(action.vias)))]


def _line(action: "StraightLine") -> list[str]:
    """A corner that may be rounded off is no end."""
    speed = ["speed"] if action.speed < float("inf") else []
    return ["line", *speed, *([] if action.blend > 0.0 else ["end"])]


@cache
def _of_actions() -> Mapping[type, Callable[[Any], list[str]]]:
    from optiplan.problem.seams.actions import Passing, SeamPart, Transit
    from optiplan.problem.task.rides import WaitUntil
    from optiplan.problem.task.steps import Attach, ChangeTool, Detach, Dwell, Move, StraightLine

    return {
        Move: _move,
        StraightLine: _line,
        Attach: lambda _: ["event"],
        Detach: lambda _: ["event"],
        ChangeTool: lambda _: ["event", "tool"],
        Dwell: lambda _: ["dwell"],
        WaitUntil: lambda _: ["wait_until"],
        Transit: lambda _: [],
        SeamPart: lambda _: ["path", "axis", "speed"],
        Passing: lambda _: ["event"],
    }
