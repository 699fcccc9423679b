"""Driver `ur_rtde`: the servo interface of Universal Robots over RTDE, by the client `ur_rtde` (extra `[ur]`).

Not tried on hardware. See `UrRtdeDriver`.
"""

import socket
import struct
import time
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from optiplan.arrays import number_argument
from optiplan.errors import OptiPlanError, described, wrong_argument
from optiplan.execution.drivers.base import Capabilities, DriverError
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Tick
from optiplan.runs.run import Run

JOINTS = 6

LEAST_RATE = 10.0
"""Hz: set-points that come more slowly end the robot's program: its watchdog."""

PORT = 30004
"""Of RTDE."""

ANSWERS_IN = 5.0
"""s."""

ASK, AGREE = struct.pack(">HBH", 5, ord("V"), 2), struct.pack(">HBB", 4, ord("V"), 1)
"""Packets with which we ask for version 2 of the protocol, and a robot agrees."""

BRAKING = 5.0
"""rad/s², with which `stop` ends what is left of a motion."""

VARIABLES = (
    "timestamp",
    "actual_q",
    "actual_qd",
    "speed_scaling",
    "target_speed_fraction",
    "robot_mode",
    "safety_mode",
    "robot_status_bits",
    "safety_status_bits",
    "runtime_state",
)
"""What the robot sends in each cycle."""

FULL = 0.999
"""Share of the full speed that counts as full."""


class UrRtdeDriver:
    """Send each set-point with `servoj`, which holds it until the next one.

    The client uploads a program to the robot, which must be in remote control. Its watchdog ends the program where no
    set-point comes for 0.1 s. A speed slider below 100 %, a protective or an emergency stop end in a stop.

    Args:
        run: of a robot with the six joints of the arm, in its order.
        host: name or address of the robot.
        rate: set-points per second, Hz: 500, or 125 for robots before the e-Series.
        lookahead: s, 0.03 to 0.2: by which `servoj` smooths; the robot is later by about this time.
        gain: 100 to 2000: how stiffly `servoj` follows.

    Raises:
        InputError: an argument that cannot be, or another robot.
        DriverError: the robot cannot be reached, or refuses the program.
        OptiPlanError: ur_rtde is not installed.
    """

    def __init__(
        self, run: Run, *, host: str = "", rate: float = 500.0, lookahead: float = 0.1, gain: float = 300.0
    ) -> None:
        names = tuple(run.problem.robot.joint_names)
        if len(names) != JOINTS:
            raise wrong_argument("driver", "run", f"a robot of {len(names)} joints", f"an arm of {JOINTS} joints")
        if not isinstance(host, str) or not host:
            raise wrong_argument("driver", "host", described(host), "the name or address of the robot")
        ranges = {"rate": (rate, LEAST_RATE, 500.0), "lookahead": (lookahead, 0.03, 0.2), "gain": (gain, 100.0, 2000.0)}
        for name, (value, least, most) in ranges.items():
            number_argument("driver", name, value, f"a number from {least:g} to {most:g}", least, most=most)
        self._names, self._rate, self._lookahead, self._gain = names, float(rate), float(lookahead), float(gain)
        self._stamp, self._came, self._watched = -1.0, time.monotonic(), False
        self._receive, self._control = self._connect(host)

    def _connect(self, host: str) -> tuple[Any, Any]:
        if find_spec("rtde_control") is None:
            raise OptiPlanError("the driver 'ur_rtde' needs the package ur_rtde: pip install 'optiplan[ur]'")
        _check_answer(host)
        receive = None
        try:
            receive = import_module("rtde_receive").RTDEReceiveInterface(host, self._rate, list(VARIABLES))
            control = import_module("rtde_control").RTDEControlInterface(host, self._rate)
        except Exception as error:  # the client raises what its C++ does
            if receive is not None:
                receive.disconnect()
            raise DriverError(f"no robot at {host}: {error}") from None
        return receive, control

    def capabilities(self) -> Capabilities:
        """Single positions; not tried on hardware."""
        return Capabilities("ur_rtde", self._names, self._rate, ("position",), True, self._lookahead)

    def state(self) -> Measurement | None:
        """Return the state of the robot's last cycle; the first call begins the watchdog, right before set-points."""
        receive = self._receive
        self._check_connected()
        for stopped, words in (
            (receive.isProtectiveStopped, "a protective"),
            (receive.isEmergencyStopped, "an emergency"),
        ):
            if stopped():
                raise DriverError(f"the robot is in {words} stop")
        speed = receive.getSpeedScaling() * receive.getTargetSpeedFraction()
        if not speed >= FULL:  # NaN, too
            raise DriverError(f"the robot scales its speed to {speed:.0%}; expected 100% there, and `override` here")
        if not self._watched:  # not at a set-point, which it would delay
            self._watched = bool(self._control.setWatchdog(LEAST_RATE))
        stamp, now = float(receive.getTimestamp()), time.monotonic()
        if stamp != self._stamp:
            self._stamp, self._came = stamp, now
        return Measurement(np.array(receive.getActualQ()), np.array(receive.getActualQd()), stamp, now - self._came)

    def send(self, tick: Tick) -> None:
        """Send a position."""
        self._check_connected()  # the client would try to connect again, for seconds
        if not self._control.servoJ(tick.q.tolist(), 0.0, 0.0, 1.0 / self._rate, self._lookahead, self._gain):
            raise DriverError("the robot takes no set-points: its program does not run, or its safety has stopped it")

    def _check_connected(self) -> None:
        if not (self._receive.isConnected() and self._control.isConnected()):
            raise DriverError("the connection to the robot is lost")

    def stop(self, reason: str) -> None:
        """End the servo motion and the program, and disconnect."""
        control, receive, self._control, self._receive = self._control, self._receive, _Gone(), _Gone()
        if isinstance(control, _Gone):
            return
        calls = [lambda: control.servoStop(BRAKING), control.stopScript, control.disconnect, receive.disconnect]
        for call in calls if control.isConnected() and receive.isConnected() else calls[2:]:
            with suppress(Exception):  # each is tried, whatever became of the others
                call()


def _check_answer(host: str) -> None:
    """Refuse what does not speak RTDE: the client would wait for ever, and no other thread of Python would run.

    Raises:
        DriverError: nothing answers in time, or something else does.
    """
    try:
        with socket.create_connection((host, PORT), ANSWERS_IN) as peer, peer.makefile("rb") as answers:
            peer.sendall(ASK)
            answer = answers.read(len(AGREE))
    except TimeoutError:
        raise DriverError(f"no robot at {host}: no answer within {ANSWERS_IN:g} s") from None
    except (OSError, ValueError) as error:  # a name that cannot be one is the latter
        reason = getattr(error, "strerror", None) or error
        raise DriverError(f"no robot at {host}: {reason}") from None
    if answer != AGREE:
        raise DriverError(f"no robot at {host}: what answers at port {PORT} does not agree to version 2 of RTDE")


class _Gone:
    """In place of an interface after the end."""

    def __getattr__(self, name: str) -> Any:
        raise DriverError("the driver is disconnected")
