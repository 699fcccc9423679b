"""Planners for the tests of the runner, good and bad; named in suites as `bench_planners:Straight` and so on."""

import ctypes
import os
import random
import signal
import sys
import time
from dataclasses import dataclass, replace

import numpy as np

from optiplan.planners.base import Failure, PlanResult
from optiplan.trajectory.timing.stops import stop_at_corners


@dataclass(frozen=True)
class Options:
    seconds: float = 0.0
    only: str = ""


class Straight:
    """A straight line to the first goal, after some seconds; plans nothing for seeds of 7."""

    Options = Options

    def __init__(self, options):
        self.options = options

    def plan(self, problem, budget, progress):
        if problem.name == self.options.only or not self.options.only:
            self.misbehave()
        time.sleep(0.0 if problem.name == "warm-up" else self.options.seconds)
        if problem.seed == 7:
            return PlanResult(None, Failure("no-path", "sevens are unlucky", {"q": problem.start.tolist()}), {})
        path = np.array([problem.start, problem.goal[0].q])
        motion = stop_at_corners(path, problem.limits, problem.robot.joint_names)
        return PlanResult(motion, None, {"line": 0.0}, {"cut_short": False})

    def misbehave(self):
        """Nothing; others do."""


class Hangs(Straight):
    """Never answers."""

    def misbehave(self):
        while True:
            time.sleep(1.0)


class Eats(Straight):
    """Takes ever more memory."""

    def misbehave(self):
        held = []
        while True:
            held.append(np.ones(5_000_000))


class Gulps(Straight):
    """Asks for a terabyte at once."""

    def misbehave(self):
        np.ones(10**12 // 8)


class Segfaults(Straight):
    """Reads where there is nothing."""

    def misbehave(self):
        ctypes.string_at(0)


class Prints(Straight):
    """Prints from Python and from C, and to both streams."""

    def misbehave(self):
        print("from Python")
        print("to stderr", file=sys.stderr)
        ctypes.CDLL(None).puts(b"from C")


class Floods(Straight):
    """Prints some 20 MB."""

    def misbehave(self):
        for _ in range(200):
            os.write(1, b"water " * 16_000)


class Raises(Straight):
    """Has a bug."""

    def misbehave(self):
        raise ZeroDivisionError("of all things")


class Babbles(Straight):
    """Tells about its work what no file can hold."""

    def plan(self, problem, budget, progress):
        result = super().plan(problem, budget, progress)
        return replace(result, info={"self": self} if problem.name == self.options.only else {})


class Leaves(Straight):
    """Ends the process."""

    def misbehave(self):
        os._exit(5)


class Quits(Straight):
    """Asks Python to end."""

    def misbehave(self):
        sys.exit(3)


class KilledOnce(Straight):
    """Is killed as if from outside, the first time."""

    def misbehave(self):
        path = os.environ["KILLED_ONCE"]
        if not os.path.exists(path):
            open(path, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)


class KilledAlways(Straight):
    """Is killed as if from outside, every time."""

    def misbehave(self):
        os.kill(os.getpid(), signal.SIGKILL)


class ClosesItsStreams(Straight):
    """Closes standard output and standard error."""

    def misbehave(self):
        os.close(1)
        os.close(2)


class Interrupts(Straight):
    """As if somebody had pressed Ctrl-C."""

    def misbehave(self):
        raise KeyboardInterrupt


class Shrugs(Straight):
    """Gives neither a motion nor a reason."""

    def plan(self, problem, budget, progress):
        return (
            PlanResult(None, None, {}) if problem.name == self.options.only else super().plan(problem, budget, progress)
        )


class Stutters(Straight):
    """Says what no database can hold."""

    def plan(self, problem, budget, progress):
        if problem.name != self.options.only:
            return super().plan(problem, budget, progress)
        return PlanResult(None, Failure("no-path", "half a letter: \ud800", {}), {})


class LeavesChildren(Straight):
    """Starts processes that stay, one of them in a session of its own; writes their ids down."""

    def misbehave(self):
        children = [os.fork(), os.fork()]
        if not all(children):
            if children[0] == 0:
                os.setsid()
            time.sleep(1000.0)
            os._exit(0)
        with open(os.environ["CHILDREN"], "w") as file:
            file.write(" ".join(map(str, children)))


class KilledWithChildren(LeavesChildren):
    """Starts such processes, and is killed."""

    def misbehave(self):
        super().misbehave()
        os.kill(os.getpid(), signal.SIGKILL)


class Daemons(Straight):
    """Starts a process whose parent ends at once, in a session of its own, as daemons do."""

    def misbehave(self):
        child = os.fork()
        if child == 0:
            os.setsid()
            with open(os.environ["CHILDREN"], "w") as file:
                file.write("started")
            if os.fork() == 0:
                time.sleep(1000.0)
            os._exit(0)
        os.waitpid(child, 0)


class ComesBackTwice(Straight):
    """Forks, and returns from both processes."""

    def misbehave(self):
        os.fork()


class ChildrenEat(Straight):
    """Has others take ever more memory."""

    def misbehave(self):
        if os.fork() == 0:
            held = []
            while True:
                held.append(np.ones(1_000_000))
                time.sleep(0.005)
        time.sleep(1000.0)


class NeverMade(Straight):
    """Cannot be made."""

    def __init__(self, options):
        raise OSError("no licence")


class Draws(Straight):
    """Tells what it draws from the generators of the process, and which cores it may use."""

    def plan(self, problem, budget, progress):
        drawn = [random.random(), float(np.random.random())]  # noqa: NPY002
        result = super().plan(problem, budget, progress)
        return replace(result, info={"drawn": drawn, "cores": sorted(os.sched_getaffinity(0))})


class WarmsUp(Straight):
    """Writes down what it is asked to do, and with which option."""

    def plan(self, problem, budget, progress):
        with open(os.environ["ASKED"], "a") as file:
            file.write(f"{self.options.only} {problem.name} {problem.robot.name}\n")
        return super().plan(problem, budget, progress)

    def misbehave(self):
        """Never."""


class Works(Straight):
    """Half a tenth of a second of work here, the same in a process that it waits for, and a tenth of sleep."""

    def misbehave(self):
        child = os.fork()
        end = time.process_time() + 0.05
        while time.process_time() < end:
            pass
        if child == 0:
            os._exit(0)
        os.waitpid(child, 0)
        time.sleep(0.1)
