"""A robot in this process, and a clock that tests set."""

import time

import numpy as np

import optiplan as op
from optiplan.execution.drivers.base import Capabilities
from optiplan.execution.measurement import Measurement


class SetClock:
    """A clock that sleeps exactly, but for the delays of some ticks, s by number.

    With `pause`, s, a tick takes so long in truth, so that other threads come to their turn.
    """

    def __init__(self, delays=None, pause=0.0):
        self.t, self.count, self.delays, self.pause = 100.0, 0, delays or {}, pause

    def now(self):
        return self.t

    def sleep_until(self, t):
        self.count += 1
        if self.pause:
            time.sleep(self.pause)
        self.t = max(self.t, t) + self.delays.get(self.count, 0.0)


class FollowingRobot:
    """Stands where its last set-point was, or goes on along its way ahead; keeps all with the times when they came."""

    def __init__(self, run, rate=1000.0, lead=0.0, clock=None):
        self.names, self.rate, self.lead = tuple(run.problem.robot.joint_names), rate, lead
        self.clock = clock or SetClock()
        self.q, self.ticks, self.came, self.stopped = np.array(run.trajectory.start), [], [], []
        self.ahead = None

    def capabilities(self):
        return Capabilities("following", self.names, self.rate, measures=True, lead=self.lead)

    def state(self):
        now = self.clock.now()
        if self.ahead is None:
            return Measurement(self.q, np.zeros(len(self.q)), now)
        t = self.ticks[-1].t + now - self.came[-1]
        q = np.array([np.interp(t, self.ahead.t, column) for column in self.ahead.q.T])
        return Measurement(q, np.zeros(len(q)), now)

    def send(self, tick):
        self.ticks.append(tick)
        self.came.append(self.clock.now())
        self.q, self.ahead = tick.q, tick.ahead or self.ahead

    def stop(self, reason):
        self.stopped.append(reason)


def executed(run, robot, **options):
    """Run a motion on a robot in its own time; return the execution, which is over."""
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock, **options)
    execution.start()
    assert execution.wait(30.0)["over"]
    return execution


def steps_within_limits(ticks, period, limits):
    """Whether set-points one period apart keep the limits of velocity, acceleration and jerk, as differences."""
    q = np.array([tick.q for tick in ticks])
    for order, limit in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        rate = np.abs(np.diff(q, order, axis=0)) / period**order
        if not (rate <= limit * 1.001 + 1e-6 / period ** max(0, order - 1)).all():
            return False
    return True
