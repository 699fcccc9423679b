"""The path of a verified run, from which stretch to which it may be run forwards and backwards, and its laws."""

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.errors import described, wrong_argument
from optiplan.execution.clearance_left import ClearanceLeft
from optiplan.execution.paths.path_laws import Load, PathLaws
from optiplan.geometry.scene import Scene
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.motions import ToolAcceleration
from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import part_of_last_event, scene_parts
from optiplan.records import dataclass
from optiplan.runs.run import Run
from optiplan.trajectory.segments import EVENTS, Segment
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

TIMED_CONSTRAINTS = (ToolAcceleration, TipOver, Expression)
"""Path constraints that a slower run of the same path may violate."""

AT_ONCE = 1e-6
"""s of the path, just after its start."""

AT_REST = 1e-6
"""rad or m per s and s²: a joint without a limit that is no faster stands still."""


@dataclass(frozen=True, eq=False)
class PathStretch:
    """A part of the path, run in one direction from `start`: place s of its laws is `start` + s, backwards - s.

    Attributes:
        laws: along it.
        start: on the path, s.
        direction: 1.0 or -1.0; 0.0 off the path, which was left at `start`.
        model: off the path: the robot with what it carries, in the scene of the run.
        least: place at which a way back ends; rounding leads to none before it.
    """

    laws: PathLaws
    start: float
    direction: float
    model: NativeCollisionModel | None = None
    least: float = 0.0

    def place(self, s: float) -> float:
        """Return the place on the whole path."""
        return max(self.least, self.start + self.direction * s)


class Turned(NamedTuple):
    """A stretch that begins at rest, and the law along it; whether it was found `clear` of obstacles."""

    stretch: PathStretch
    law: "TimeLaw"
    clear: bool = False

    @property
    def begin(self) -> float:
        """When the law begins, s."""
        return float(self.law.pieces()[0, 0])


class ProvedPath:
    """The motion of a verified run as a path, whose parameter is the motion's time, s.

    Attributes:
        run: the run.
        constrained: whether a path constraint holds anywhere.
        events: what is done on the way, in order.
        parts: stretches of the path in which the scene stays the same, in order.
        forwards: the whole path.

    Raises:
        InputError: the run is not verified or ends in motion, obstacles move by the clock, a path constraint depends on
            accelerations, or the robot cannot stand still everywhere.
    """

    def __init__(self, run: Run, called: str) -> None:
        if not isinstance(run, Run):
            raise wrong_argument(called, "run", described(run), "a verified run of op.plan(…)")
        if run.trajectory is None or not run.verified:
            raise wrong_argument(called, "run", "a run that is not verified", "a verified run of op.plan(…)")
        problem = run.problem
        if problem.scene.dynamic_obstacles or any(step.timed for step in problem.task):
            found = "a run among obstacles that move by the clock, proved for its own timing alone"
            raise wrong_argument(called, "run", found, "a run among obstacles that stand still")
        constraints = _constraints(problem)
        for constraint in constraints:
            if isinstance(constraint, TIMED_CONSTRAINTS):
                found = f"a run with the path constraint `{constraint.KEY}`, which depends on accelerations"
                raise wrong_argument(called, "run", found, "path constraints of poses, positions and speeds")
        self.run, self.constrained = run, bool(constraints)
        if not self._rests(self.motion.duration):
            found = "a run that ends in motion"
            raise wrong_argument(called, "run", found, "a motion at whose end the robot stands still")
        self.parts = scene_parts(problem, self.motion)
        loads = [Load(part.begin, part.end, part.problem.robot) for part in self.parts]
        last, end = part_of_last_event(problem, self.motion), self.motion.duration
        if last is not None:
            loads.append(Load(end, end, last.problem.robot))
        self._last = (last or self.parts[-1]).problem.scene
        # files may place an event at the end a rounding behind it
        events = (one for one in self.motion.segments if one.kind in EVENTS)
        self.events: tuple[Segment, ...] = tuple(
            replace(one, begin=min(one.begin, end), end=min(one.end, end)) for one in events
        )
        assert run.report is not None
        tolerance = run.report.policy.limit_tolerance
        laws = PathLaws(self.motion, problem.limits, loads, tolerance, self.starts_at_rest)
        self.forwards = PathStretch(laws, 0.0, 1.0)
        self._stops = sorted({0.0, *(t for event in self.events for t in (event.begin, event.end))})
        back = self.forwards.laws.mirrored()
        self._ways_back = {stop: self._way_back(back, stop) for stop in self._stops}
        overloaded = self.forwards.laws.overloaded
        if overloaded is not None:
            found = f"a run in which gravity alone takes more torque than allowed at {overloaded:.3f} s"
            raise wrong_argument(called, "run", found, "a motion along which the robot can stand still anywhere")

    @cached_property
    def clearance_left(self) -> ClearanceLeft:
        """What is left of the clearance with the joints off the path; it is proved again for this, once."""
        return ClearanceLeft(self.parts, self.motion)

    @property
    def motion(self) -> Trajectory:
        """The verified motion."""
        assert self.run.trajectory is not None
        return self.run.trajectory

    def part_at(self, place: float) -> int:
        """Return which part of the path a place, s, is in: the later one at a boundary."""
        return int(np.searchsorted([part.end for part in self.parts[:-1]], place, side="right"))

    def held_at(self, place: float) -> frozenset[tuple[str, str]]:
        """Return what the robot holds at a place, s, after the events there; see `held_in`."""
        if place >= self.motion.duration:
            return held_in(self._last)
        return held_in(self.parts[self.part_at(place)].problem.scene)

    def backwards(self, place: float, done: float) -> PathStretch | None:
        """Return the way back from a place to the last event, or to the start; None where there is none.

        An event is not undone: what was taken stays taken. `done`, s, is the place up to which events were handed out.
        """
        last = self._stops[int(np.searchsorted(self._stops, max(place, done), side="right")) - 1]
        if place <= last:
            return None
        return self._ways_back[last]

    @property
    def first_way_back(self) -> PathStretch | None:
        """The way back that is there just after the start."""
        return self.backwards(min(AT_ONCE, self.motion.duration), 0.0)

    def turned(self, place: float, then: float, backwards: bool, done: float, speed: float) -> Turned | None:
        """Return the way from rest at a place, from time `then`, s, on; None where there is none. See `backwards`."""
        stretch = self.backwards(place, done) if backwards else self.forwards
        if stretch is None:
            return None
        at_rest = stretch.laws.steady((place - stretch.start) * stretch.direction, 0.0, then)
        law = stretch.laws.change_along(at_rest, then, speed) if speed > 0.0 else None
        return Turned(stretch, at_rest if law is None else law)

    def _way_back(self, laws: PathLaws, stop: float) -> PathStretch | None:
        """Return the stretch from the end back to a place; None where the robot does not stand still there."""
        T = self.motion.duration
        return PathStretch(laws.until(T - stop), T, -1.0, least=stop) if self._rests(stop) else None

    @property
    def starts_at_rest(self) -> bool:
        """Whether the motion begins without velocity, and without acceleration where jerk has a limit."""
        return self._rests(0.0)

    def _rests(self, t: float) -> bool:
        v, a = (np.abs(self.motion(np.array([t]), order)[0]) for order in (1, 2))
        slow, steady = rest_rates(self.run)
        return bool((v <= slow).all() and (a <= steady).all())


def rest_rates(run: Run) -> tuple[Array, Array]:
    """Return the velocities and accelerations (n,) up to which the joints stand still, as the verifier has it."""
    limits, tolerance = run.problem.limits, 0.0 if run.report is None else run.report.policy.rest_tolerance
    slow, steady = (
        np.where(np.isfinite(limit), np.maximum(tolerance * limit, AT_REST), AT_REST)
        for limit in (limits.velocity, limits.acceleration)
    )
    return slow, np.where(np.isfinite(limits.jerk), steady, np.inf)


def held_in(scene: Scene) -> frozenset[tuple[str, str]]:
    """Return the names of what a robot holds in a scene, each with its link."""
    return frozenset((one.name, one.link) for one in scene.attached)


def _constraints(problem: Problem) -> list[object]:
    """Return the path constraints of a problem and of the steps of its task."""
    found: list[object] = list(problem.path_constraints)
    for step in problem.task:
        found += step.constraints
    return found
