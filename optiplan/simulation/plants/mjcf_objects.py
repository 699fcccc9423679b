"""Objects of a task in MuJoCo: free bodies, what may meet what in each stage, and what a link holds."""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_change import carrying, held_body
from optiplan.problem.task.steps import Attach
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.mjcf_bodies import inertial_of, pose_of
from optiplan.simulation.plants.task_plant import FRICTION, FrictionGrip, objects_of
from optiplan.simulation.tasks.stages import TaskStage
from optiplan.trajectory.trajectory import Trajectory

LIGHT = 0.01
"""kg; mass of an object of which a task states none."""

RESTING = 5e-3
"""m; a held object is put down on bodies that the plan has nearer than this where it is taken or released."""

UNPLANNED, RESTED = 1, 2
"""What contact of a pair means in a stage: it is unplanned; or it is so away from where the object rests. Else 0."""

_HARD = "0.99 0.999 0.001 0.5 2"
"""Impedance of contacts of objects and of couplings: fingers are light, and press with much."""

_LATER = {"active": "false", "solref": "0.001 1", "solimp": _HARD}
"""Of welds and couplings: none holds at first; their time constant, s, is four steps of the plant."""

_MEETING = "0.002 1"
"""Likewise, of contacts of objects."""


@dataclass(frozen=True)
class Meeting:
    """Two bodies that may meet: their indices in the collision model of `TaskObjects`."""

    a: int
    b: int

    def names(self, parts: Sequence[Sequence[str]]) -> Iterator[tuple[str, str, str]]:
        """Return the names of the pairs of geoms: of the pair, and of both geoms."""
        for a in parts[self.a]:
            for b in parts[self.b]:
                yield f"{a} {b}", a, b


class TaskObjects:
    """The bodies of a task, and their stages.

    Attributes:
        names: of the objects that change hands.
        stages: of the motion.
        start: (n,), where it begins, rad or m.
        grip: by friction; None: by welds.
        bodies: names of all bodies, by the index of the collision model.
        robot: without their loads.
        scene: in which all of them are obstacles, where they stand at first.
        meetings: pairs of bodies that may meet.
        active: (stages, pairs) whether a pair has contact in a stage.
        meaning: (stages, pairs) `UNPLANNED`, `RESTED` or 0.
        rests: by object, the names of bodies on which it is put down, with its position there, (3,) m.
        holders: object and link of every weld.
    """

    def __init__(
        self, problem: Problem, trajectory: Trajectory, stages: Sequence[TaskStage], grip: FrictionGrip | None
    ) -> None:
        self.names, self.grip, self.stages = objects_of(problem), grip, list(stages)
        self.start: Array = np.asarray(trajectory.start)
        held = [body for body in problem.scene.attached if body.name in self.names]
        self.scene = _standing(problem, held, self.start)
        self.robot = carrying(problem.robot, self.scene)
        self._inertias = {name: _inertia(problem, name) for name in self.names}
        taken = [(step.action.body, step.action.link) for step in problem.task if isinstance(step.action, Attach)]
        self.holders = list(dict.fromkeys([*((body.name, body.link) for body in held), *taken]))
        self.bodies = CollisionModel(self.robot, self.scene).names
        self._links = set(self.bodies[: len(self.robot.geometry.geometryObjects)])
        keys = {key: k for k, key in enumerate(_keys(self.bodies))}
        models = [CollisionModel(stage.problem.robot, stage.problem.scene) for stage in stages]
        planned = [_pairs(model, keys) for model in models]
        self.meetings = [Meeting(*pair) for pair in sorted(set(self._own_pairs()).union(*planned))]
        self.rests = self._find_rests(stages, models, trajectory)
        judged = [
            [self._judged(stage, one, (one.a, one.b) in pairs) for one in self.meetings]
            for stage, pairs in zip(stages, planned, strict=True)
        ]
        table = np.array(judged, np.int8).reshape(len(stages), -1, 2)
        self.active, self.meaning = table[..., 0].astype(bool), table[..., 0] * table[..., 1]

    def _own_pairs(self) -> Iterator[tuple[int, int]]:
        """Return the pairs of bodies, one of which is an object."""
        for a, first in enumerate(self.bodies):
            for b, second in enumerate(self.bodies[a + 1 :], a + 1):
                if first != second and (first in self.names or second in self.names):
                    yield a, b

    def pair_names(self, meeting: int) -> tuple[str, str]:
        """Return the names of both bodies of a meeting."""
        one = self.meetings[meeting]
        return self.bodies[one.a], self.bodies[one.b]

    def meetings_with(self, name: str, others: set[str]) -> set[int]:
        """Return the meetings of an object with other bodies."""
        named = [set(self.pair_names(k)) for k in range(len(self.meetings))]
        return {k for k, pair in enumerate(named) if name in pair and pair & others}

    @property
    def coupled(self) -> list[tuple[int, int]]:
        """Pairs of joints that close together on an object."""
        found = [
            pair for stage in self.stages for joints in stage.fingers.values() for pair in pairwise(sorted(joints))
        ]
        return list(dict.fromkeys(found))

    def pads(self, link: str) -> tuple[str, pin.SE3]:
        """Return the body of MuJoCo that carries a link, and the tool frame in it, or the link's own."""
        model = self.robot.model
        tool, own = (model.frames[self.robot.frame_id(name)] for name in (self.robot.tool_frame, link))
        return _carrier(self.robot, link), (tool if tool.parentJoint == own.parentJoint else own).placement

    def finger_links(self, stage: TaskStage, name: str) -> set[str]:
        """Return the links whose friction holds an object in a stage."""
        robot = self.robot
        if self.grip is None or name not in stage.fingers:
            return set()
        moved = {robot.joint_names[j] for j in stage.fingers[name]}
        moved |= {follower for follower, mimic in robot.followers.items() if mimic.source in moved}
        bodies = enumerate(robot.geometry.geometryObjects)
        return {robot.link_of(k) for k, body in bodies if robot.model.names[body.parentJoint] in moved}

    def _judged(self, stage: TaskStage, meeting: Meeting, planned: bool) -> tuple[bool, int]:
        """Return whether a pair has contact in a stage, and what that means; `planned`: the plan keeps it apart."""
        pair = self.bodies[meeting.a], self.bodies[meeting.b]
        objects = [name for name in pair if name in self.names]
        if not objects:
            return planned, UNPLANNED
        name, other = (pair[0], pair[1]) if pair[0] == objects[0] else (pair[1], pair[0])
        if other in self.finger_links(stage, name):
            return True, 0
        held = {body.name: body.link for body in stage.problem.scene.attached}
        rests = any(b in (rest for rest, _ in self.rests.get(a, ())) for a, b in (pair, pair[::-1]))
        if name not in held and other not in held:
            unplanned = other in self._links and not rests
            return frozenset(pair) not in stage.problem.scene.allowed, UNPLANNED if unplanned else 0
        if held.get(name) == held.get(other):  # both welded to one link
            return False, 0
        return planned, RESTED if rests else UNPLANNED

    def _find_rests(
        self, stages: Sequence[TaskStage], models: Sequence[CollisionModel], trajectory: Trajectory
    ) -> dict[str, list[tuple[str, Array]]]:
        """Return what held objects are near to where they are taken or released; see `rests`."""
        found: dict[str, list[tuple[str, Array]]] = {}
        held = [{body.name: body for body in stage.problem.scene.attached} for stage in stages]
        ends = [*(stage.begin for stage in stages[1:]), trajectory.duration]
        for k, stage in enumerate(stages):
            before, after = held[k - 1] if k else {}, held[k + 1] if k + 1 < len(stages) else {}
            for t, others in ((stage.begin, before), (ends[k], after)):
                changed = [body for name, body in held[k].items() if name in self.names and not _same(body, others)]
                if not changed:
                    continue
                q = np.asarray(trajectory(t))
                near = models[k].near(q[None], RESTING)
                for body in changed:
                    p = np.array((frame_pose(stage.problem.robot, q, body.link) * body.X_LO).translation)
                    for pair in near.pairs.tolist():
                        names = models[k].pairs[pair].name_a, models[k].pairs[pair].name_b
                        if body.name in names:
                            found.setdefault(body.name, []).append((names[names[0] == body.name], p))
        return found

    def add_bodies(self, world: ET.Element) -> dict[str, ET.Element]:
        """Add the objects as free bodies; return them by name."""
        found = {}
        for obstacle in self.scene.obstacles:
            if obstacle.name in self.names:
                node = ET.SubElement(world, "body", {"name": obstacle.name, **pose_of(obstacle.X_WO)})
                ET.SubElement(node, "freejoint", name=obstacle.name)
                inertial_of(node, self._inertias[obstacle.name])
                found[obstacle.name] = node
        return found

    def meet(
        self, option: ET.Element, contact: ET.Element, equality: ET.Element, parts: Sequence[Sequence[str]]
    ) -> None:
        """Add the pairs, as they are in the first stage, and the welds, which do not hold yet.

        Args:
            option: element of the model.
            contact: likewise.
            equality: likewise.
            parts: names of the geoms of every body.
        """
        option.set("cone", "elliptic")
        option.set("impratio", "10")  # what is held slips little
        friction = FRICTION if self.grip is None else self.grip.friction
        for one in self.meetings:
            own = {self.bodies[one.a], self.bodies[one.b]} & set(self.names)
            for name, a, b in one.names(parts):
                pair = ET.SubElement(contact, "pair", name=name, geom1=a, geom2=b, condim="4" if own else "1")
                if own:
                    pair.set("friction", f"{friction} {friction} 0.005 0.0001 0.0001")
                    pair.set("solref", _MEETING)
                    pair.set("solreffriction", "0.0005 1")
                    pair.set("solimp", _HARD)
        for name, link in self.holders:
            bodies = {"body1": _carrier(self.robot, link), "body2": name}
            ET.SubElement(equality, "weld", {"name": weld_name(name, link), **bodies, **_LATER})
        names = self.robot.joint_names
        for i, j in self.coupled:
            closing = next(f for stage in self.stages for f in stage.fingers.values() if {i, j} <= set(f))
            joints = {"joint1": names[i], "joint2": names[j], "polycoef": f"0 {closing[i] * closing[j]} 0 0 0"}
            ET.SubElement(equality, "joint", {"name": coupling_name(i, j), **joints, **_LATER})


def _same(body: Attachment, others: Mapping[str, Attachment]) -> bool:
    """Whether the same link holds a body among others."""
    return body.name in others and others[body.name].link == body.link


def coupling_name(a: int, b: int) -> str:
    """Return the name of the coupling of two joints."""
    return f"coupled {a} {b}"


def _carrier(robot: Robot, link: str) -> str:
    """Return the name of the body of MuJoCo that carries a link."""
    joint = int(robot.model.frames[robot.frame_id(link)].parentJoint)
    return f"body {robot.model.names[joint]}" if joint else "world"


def weld_name(name: str, link: str) -> str:
    """Return the name of the weld of an object to a link."""
    return f"{name} on {link}"


def _keys(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return a name for each body that is the same in all stages: its own, and the how-manieth it is of that name."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        found.append((name, seen[name]))
        seen[name] += 1
    return found


def _pairs(model: CollisionModel, keys: dict[tuple[str, int], int]) -> set[tuple[int, int]]:
    """Return the pairs of a stage's model as indices of bodies, the smaller one first."""
    here = [keys[key] for key in _keys(model.names)]
    return {(min(here[p.a], here[p.b]), max(here[p.a], here[p.b])) for p in model.pairs}


def _standing(problem: Problem, held: Sequence[Attachment], q: Array) -> Scene:
    """Return the scene with these attachments as obstacles where their links are at q (n,)."""
    scene, robot = problem.scene, problem.robot
    bodies = [Obstacle(one.name, one.shape, frame_pose(robot, q, one.link) * one.X_LO) for one in held]
    left = [body for body in scene.attached if body not in held]
    return Scene([*scene.obstacles, *bodies], left, scene.allowed)


def _inertia(problem: Problem, name: str) -> pin.Inertia:
    """Return the inertia of an object in its own frame; of the first mass that the task states, else of `LIGHT`."""
    here = pin.SE3.Identity()
    every: list[Obstacle | Attachment] = [*problem.scene.obstacles, *problem.scene.attached]
    bodies = {body.name: body for body in every}
    actions = [step.action for step in problem.task if isinstance(step.action, Attach)]
    stated = [held_body(bodies[name], action, here) for action in actions if action.body == name and action.mass]
    stated += [replace(body, X_LO=here) for body in problem.scene.attached if body.name == name and body.mass]
    if stated:
        return stated[0].inertia_in_link()
    light = Attachment(name, bodies[name].shape, "", here, mass=LIGHT)
    try:
        return light.inertia_in_link()
    except ValueError:  # a shape without volume
        return pin.Inertia.FromSphere(LIGHT, 0.02)
