"""Read which arm does a step of a task, and for which steps of other arms it waits."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.geometry.scene import Scene
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.problem.builder import Compiler
from optiplan.problem.constraints.statements import BY_SCENE
from optiplan.problem.goals_and_vias import AllOfGoal
from optiplan.problem.partial import LocatedValue
from optiplan.problem.seams.actions import SeamPath
from optiplan.problem.task.arms import joints_of_arms, several_arms
from optiplan.problem.task.steps import Attach, ChangeTool, Detach, Move, StraightLine, TargetTour, TaskStep
from optiplan.robot.robot import Robot

Steps = Sequence[LocatedValue[TaskStep]]


def with_arms(compiler: Compiler, robot: Robot, scene: Scene, steps: Steps) -> list[LocatedValue[TaskStep]]:
    """Return the steps with those for which each waits; what is wrong with arms goes to the compiler's issues.

    A step that takes an object waits for the step of another arm that released it. The order of the file is one in
    which all steps could be done one after another, so a step waits for earlier ones only.
    """
    if not several_arms([step.value for step in steps]):
        for said in compiler.task:
            if said.value.wait_for:
                compiler.report((*said.place, "wait_for"), "a step without `arm`", "`arm` in every step of the task")
        return list(steps)
    _check(compiler, robot, scene, steps)
    stated = dict(_stated(compiler))
    released: dict[str, TaskStep] = {}
    found: list[LocatedValue[TaskStep]] = []
    for part in steps:
        step, waits = part.value, list(stated.get(part.value.number, ()))
        if isinstance(step.action, Attach):
            before = released.get(step.action.body)
            waits += [] if before is None or before.arm == step.arm else [before.number]
        elif isinstance(step.action, Detach):
            released[step.action.body] = step
        first = not found or found[-1].value.number != step.number  # an approach is two, of which the first waits
        own = tuple(dict.fromkeys(waits)) if first else ()
        found.append(LocatedValue(part.place, replace(step, waits=own)))
    return found


def _stated(compiler: Compiler) -> Iterator[tuple[int, list[int]]]:
    """Yield the numbers of steps for which a step says that it waits: of each name the last before it."""
    earlier: dict[str, dict[str, int]] = {}
    for part in compiler.task:
        number, waits, own = int(part.place[-1]) + 1, [], str(part.value.arm)
        named = part.value.wait_for or ()
        others = {name: [arm for arm in arms if arm != own] for name, arms in earlier.items()}
        known = [name for name, arms in others.items() if len(arms) == 1]
        for k, name in enumerate(named):
            if name in known:
                waits.append(earlier[name][others[name][0]])
                continue
            arms = others.get(name)
            found = (
                f"the name of steps of {' and of '.join(arms)}" if arms else "no name of an earlier step of another arm"
            )
            expected = choices(name, known or ["none: no earlier step of another arm has a name of its own"])
            place = (*part.place, "wait_for") if len(named) == 1 else (*part.place, "wait_for", k)
            compiler.report(place, f"'{name}', {found}", expected)
        if part.value.name is not None:
            earlier.setdefault(part.value.name, {})[own] = number
        yield number, waits


def _check(compiler: Compiler, robot: Robot, scene: Scene, steps: Steps) -> None:
    """Report steps without an arm, joints and objects of two arms, and what is not proved beside other arms."""
    for spec in compiler.task:
        if spec.value.arm is None or spec.value.arm not in robot.groups:
            name = spec.value.arm
            found = "a step without `arm` in a task of several" if name is None else f"unknown arm '{name}'"
            compiler.report((*spec.place, "arm"), found, choices(str(name), list(robot.groups)))
    for part in steps:
        place = part.place
        if isinstance(part.value.action, TargetTour | SeamPath | ChangeTool):
            compiler.report((*place, part.value.kind), f"a {part.value.kind} beside other arms", "moves and lines")
        for one in part.value.constraints:
            if isinstance(one, BY_SCENE):  # other arms take and release things meanwhile
                found = f"`{one.KEY}` of one step beside other arms"
                compiler.report((*place, "path_constraints"), found, "one of the whole problem")
    for part in steps:
        if part.value.timed:
            found = "a step that goes with what moves, or waits for it, beside other arms"
            compiler.report((*part.place, part.value.kind), found, "a task of one arm")
    if scene.dynamic_obstacles:
        compiler.report(("scene", "obstacles"), "an obstacle that moves, beside arms of a task", "obstacles that stand")
    joints = joints_of_arms([part.value for part in steps], robot.joint_names)
    _check_joints(compiler, robot, joints)
    held = {one.name: arm for one in scene.attached for arm in _movers(robot, one.link, joints)}
    _check_objects(compiler, robot, steps, joints, held)


def _check_joints(compiler: Compiler, robot: Robot, joints: Mapping[str, Sequence[int]]) -> None:
    """Report arms that move no joint, and joints that two arms move."""
    for arm, columns in joints.items():
        if not columns and arm in robot.groups:
            compiler.report(("task",), f"steps of {arm} that move no joint", "a move or a line of each arm")
        for other, theirs in joints.items():
            if arm < other and (shared := set(columns) & set(theirs)):
                name = robot.joint_names[min(shared)]
                found = f"joint {name}, which steps of {arm} and of {other} move"
                compiler.report(("task",), found, "arms with joints of their own")


def _check_objects(
    compiler: Compiler,
    robot: Robot,
    steps: Steps,
    joints: Mapping[str, Sequence[int]],
    held: Mapping[str, str],
) -> None:
    """Report objects taken by a link of another arm, or released by another arm than the one that holds it.

    And ends and constraints of a step that are about what another arm holds, which that may release meanwhile. `held`:
    which arm holds what at first.
    """
    holder = dict(held)
    for part in steps:
        step, action = part.value, part.value.action
        for key, frame in _frames(step):
            if holder.get(frame, step.arm) != step.arm:
                found = f"'{frame}', which {holder[frame]} holds"
                compiler.report((*part.place, key), found, f"what {step.arm} holds, or a frame of a robot")
        if isinstance(action, Attach):
            holder[action.body] = step.arm
            foreign = [arm for arm in _movers(robot, action.link, joints) if arm != step.arm]
            place: Place = (*part.place, "attach", "link")
            if foreign:
                compiler.report(place, f"'{action.link}', a link of {foreign[0]}", f"a link of {step.arm}")
        elif isinstance(action, Detach) and holder.get(action.body, step.arm) != step.arm:
            found = f"'{action.body}', which {holder[action.body]} holds"
            compiler.report((*part.place, "detach", "object"), found, f"what {step.arm} holds")


def _frames(step: TaskStep) -> Iterator[tuple[str, str]]:
    """Yield the frames that a step is about, each with the key under which it stands."""
    action = step.action
    if isinstance(action, StraightLine):
        yield step.kind, action.frame
    if isinstance(action, Move):
        ends = [*action.goal, *(via.at for via in action.vias)]
        ends += [part for end in ends if isinstance(end, AllOfGoal) for part in end.parts]
        yield from ((step.kind, str(getattr(end, "frame", ""))) for end in ends)
    for mention in (mention for one in step.constraints for mention in one.mentioned()):
        if mention.kind == "frame":
            yield "path_constraints", mention.name


def _movers(robot: Robot, link: str, joints: Mapping[str, Iterable[int]]) -> list[str]:
    """Return the arms whose joints move a link."""
    moved = joints_that_move(robot, link)
    return [arm for arm, columns in joints.items() if moved[list(columns)].any()]
