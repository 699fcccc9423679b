"""Driver `ros2_control`: a joint trajectory controller of ROS 2, through rosbridge (extra `[ros]`).

Not tried on hardware. See `Ros2ControlDriver`.
"""

import logging
import threading
import time
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from optiplan.arrays import is_finite, number_argument
from optiplan.errors import OptiPlanError, described, whole_argument, wrong_argument
from optiplan.execution.drivers.base import Capabilities, DriverError
from optiplan.execution.loop.clock_offset import ClockOffset
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Ahead, Tick
from optiplan.runs.run import Run

LEAD = 0.4
"""s: so long the robot goes on without us before it stops along its path; goals follow one another in half of it."""

DELAY = 0.1
"""s by which the robot is later than the set-points, longer than a goal takes to arrive."""

GAP = 0.02
"""s from a goal's start to its first point, which the controller comes to from where it is."""

CONNECTED_IN = 10.0
"""s."""

DRIFT = 1e-3
"""Share by which the distance of the robot's clock from ours may change, so that no goal shifts the motion."""

COMES_TO_REST_IN = 5.0
"""s that `stop` waits for the robot at most."""

FULL = 1e-3
"""Share by which a reported speed may differ from the full one."""

SUCCEEDED = 4
"""Of GoalStatus."""


class Ros2ControlDriver:
    """Hand the way ahead to `FollowJointTrajectory`, as a new goal whenever it changes or is half over.

    Each goal holds the next part of the motion and the stop along the path from there: where we or the network fail,
    the robot takes that stop by itself. Times are absolute, by the clock of the robot's joint states, so that goals
    that arrive with a delay do not shift the motion. Speed is changed by the goals, never by the controller's own speed
    scaling, which has no limit on jerk; where the robot reports that it is scaled, the motion ends in a stop.

    rosbridge must run with `send_action_goals_in_new_thread: true`, or it waits for each goal's end.

    Args:
        run: of a robot whose joints the controller has by the same names.
        host, port: of the rosbridge server.
        controller: that has the action `follow_joint_trajectory`.
        states: topic of `sensor_msgs/JointState`.
        scaling: topic of `std_msgs/Float64` with the robot's speed; `full_speed` is what it says at full speed.

    Raises:
        InputError: an argument that cannot be.
        DriverError: the server cannot be reached.
        OptiPlanError: roslibpy is not installed.
    """

    def __init__(
        self,
        run: Run,
        *,
        host: str = "localhost",
        port: int = 9090,
        controller: str = "joint_trajectory_controller",
        states: str = "/joint_states",
        scaling: str = "/speed_scaling_state_broadcaster/speed_scaling",
        full_speed: float = 100.0,
    ) -> None:
        texts = {"host": host, "controller": controller, "states": states, "scaling": scaling}
        for argument, value in texts.items():
            if not isinstance(value, str) or not value.strip():
                raise wrong_argument("driver", argument, described(value), "a name")
        whole_argument("driver", "port", port, 1, most=65535)
        self._full = number_argument("driver", "full_speed", full_speed, "a finite number > 0", above=0.0)
        self._names = tuple(run.problem.robot.joint_names)
        self._lock, self._fault = threading.Lock(), ""
        self._latest: tuple[float, Measurement] | None = None  # when it came
        self._robot, self._pace = ClockOffset(), ClockOffset()
        self._offset = 0.0  # from the robot's clock to time.monotonic
        self._begun = False  # whether a goal was sent
        self._goal: str | None = None
        self._rests_at, self._still = 0.0, np.empty(0)
        self._closed = False
        self._ros_module = _client()
        self._connect(host, port, controller, states, scaling)

    def _connect(self, host: str, port: int, controller: str, states: str, scaling: str) -> None:
        roslibpy = self._ros_module
        try:
            self._ros = roslibpy.Ros(host, port, transport="asyncio")
        except Exception as error:
            raise DriverError(f"no rosbridge server at {host}:{port}: {error}") from None
        try:
            self._ros.run(CONNECTED_IN)
        except BaseException as error:  # Ctrl-C, too: the client would go on trying for ever
            self._ros.factory.maxRetries = 0
            self._ros.factory.on_ready(lambda connection: connection.send_close())  # a try may be under way
            if not isinstance(error, Exception):
                raise
            raise DriverError(f"no rosbridge server at {host}:{port}: {error}") from None
        self._ros.on("close", self._lose)
        name, kind = f"/{controller.strip('/')}/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory"
        self._action = roslibpy.ActionClient(self._ros, name, kind)
        self._topics = [
            roslibpy.Topic(self._ros, states, "sensor_msgs/JointState", queue_length=1),
            roslibpy.Topic(self._ros, scaling, "std_msgs/Float64", queue_length=1),
        ]
        for topic, take in zip(self._topics, (self._take_state, self._take_scaling), strict=True):
            topic.subscribe(take)

    def capabilities(self) -> Capabilities:
        """Ways ahead of 0.4 s; not tried on hardware."""
        return Capabilities("ros2_control", self._names, 100.0, ("position", "velocity"), True, DELAY, LEAD)

    def state(self) -> Measurement | None:
        """Return the newest joint state."""
        self._check()
        with self._lock:
            latest = self._latest
        if latest is None:
            return None
        came, seen = latest
        return Measurement(seen.q, seen.v, seen.stamp, time.monotonic() - came)

    def send(self, tick: Tick) -> None:
        """Send the way ahead as a goal, where there is a new one."""
        self._check()
        begin = self._pace.take(time.monotonic(), tick.t)  # time.monotonic at the executor's 0
        if tick.ahead is None:
            return
        if self._latest is None:
            raise DriverError("no joint state has come: the robot's clock is not known")
        ends_at_rest = np.ptp(tick.ahead.q, axis=0).max() == 0.0
        if ends_at_rest and self._still.shape == tick.q.shape and (self._still == tick.q).all():
            return  # it stands there already
        self._still = tick.ahead.q[-1]
        self._rests_at = begin + DELAY + tick.ahead.t[-1]
        self._begun = True
        goal = self._trajectory(tick.ahead, tick.t, begin + DELAY + tick.t - self._offset)
        self._send_goal(goal)

    def _trajectory(self, ahead: Ahead, t: float, start: float) -> dict[str, Any]:
        """Return the goal of a way ahead from time t of the executor on, which is `start` by the robot's clock, s."""
        last = len(ahead.t) - 1
        points = [
            {
                "positions": ahead.q[k].tolist(),
                "velocities": (ahead.v[k] if k < last else 0.0 * ahead.v[k]).tolist(),
                "accelerations": (ahead.a[k] if k < last else 0.0 * ahead.a[k]).tolist(),
                "time_from_start": _duration(max(ahead.t[k] - t, GAP)),
            }
            for k in range(last + 1)
            if k == last or ahead.t[k] >= t + GAP
        ]
        header = {"stamp": _duration(start), "frame_id": ""}
        return {"trajectory": {"header": header, "joint_names": list(self._names), "points": points}}

    def _send_goal(self, goal: dict[str, Any]) -> None:
        sent: list[str] = []  # the answer may come before the number is known

        def finished(result: Mapping[str, Any]) -> None:
            status = result["status"]
            newest = not sent or sent[0] == self._goal
            if newest and getattr(status, "value", status) != SUCCEEDED:
                values = result.get("values") or "no reason given"
                inner = values.get("result", values) if isinstance(values, Mapping) else {"error_string": values}
                why = inner.get("error_string") or inner.get("error_code", "no reason given")
                self._fail(f"the controller ended a goal with status {getattr(status, 'name', status)}: {why}")

        self._goal = None
        sent.append(self._action.send_goal(self._ros_module.Goal(goal), finished, lambda _: None, finished))
        self._goal = sent[0]

    def stop(self, reason: str) -> None:
        """Wait until the robot has come to the end of its last goal, which is a stop, and disconnect."""
        if self._closed:
            return
        self._closed = True
        if not self._fault:
            time.sleep(min(COMES_TO_REST_IN, max(0.0, self._rests_at - time.monotonic())))
        for topic in self._topics:
            topic.unsubscribe()
        self._ros.close()

    def _lose(self, *_: object) -> None:
        self._fail("the connection to the rosbridge server is lost")
        self._ros.factory.maxRetries = 0  # a client that connects again would send old goals

    def _take_state(self, message: Mapping[str, Any]) -> None:
        now = time.monotonic()
        try:
            place = {name: k for k, name in enumerate(message["name"])}
            missing = [name for name in self._names if name not in place]
            if missing:
                return  # another part of the robot publishes here, too
            q = np.array([message["position"][place[name]] for name in self._names], dtype=float)
            speeds = message.get("velocity") or []
            v = np.array([speeds[place[name]] for name in self._names], dtype=float) if speeds else np.zeros(len(q))
            stamp = float(message["header"]["stamp"]["sec"]) + 1e-9 * float(message["header"]["stamp"]["nanosec"])
            if not is_finite(stamp):
                raise ValueError(f"a stamp of {stamp} s")
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            self._fail(f"a joint state that cannot be read: {type(error).__name__} {error}")
            return
        seen = self._latest
        ahead = self._offset - (now - stamp)  # negative: a delay
        if seen is not None and self._begun and (stamp < seen[1].stamp or ahead > DELAY):
            jump = f"from {seen[1].stamp:.3f} to {stamp:.3f} s within {now - seen[0]:.3f} s"
            self._fail(f"the stamps of joint states leapt {jump}: the robot's clock is not known any more")
            return
        with self._lock:
            least = self._robot.take(now, stamp)
            most = DRIFT * (now - seen[0]) if seen is not None and self._begun else np.inf
            self._offset += min(max(least - self._offset, -most), most)
            self._latest = now, Measurement(q, v, stamp)

    def _take_scaling(self, message: Mapping[str, Any]) -> None:
        value = message.get("data") if isinstance(message, Mapping) else None
        if not is_finite(value) or abs(value - self._full) > FULL * self._full:
            share = f"{value / self._full:.0%}" if is_finite(value) else described(value)
            self._fail(f"the robot scales its speed to {share}; expected full speed there, and `override` here")

    def _fail(self, reason: str) -> None:
        if not self._closed:
            self._fault = self._fault or reason

    def _check(self) -> None:
        if self._fault:
            raise DriverError(self._fault)


def _client() -> Any:
    if find_spec("roslibpy") is None:
        raise OptiPlanError("the driver 'ros2_control' needs the package roslibpy: pip install 'optiplan[ros]'")
    logging.getLogger("roslibpy").addHandler(logging.NullHandler())  # else it writes tracebacks where nobody logs
    return import_module("roslibpy")


def _duration(seconds: float) -> dict[str, int]:
    """Return a time of ROS: whole seconds, and nanoseconds."""
    whole = int(np.floor(seconds))
    return {"sec": whole, "nanosec": min(999_999_999, round(1e9 * (seconds - whole)))}
