"""Driver `sim`: the robot of a run in MuJoCo, in real time, in a process of its own."""

import pickle
import subprocess
import sys
import time
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, get_args

import numpy as np

from optiplan.arrays import number_argument
from optiplan.errors import choice_argument, wrong_argument
from optiplan.execution.drivers.base import Capabilities, DriverError
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Tick
from optiplan.runs.run import Run
from optiplan.simulation.plants.dynamics import check_inertias
from optiplan.simulation.plants.mujoco_plant import mujoco_module
from optiplan.simulation.plants.task_plant import changes_tools
from optiplan.simulation.real_time import messages
from optiplan.simulation.real_time.messages import Packet
from optiplan.simulation.real_time.sim_process import Setup, SimEngine

LEAD = 0.1
"""s: so long the robot goes on without set-points before it stops along its path."""

SILENT_TICKS = 3
"""Set-points that may be missing before the robot follows the way ahead."""

READY_IN = 60.0
"""s, for the process to load its libraries and make its robot."""

LET_GO_IN = 5.0
"""s, for the robot to stand still and the process to report."""

HANGS_AFTER = 1.5
"""s without a state."""


class SimDriver:
    """A simulated robot that takes set-points as drives do: position, velocity and acceleration.

    Its drives follow them by computed torque, in cycles of 1 ms. Without set-points they follow `Tick.ahead`, to a
    stand. A process that ends, however, is seen at the next call.

    Args:
        run: whose robot and scene are simulated; the robot stands where the run begins.
        rate: set-points per second, Hz.
        engine: `mujoco`, `own`, or `ideal`, which follows exactly; None: MuJoCo where it is installed and no tools are
            changed, else `own`.
        frequency: of the drives' error dynamics, Hz.
        payload: kg at the tool that the drives do not know of.

    Attributes:
        report: what came of it, after `stop`: `contacts`, `objects` of a task and how far they
            are from the plan at its end, m, `error_rms` and `error_max` of the joints, rad or m,
            `interval_std` and `interval_max` between set-points as they came, s, `slipped` time that the simulation
            was too slow, s.

    Raises:
        InputError: an argument that cannot be, a robot whose joints move no inertia, or MuJoCo for a change of tools.
        OptiPlanError: MuJoCo is not installed, or the process does not start.
    """

    def __init__(
        self,
        run: Run,
        *,
        rate: float = 500.0,
        engine: str | None = None,
        frequency: float = 20.0,
        payload: float = 0.0,
    ) -> None:
        if engine is not None:
            choice_argument("driver", "engine", engine, get_args(SimEngine))
        for name, value, least in (("rate", rate, 10.0), ("frequency", frequency, 0.1), ("payload", payload, 0.0)):
            number_argument("driver", name, value, f"a finite number >= {least:g}", least)
        assert run.trajectory is not None
        problem = run.problem
        tools = changes_tools(problem)
        chosen = engine or ("mujoco" if find_spec("mujoco") is not None and not tools else "own")
        if chosen == "mujoco" and tools:
            raise wrong_argument(
                "driver", "engine", "mujoco, with a task that changes tools", "the engine own or ideal"
            )
        if chosen == "mujoco":
            mujoco_module()
        if chosen != "ideal":
            check_inertias(problem.robot)
        self._n, self._names = problem.robot.n, tuple(problem.robot.joint_names)
        self._rate = float(rate)
        self._latest: Measurement | None = None
        self._sent = 0.0
        self.report: dict[str, Any] = {}
        silence = SILENT_TICKS / rate
        self._start(Setup(problem, run.trajectory, chosen, float(frequency), float(payload), silence))  # type: ignore[arg-type]

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def _start(self, setup: Setup) -> None:
        self._end, theirs = messages.connected()
        module = "optiplan.simulation.real_time.sim_process"
        with theirs:
            number = theirs.fileno()
            command = [sys.executable, "-m", module, str(number)]
            self._process = subprocess.Popen(command, pass_fds=[number], stdin=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None
        with suppress(BrokenPipeError), self._process.stdin as pipe:  # a process that is gone is seen below
            pickle.dump(setup, pipe)
        began = time.monotonic()
        while time.monotonic() < began + READY_IN:
            if any(kind is Packet.READY for kind, _ in self._packets()):
                return
            time.sleep(0.01)
        self._process.kill()
        raise DriverError(f"the simulation was not ready within {READY_IN:g} s")

    def capabilities(self) -> Capabilities:
        """Positions with feed-forward of velocity and acceleration; a way ahead is kept."""
        return Capabilities("sim", self._names, self._rate, ("position", "velocity"), True, 0.0, LEAD)

    def state(self) -> Measurement | None:
        """Return the state of the last cycle."""
        for kind, content in self._packets():
            if kind is Packet.STATE:
                values = np.frombuffer(content)
                self._sent, n = float(values[1]), self._n
                self._latest = Measurement(values[2 : 2 + n], values[2 + n :], float(values[0]))
        if self._latest is None:
            return None
        age = max(0.0, time.monotonic() - self._sent)
        return Measurement(self._latest.q, self._latest.v, self._latest.stamp, age)

    def send(self, tick: Tick) -> None:
        """Hand over a set-point, the way ahead where it is new, and the place on the path."""
        packets = [] if tick.ahead is None else [messages.ahead_packet(tick.ahead)]
        packets.append(messages.tick_packet(tick))
        try:
            for packet in packets:
                self._end.send(packet)
        except BlockingIOError:
            raise DriverError("the simulation takes no set-points any more: it hangs") from None
        except ConnectionError:
            raise self._gone() from None

    def stop(self, reason: str) -> None:
        """Let the robot come to a stand along its path, and end the process."""
        if self._process.returncode is not None:
            return
        try:
            self._end.send(Packet.STOP.value)
            began = heard = time.monotonic()
            while not self.report and time.monotonic() < min(began + LET_GO_IN, heard + HANGS_AFTER):
                heard = time.monotonic() if self._packets() else heard
                time.sleep(1e-3)
            self._process.wait(1.0)
        except (OSError, DriverError, subprocess.TimeoutExpired):  # it is gone, or hangs
            pass
        finally:
            self._process.kill()
            self._process.wait()
            self._end.close()

    def _packets(self) -> list[tuple[Packet, bytes]]:
        """Return what the process sent; raise what it failed of."""
        try:
            found = messages.received(self._end)
        except ConnectionError:
            raise self._gone() from None
        for kind, content in found:
            if kind is Packet.FAILED:
                raise DriverError(f"the simulation failed: {messages.data_of(content)}")
            if kind is Packet.REPORT:
                self.report = messages.data_of(content)
        return found

    def _gone(self) -> DriverError:
        try:
            code = self._process.wait(0.05)
        except subprocess.TimeoutExpired:
            return DriverError("the simulation has closed its connection")
        how = f"by signal {-code}" if code < 0 else f"with code {code}"
        return DriverError(f"the process of the simulation ended {how}")
