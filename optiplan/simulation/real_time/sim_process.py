"""The process of the driver `sim`: a plant in real time under computed torque.

Started as `python -m optiplan.simulation.real_time.sim_process FD`, with its end of a connection as file FD, and with
a pickled `Setup` on stdin.
"""

import gc
import pickle
import socket
import sys
import time
from collections import deque
from contextlib import suppress
from typing import Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.cores import keeping_time, take_turns
from optiplan.errors import OptiPlanError
from optiplan.execution.loop.driver_checks import in_words
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.simulation.controllers.base import JointTarget
from optiplan.simulation.controllers.joints import ComputedTorque, VelocityTracking
from optiplan.simulation.execution import ExecutionOptions, task_plant, torque_plant
from optiplan.simulation.plants.base import Payload, Plant, PlantOptions, assumed_dynamics
from optiplan.simulation.plants.ideal import IdealPlant
from optiplan.simulation.plants.task_plant import object_poses, objects_of
from optiplan.simulation.real_time.messages import Packet, data_packet, numbers_packet, received
from optiplan.simulation.real_time.set_points import ReceivedSetPoints
from optiplan.simulation.tasks.course import NOTHING_HELD, Course, TaskCourse
from optiplan.simulation.tasks.stages import stages_of
from optiplan.trajectory.trajectory import Trajectory

SimEngine = Literal["mujoco", "own", "ideal"]
"""What moves the robot: MuJoCo, our rigid bodies, or nothing but its set-points."""

CYCLE = 1e-3
"""s: of the drives, and between two states."""

STEPS = 2
"""Of the plant in a cycle."""

MOST_BEHIND = 0.5
"""s: a simulation that is behind catches up, but one that is later than this lets time pass."""

WARM_UP = 20
"""Cycles before the first set-point."""

GAIN = 50.0
"""1/s, of the ideal robot."""


@dataclass(frozen=True, eq=False)
class Setup:
    """What the process simulates.

    Attributes:
        problem: its robot and scene.
        motion: that is executed; the robot stands where it begins.
        engine: of the plant.
        frequency: of computed torque, Hz.
        payload: kg at the tool that the drives do not know of.
        silence: s after which a robot without set-points follows the way ahead.
    """

    problem: Problem
    motion: Trajectory
    engine: SimEngine
    frequency: float
    payload: float
    silence: float


class SimulatedRobot:
    """A plant with drives that follow a reference; a task takes and releases its objects on the way.

    Attributes:
        plant: of the engine.
        t: time simulated, s.
        touched: names of bodies that touched.
    """

    def __init__(self, setup: Setup) -> None:
        problem, motion, step = setup.problem, setup.motion, CYCLE / STEPS
        q, payload = np.asarray(motion.start), Payload(setup.payload, 0.0) if setup.payload else None
        self.t, self.touched = 0.0, set[tuple[str, str]]()
        self.plant: Plant
        self._drive: ComputedTorque | VelocityTracking
        self._course: Course = NOTHING_HELD
        self._place = np.zeros(1)
        self._planned: Array | None = None  # where the objects are to be at the end
        if setup.engine == "ideal":
            self.plant, self._drive = IdealPlant(q, step), VelocityTracking(GAIN)
            return
        self._drive = drive = ComputedTorque(assumed_dynamics(problem.robot, payload), setup.frequency)
        made = PlantOptions(payload=payload)
        if not problem.task:
            self.plant = torque_plant(problem, setup.engine, q, step, made)
            return
        stages, options = stages_of(problem, motion), ExecutionOptions(setup.engine, step=step)
        self.plant = plant = task_plant(problem, motion, stages, options, made, None)
        self._names = objects_of(problem)
        self._course = course = TaskCourse(stages, self._names, plant, drive, payload)
        course.places = lambda _: self._place
        for stage in stages:
            assumed_dynamics(stage.problem.robot, payload)  # what is kept of each robot is made now
        data = problem.robot.model.createData()
        pin.framesForwardKinematics(problem.robot.model, data, np.asarray(motion.end))
        self._planned = object_poses(self._names, stages[-1].problem.scene, problem.robot, data)

    def warm_up(self) -> None:
        """Hold the robot where it stands for some cycles, so that nothing is done for the first time later on."""
        q = np.array(self.plant.q)
        for _ in range(WARM_UP):
            self.cycle(q, 0.0 * q, 0.0 * q, 0.0)
        self.touched.clear()

    def cycle(self, q: Array, v: Array, a: Array, place: float) -> None:
        """Follow a reference q, v, a (n,), at a place of the path, s, for a cycle."""
        self._place[0] = place
        self._course.enter(self._place, None)
        ahead = v + 0.5 * CYCLE * a
        command = self._drive.command(self.plant.q, self.plant.v, JointTarget(q, v, ahead, a))
        self.plant.advance(command.value, STEPS)
        self.t += CYCLE
        self.touched.update(self.plant.contacts())

    def objects(self) -> dict[str, float]:
        """Return how far the objects of a task are from where they are to be at its end, m."""
        if self._planned is None:
            return {}
        poses: Array = self.plant.objects()  # type: ignore[attr-defined]  # a task has a plant with objects
        off = np.linalg.norm(poses[:, :3] - self._planned[:, :3], axis=1)
        return dict(zip(self._names, off.tolist(), strict=True))


class RealTime:
    """The loop of the process: packets in, cycles in step with the clock of this machine, states out.

    Args:
        end: of the connection, which does not wait.
        setup: of the robot.
    """

    def __init__(self, end: socket.socket, setup: Setup) -> None:
        self._end, self.robot = end, SimulatedRobot(setup)
        start = np.asarray(setup.motion.start)
        self._n, self._place = len(start), 0.0
        self._reference = ReceivedSetPoints(start, setup.silence)
        self._arrivals: deque[float] = deque(maxlen=100_000)
        self._late: deque[float] = deque(maxlen=100_000)
        self._slipped = 0.0
        self._square, self._most, self._count = 0.0, 0.0, 0

    def run(self) -> None:
        """Simulate until the driver lets go, or is gone; then until the robot stands still."""
        due = time.monotonic()
        while not (self._reference.stopping and self._reference.rests(due)):
            self._take_packets()
            self._cycle(due)
            due += CYCLE
            now = time.monotonic()
            self._late.append(max(0.0, now - due))
            if now - due > MOST_BEHIND:
                self._slipped, due = self._slipped + now - due, now
                take_turns()  # it is too slow for real time, and would leave nothing to others
            time.sleep(max(0.0, due - now))

    def _take_packets(self) -> None:
        try:
            packets = received(self._end)
        except ConnectionError:
            self._reference.stopping = True
            return
        now, n = time.monotonic(), self._n
        for kind, content in packets:
            if kind is Packet.TICK:
                values = np.frombuffer(content)
                q, v, a = values[3:].reshape(3, n)
                self._reference.take(float(values[1]), q, v, a, float(values[0]))
                self._place = float(values[2])
                self._arrivals.append(now)
            elif kind is Packet.AHEAD:
                values = np.frombuffer(content)[1:]
                K = len(values) // (3 * n + 1)
                q, v, a = values[K:].reshape(3, K, n)
                self._reference.take_ahead(values[:K], q, v, a)
            elif kind is Packet.STOP:
                self._reference.stopping = True

    def _cycle(self, now: float) -> None:
        robot = self.robot
        q, v, a = self._reference.at(now)
        robot.cycle(q, v, a, self._place)
        if not np.isfinite(robot.plant.q).all():
            raise OptiPlanError(f"the simulated motion grew without bound at {robot.t:.3f} s")
        off = float(np.abs(robot.plant.q - q - CYCLE * v).max())  # the cycle ends one later
        self._square, self._most, self._count = self._square + off * off, max(self._most, off), self._count + 1
        try:
            self._end.send(numbers_packet(Packet.STATE, robot.t, now + CYCLE, robot.plant.q, robot.plant.v))
        except (BlockingIOError, ConnectionError):  # nobody reads: the next one is newer
            pass

    def report(self) -> dict[str, object]:
        """Return what came of it, for JSON; times in s, distances in rad or m."""
        between, late = np.diff(np.array(self._arrivals)), np.array(self._late)
        return {
            "engine_time": self.robot.t,
            "contacts": sorted(map(list, self.robot.touched)),
            "objects": self.robot.objects(),
            "error_rms": float(np.sqrt(self._square / max(1, self._count))),
            "error_max": self._most,
            "interval_std": float(between.std()) if len(between) else None,
            "interval_max": float(between.max()) if len(between) else None,
            "cycle_late_p99": float(np.percentile(late, 99)) if len(late) else None,
            "slipped": self._slipped,
        }


def main() -> None:
    """Read the setup, say that the robot is ready, and simulate."""
    end = socket.socket(fileno=int(sys.argv[1]))
    end.setblocking(False)
    try:
        setup: Setup = pickle.load(sys.stdin.buffer)
        loop = RealTime(end, setup)
        loop.robot.warm_up()
        gc.freeze()  # imported modules are not looked through for garbage on the way
        end.send(Packet.READY.value)
        with keeping_time():
            loop.run()
        end.send(data_packet(Packet.REPORT, loop.report()))
    except ConnectionError:
        pass
    except Exception as error:  # to be seen where the robot is driven
        with suppress(OSError):  # nobody reads
            end.send(data_packet(Packet.FAILED, in_words(error)))
        sys.exit(1)


if __name__ == "__main__":
    main()
