"""The closed loop: measure, compare with the reference, command, let the plant move; and log it."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import field

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.control.step import ControlStep
from optiplan.geometry.scene import Scene
from optiplan.records import dataclass
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.simulation.contacts import ContactWatch
from optiplan.simulation.controllers.base import JointTarget, LoopController
from optiplan.simulation.log import Log
from optiplan.simulation.plants.base import Plant
from optiplan.simulation.plants.imperfections import PERFECT, DelayLine, Imperfections, Sensor
from optiplan.simulation.recorder import Recorder
from optiplan.simulation.references.base import JointReference, Reference, ToolReference, ToolTarget
from optiplan.simulation.tasks.course import NOTHING_HELD, Course

BLOCK = 2000
"""Steps that are prepared and judged at once."""

_MOST = 1e9
"""Bound on positions and velocities, rad or m, and per s: a motion beyond it grows without bound, and differences and
squares of such numbers are finite."""

OF_TASKS = "a task, in which objects change hands", "a problem with a goal"
"""Found and expected where a loop is given a task: objects would stay where they are at first."""


@dataclass(frozen=True, eq=False)
class Push:
    """A force on the tool for a while.

    Attributes:
        at: s; `lasting`: s.
        force: (3,), N; `torque`: (3,), N·m; at the tool's origin, along the axes of the world.
    """

    at: float
    lasting: float
    force: Array
    torque: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop, ready to run.

    Attributes:
        robot: with n joints.
        limits: what the motion is judged by; the plant has its own idea of what its drives can give.
        reference: what to follow.
        controller: how.
        plant: what moves.
        dt: the control period, s; a whole number of the plant's steps.
        settle: s that the loop runs on after the end of the reference.
        imperfections: of measurement and timing.
        pushes: forces on the tool.
        scene: where distances are measured; None: they are not.
        course: what is taken and released on the way, of a task.
    """

    robot: Robot
    limits: Limits
    reference: Reference
    controller: LoopController
    plant: Plant
    dt: float = 1e-3
    settle: float = 0.0
    imperfections: Imperfections = PERFECT
    pushes: Sequence[Push] = ()
    scene: Scene | None = None
    course: Course = NOTHING_HELD


def simulate(loop: Loop, progress: Callable[[float], None] | None = None) -> Log:
    """Run a closed loop from the plant's present state to the end of its reference, and what is left to settle.

    In each period: measure q and v; sample the reference; command; the plant moves in its own, finer steps, with the
    command that is due after the delay. A plant whose state grows without bound ends the loop, and the log says so.

    Args:
        loop: what to run.
        progress: called with the fraction done, 0 to 1, about every 2000 steps.
    """
    plant, dt = loop.plant, loop.dt
    per_control = round(dt / plant.step)
    steps = max(1, round((loop.reference.duration + loop.settle) / dt))
    sensor = Sensor(loop.imperfections, dt)
    line = DelayLine(loop.imperfections.delay, plant.step, per_control, plant.holding())
    watch = None if loop.scene is None else ContactWatch(loop.robot, loop.scene, dt)
    frame = loop.reference.frame if isinstance(loop.reference, ToolReference) else None
    recorder = Recorder(loop.robot, loop.limits, steps, dt, plant.input, frame)
    statuses: Counter[str] = Counter()
    step: ControlStep | None = None
    first = 0
    while first <= steps:
        t: Array = np.asarray((first + np.arange(min(BLOCK, steps + 1 - first))) * dt, dtype=np.float64)
        t = loop.course.enter(t, watch)
        count, wanted = len(t), _targets(loop.reference, t, dt)
        for k in range(count):
            q, v = plant.q, plant.v
            if not (np.abs((q, v)) < _MOST).all():
                recorder.end_block(t, watch)
                return recorder.log(statuses, watch, f"the motion grew without bound at {t[k]:.4g} s")
            loop.course.add()
            target = wanted(k)
            command = loop.controller.command(*sensor.measure(q, v), target)
            applied = command.value
            if first + k < steps:
                push = _push(loop.pushes, t[k])
                for value, held in line.after(command.value):
                    applied = plant.advance(value, held, push)
            recorder.add(q, v, command, applied, target)
            step = command.step
            if step is not None:
                statuses[step.status] += 1
            if watch is not None:
                for pair in plant.contacts():
                    watch.touch(pair, float(t[k]))
        recorder.end_block(t, watch)
        first += count
        if progress is not None:
            progress(min(1.0, first / (steps + 1)))
    return recorder.log(statuses, watch, _unkept(step))


def _unkept(step: ControlStep | None) -> str:
    """What did not hold at the end; empty where all did."""
    if step is None or step.status != "recovering":
        return ""
    return f"limits did not hold at the end: {', '.join(step.slack)}"


def _targets(reference: Reference, t: Array, dt: float) -> Callable[[int], JointTarget | ToolTarget]:
    if isinstance(reference, JointReference):
        now, ahead = reference.sample(t), reference.sample(t + 0.5 * dt)
        torque = ahead.torque
        return lambda k: JointTarget(now.q[k], now.v[k], ahead.v[k], ahead.a[k], None if torque is None else torque[k])
    return lambda k: reference.at(float(t[k]))


def _push(pushes: Sequence[Push], t: float) -> pin.Force | None:
    acting = [push for push in pushes if push.at <= t < push.at + push.lasting]
    if not acting:
        return None
    return pin.Force(
        np.sum([np.asarray(push.force, float) for push in acting], axis=0),
        np.sum([np.asarray(push.torque, float) for push in acting], axis=0),
    )
