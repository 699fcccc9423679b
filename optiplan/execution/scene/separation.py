"""Speed and separation monitoring: how fast a robot may move beside people whose course is unknown.

ISO/TS 15066:2016, 5.5.4.2.3, asks that at every time t0 the separation is at least the protective distance

    S_p(t0) = S_h + S_r + S_s + C + Z_d + Z_r

S_h is the way of the person until the robot stands still, at 1.6 m/s where the speed is not monitored. S_r and S_s are
the ways of the robot towards the person while it reacts and while it stops. C is the intrusion distance (ISO
13855:2024, clause 5, calls it D_DS: how far somebody gets before the sensor detects it), Z_d and Z_r are the
uncertainties of both positions. Here S_r and S_s are no constants of the worst case but those of the law that is
commanded: with d(t) the distance from the robot at t to the person where it was measured at t_d, a law is clear if

    d(t) - v_h (t - t_d) - C - Z_d - Z_r > 0    from now until the robot stands still.

At standstill nothing is asked, since a robot that stands still cannot run into anybody.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from optiplan._core import core
from optiplan.arrays import number_argument
from optiplan.errors import described, wrong_argument
from optiplan.execution.paths.path_laws import rests
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath
from optiplan.execution.scene.scene_watch import SceneWatch, SeenObstacle
from optiplan.execution.status import KeptSeparation
from optiplan.geometry.shape import Shape
from optiplan.records import dataclass

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

FAR = 10.0
"""m: people that are farther away are not reported."""

BISECTIONS = 2
"""Speeds that are tried at a time between a clear one and one that is not, a quarter of a millisecond each."""


@dataclass(frozen=True)
class Separation:
    """How people are kept apart from a moving robot, after ISO/TS 15066:2016, 5.5.4 and ISO 13855:2024.

    Attributes:
        people: names of the obstacles that stand for people, or for parts of them. `update_scene` must report each.
        reaction: s from a measurement until the robot begins to stop if none follows: the sensor's period, its delay
            and that of the controller.
        intrusion: C, m: how far a part of a body gets beyond the reported shape.
        sensor_uncertainty: Z_d, m, of the measured positions.
        robot_uncertainty: Z_r, m, between the robot and its set-points.
        human_speed: v_h, m/s: bound on the speed of people, in any direction.

    Raises:
        InputError: a name or number that cannot be.

    Example:
        >>> import optiplan as op
        >>> rule = op.Separation("person", reaction=0.1, intrusion=0.1, sensor_uncertainty=0.05, robot_uncertainty=0.01)
        >>> round(rule.margin, 2)
        0.16
    """

    people: str | Sequence[str]
    reaction: float
    intrusion: float
    sensor_uncertainty: float
    robot_uncertainty: float
    human_speed: float = 1.6

    def __post_init__(self) -> None:
        """Check the values."""
        names = (self.people,) if isinstance(self.people, str) else self.people
        if not isinstance(names, Sequence) or not names or not all(isinstance(name, str) for name in names):
            raise wrong_argument("Separation", "people", described(self.people), "names of obstacles")
        object.__setattr__(self, "people", tuple(names))
        for key, unit in (("reaction", "s"), ("human_speed", "m/s")):
            number_argument("Separation", key, getattr(self, key), f"a number > 0, {unit}", above=0.0)
        for key in ("intrusion", "sensor_uncertainty", "robot_uncertainty"):
            number_argument("Separation", key, getattr(self, key), "a number >= 0, m", 0.0)

    @property
    def margin(self) -> float:
        """C + Z_d + Z_r, m."""
        return self.intrusion + self.sensor_uncertainty + self.robot_uncertainty


class CommandedLaw(NamedTuple):
    """What is commanded beside people: `law`, which is `goal` until a time, s, and from then on the stop.

    `allowed` is the speed of the goal.
    """

    law: "TimeLaw"
    goal: "TimeLaw"
    until: float
    allowed: float


class SeparationMonitor:
    """Chooses laws whose stop keeps the separation, and reports it.

    What is commanded always ends in the proved stop at the time at which new data are due. So where data stop coming,
    the robot stops by itself.

    Args:
        path: that the robot follows.
        watch: of it.
        rule: what is to be kept.

    Raises:
        InputError: the path begins in motion.
    """

    def __init__(self, path: ProvedPath, watch: SceneWatch, rule: Separation) -> None:
        if not path.starts_at_rest:
            found = "a run that begins in motion"
            raise wrong_argument("Executor", "run", found, "one that begins at rest, since people are not seen yet")
        self.rule, self._watch = rule, watch
        self._measured: dict[str, tuple[float, SeenObstacle | None]] = {}
        self.shapes: dict[str, Shape] = {}  # of people that were seen before
        self._commanded: CommandedLaw | None = None
        self._late = False
        self.kept: KeptSeparation | None = None
        watch.prepare(path.forwards)

    @property
    def seen(self) -> list[SeenObstacle]:
        """Where people were measured last."""
        return [one for _, one in self._measured.values() if one is not None]

    def see(self, name: str, person: SeenObstacle | None, time: float) -> None:
        """Remember where a person was at a time, s, or that it was not there; data may come out of order."""
        if name not in self._measured or self._measured[name][0] <= time:
            self._measured[name] = time, person
            if person is not None:
                self.shapes[name] = person.shape

    def age(self, duration: float) -> None:
        """Let a time, s, pass without ticks: people were seen so much longer ago."""
        for name, (time, person) in self._measured.items():
            aged = None if person is None else replace(person, time=person.time - duration)
            self._measured[name] = time - duration, aged

    def over(self, path: ProvedPath, watch: SceneWatch) -> "SeparationMonitor":
        """Return the same about another path."""
        other = SeparationMonitor(path, watch, self.rule)
        other._measured, other.shapes, other.kept = self._measured, self.shapes, self.kept
        return other

    @property
    def fresh_until(self) -> float:
        """When the robot must begin to stop unless new data come, s."""
        times = [self._measured[name][0] if name in self._measured else -np.inf for name in self.rule.people]
        return float(min(times)) + self.rule.reaction

    def way(self, law: "TimeLaw", now: float) -> "TimeLaw":
        """Return the law that is followed while data keep coming."""
        commanded = self._commanded
        return commanded.goal if commanded is not None and commanded.law is law and now < commanded.until else law

    def choose(self, stretch: PathStretch, law: "TimeLaw", now: float, wanted: float) -> "TimeLaw | None":
        """Return the law of the highest speed up to the wanted one that is clear; None where the present one stays."""
        chosen = self._fastest(stretch, law, now, wanted) if wanted > 0.0 else None
        self._late = False
        if chosen is None:
            stop = law if rests(law, now) else stretch.laws.change_along(law, now, 0.0) or law
            if wanted > 0.0 and not self.clear(stretch, stop, now) and self.clear(stretch, law, now):
                stop = law  # it goes on a little before it stops, which was proved
            else:
                self._late = not self.clear(stretch, stop, now)
            chosen = CommandedLaw(stop, stop, now, 0.0)
        self._commanded = chosen
        self.kept = self._report(stretch, chosen.law, now, chosen.allowed)
        return None if chosen.law is law else chosen.law

    def reason(self, now: float) -> str:
        """Return why the robot stands still or stops by itself; nothing where it does not."""
        for name in self.rule.people:
            if name not in self._measured:
                return f"no data about '{name}' yet"
        if now >= self.fresh_until:
            name, (time, _) = min(self._measured.items(), key=lambda one: one[1][0])
            return f"the last data about '{name}' are {now - time:.3f} s old"
        if self.kept is None or self.kept.allowed > 0.0:
            return ""
        if np.isneginf(self.kept.separation):
            return f"the native core does not know the shape of '{self.kept.pair[0]}'"
        found = f"'{self.kept.pair[0]}' is {self.kept.separation:.3f} m from '{self.kept.pair[1]}'"
        return f"{found}; the stop comes too late" if self._late else found

    def _fastest(self, stretch: PathStretch, law: "TimeLaw", now: float, wanted: float) -> CommandedLaw | None:
        """Return what leads to the highest speed that is clear: the wanted one, or one found by bisection."""
        best = self._clear_to(stretch, law, now, wanted)
        if best is not None or self.fresh_until <= now:
            return best
        before = 0.0 if self._commanded is None else self._commanded.allowed
        low, high = 0.0, wanted
        speed = before if 0.0 < before < wanted else 0.5 * wanted
        for _ in range(BISECTIONS):
            found = self._clear_to(stretch, law, now, speed)
            if found is None:
                high = speed
            else:
                best, low = found, speed
            speed = 0.5 * (low + high)
        return best

    def _clear_to(self, stretch: PathStretch, law: "TimeLaw", now: float, speed: float) -> CommandedLaw | None:
        """Return what leads to a speed as long as data are fresh, and then stops; None where that is not clear."""
        until = self.fresh_until
        goal = self.way(law, now)
        if until <= now:
            return None
        if goal is law or goal.target != speed:
            found = stretch.laws.change_along(law, now, speed)
            if found is None:
                return None
            goal = found
        both = stretch.laws.then_stop(goal, until)
        return CommandedLaw(both, goal, until, speed) if self.clear(stretch, both, now) else None

    def clear(self, stretch: PathStretch, law: "TimeLaw", now: float) -> bool:
        """Whether a law keeps the separation from now until the robot stands still."""
        if rests(law, now):
            return True
        known = all(name in self._measured for name in self.rule.people)
        return known and self._watch.nearest(stretch, law, now, self.seen, self.rule.margin, 0.0) is None

    def _report(self, stretch: PathStretch, law: "TimeLaw", now: float, allowed: float) -> KeptSeparation | None:
        """Return separation and protective distance: S - S_p is the least that a law leaves on its way."""
        here = core.TimeLaw.steady(law.at(now)[0], 0.0, now)
        still = [replace(one, spread=0.0) for one in self.seen]
        near = self._watch.nearest(stretch, here, now, still, 0.0, FAR)
        if near is None:
            return None
        left = None
        if not rests(law, now):
            left = self._watch.nearest(stretch, law, now, self.seen, self.rule.margin, FAR)
        return KeptSeparation(near.slack, 0.0 if left is None else near.slack - left.slack, near.pair, allowed)
