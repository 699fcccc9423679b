"""A motion that is executed in this process: words of the server go to the execution, states of it go back."""

import gc
import json
import queue
import signal
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from optiplan.api.driving import execution_by
from optiplan.arrays import finite_or_none
from optiplan.bench.execution.keeper import RESPITE
from optiplan.cores import keeping_time, take_turns
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.execution.executor import Executor
from optiplan.execution.loop.tick_loop import PATIENCE
from optiplan.geometry.pose import Pose
from optiplan.problem.problem import Problem
from optiplan.runs.run import Run
from optiplan.runs.stored_runs import run_of_record
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import jsonable
from optiplan.viewer.runs import Poses

STREAM = 0.04
"""s between two states that are sent."""
LISTEN = 0.01
"""s that words are waited for at a time."""
LATELY = 1000
"""Set-points whose lateness is summed up in a state."""

Message = dict[str, Any]
Read = Callable[[Mapping[str, Any]], Problem]
"""What reads the problem of a request."""


class Executing:
    """An execution and what is said to it.

    Args:
        read: of problems.
        request: `problem`, `motion` (text of a trajectory.json), `driver`, `driver_options`; `override`, `clearance`,
            `deviation`, `paused`, `rate`, `patience` and `lease` as in `ExecutionRequest`.

    Raises:
        OptiPlanError: the motion is not verified or cannot be executed, or the driver cannot be reached.
    """

    def __init__(self, read: Read, request: Mapping[str, Any]) -> None:
        self._read = read
        self._runs = [verified_run(read, request)]
        run = self._runs[0]
        limits = {"clearance": request["clearance"], "deviation": request["deviation"]}
        speed = request["override"]
        self._executor = Executor(run, override=0.0 if request["paused"] else speed, **limits)
        self._executor.override = speed  # one that began with 0 stays paused
        self._executor.prepare()
        options, patience = request["driver_options"], request["patience"] or PATIENCE
        self._execution, self._driver = execution_by(
            request["driver"], self._executor, options, request["rate"], patience
        )
        self._poses = Poses(run.problem)
        self._obstacles: dict[str, list[float]] = {}
        self._replies: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._lease: float | None = request["lease"]
        self._alive = time.monotonic()
        self._asked = ""  # why the robot was asked to stop

    @property
    def about(self) -> Message:
        """What is reported before it begins."""
        run = self._runs[0]
        robot = run.problem.robot
        return {
            "name": run.problem.name,
            "robot": robot.name,
            "duration": run.duration,
            "rate": self._execution.capabilities.rate,
            "joint_names": list(robot.joint_names),
            "velocity_limits": list(map(finite_or_none, run.problem.limits.velocity)),
        }

    def run(self, channel: Any) -> Message:
        """Move until the execution is over; return `reason`, and whether that is `clean`: at the end, or as asked.

        Where nobody is there any more, or on SIGTERM, the robot stops along its path first.

        Raises:
            DriverError: the robot is not where the motion begins.
        """
        gc.collect()
        gc.disable()  # looking through all that is loaded takes 50 ms
        try:
            with keeping_time():
                self._execution.start()
                self._serve(channel)
        except OSError:  # nobody is there any more
            self._stop("the server has gone")
        finally:
            self._execution.stop("nothing watches over the execution any more")
            found = self._execution.wait(RESPITE)
            gc.enable()
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
        asked = found["phase"] == "stopped" and found["reason"] == self._asked
        contacts = getattr(self._driver, "report", {}).get("contacts")
        touched = ["touched: " + "; ".join(" and ".join(pair) for pair in contacts)] if contacts else []
        reason = "; ".join([found["reason"] or found["phase"], *touched])
        return {"reason": reason, "clean": bool(found["over"] and (found["phase"] == "done" or asked) and not touched)}

    def _serve(self, channel: Any) -> None:
        """Pass words and states on until the execution is over.

        Raises:
            OSError: nobody is there any more.
        """
        asked_to_end, told = threading.Event(), -STREAM
        signal.signal(signal.SIGTERM, lambda *_: asked_to_end.set())
        channel.answered(self.about, {})
        self._alive = time.monotonic()  # nobody can renew a lease before
        while not self._execution.over:
            for message in channel.heard(LISTEN):
                self._answer(message)
            if asked_to_end.is_set():
                asked_to_end.clear()
                self._stop("the process was asked to end")
            self._check_lease()
            while not self._replies.empty():
                channel.state(self._replies.get())
            if time.monotonic() - told >= STREAM:
                told = time.monotonic()
                channel.state({"state": self.state()})
        channel.state({"state": self.state()})

    def _check_lease(self) -> None:
        if self._lease is not None and time.monotonic() - self._alive > self._lease:
            self._stop(f"no client has renewed its lease for {self._lease:g} s", False)
            self._lease = None

    def state(self) -> Message:
        """What the robot does, JSON-ready; `docs/service.md` lists its keys."""
        found = self._execution.snapshot()
        start = self._runs[0].problem.start
        seen = found["measured"] or ()
        complete = len(seen) == len(start) and None not in seen  # else the executor stops, and says why
        q = np.asarray(seen if complete else found["q"] or start, dtype=float)
        run = self._executor.run
        return {
            **found,
            "q": found["q"] or start.tolist(),
            "poses": self._poses.of(q[None])[0][0].tolist(),
            "obstacles": self._obstacles,
            "lateness": self._execution.lateness(LATELY),
            "report": jsonable(getattr(self._driver, "report", {})),
            "tried_on_hardware": self._execution.capabilities.tried_on_hardware,
            "motion": next((k for k, one in enumerate(self._runs) if one is run), 0),
        }

    def _stop(self, reason: str, asked: bool = True) -> None:
        if asked:
            self._asked = reason
        self._execution.stop(reason)

    def _answer(self, message: Message) -> None:
        """Do what a message says; the answer goes back with its number.

        Raises:
            BrokenPipeError: it says that the line has ended.
        """
        if "do" not in message:
            raise BrokenPipeError
        number = message["number"]

        def work() -> None:
            try:
                answer = getattr(self, f"do_{message['do']}")(message) or {"state": self.state()}
            except InputError as error:
                answer = {"error": str(error), "issues": [vars(issue) for issue in error.issues]}
            except OptiPlanError as error:
                answer = {"error": str(error), "issues": []}
            except Exception as error:  # a bug of ours is no reason to leave the robot alone
                answer = {"error": f"internal error: {type(error).__name__}: {error}", "status": 500}
            self._replies.put({"reply": number, **answer})

        def work_for_long() -> None:
            take_turns()
            work()

        if message["do"] == "splice":  # it is verified first, which takes a moment
            threading.Thread(target=work_for_long, name="splice", daemon=True).start()
        else:
            work()

    def do_override(self, message: Message) -> None:
        """Set the wanted speed."""
        self._execution.override(message["speed"])

    def do_pause(self, message: Message) -> None:
        """Stop along the path."""
        self._execution.pause()

    def do_resume(self, message: Message) -> None:
        """Go on."""
        self._execution.resume()

    def do_reverse(self, message: Message) -> None:
        """Go back along the path."""
        self._execution.reverse()

    def do_stop(self, message: Message) -> None:
        """Stop for good."""
        self._stop(message["reason"])

    def do_alive(self, message: Message) -> None:
        """Renew the lease."""
        self._alive = time.monotonic()

    def do_obstacles(self, message: Message) -> None:
        """Obstacles have moved.

        Raises:
            InputError: the scene has no such obstacle.
        """
        known = {one.name for one in self._executor.run.problem.scene.obstacles}
        named = [(f"body.{key}", name) for key in ("poses", "velocities") for name in message[key]]
        expected = f"an obstacle of the scene: {', '.join(sorted(known)) or 'it has none'}"
        issues = [Issue("request", None, key, f"'{name}'", expected) for key, name in named if name not in known]
        if issues:
            raise InputError(issues)
        poses = {name: Pose(tuple(pose[:3]), quaternion=tuple(pose[3:])) for name, pose in message["poses"].items()}
        self._execution.update_scene(poses, message["velocities"], message["spread"])
        self._obstacles |= message["poses"]

    def do_state_in(self, message: Message) -> Message:
        """Return the state in which another motion can take over."""
        state = self._execution.state_in(message["latency"])
        return {"joints": state.q.tolist(), "velocity": state.v.tolist(), "acceleration": state.a.tolist()}

    def do_splice(self, message: Message) -> Message:
        """Let another motion take over; return whether it does, and why not."""
        run = verified_run(self._read, message["request"])
        taken = self._execution.splice(run)
        if taken:
            self._runs.append(run)
        # the snapshot is that of the last tick, which may be from before
        return {"taken": taken, "reason": "" if taken else self._executor.status.reason or "the execution is over"}


def verified_run(read: Read, request: Mapping[str, Any]) -> Run:
    """Return the run of a request's problem and motion, verified afresh.

    Raises:
        InputError: the problem or the motion cannot be read, or the motion is not verified.
    """
    problem = read(request)
    motion = Trajectory.from_dict(json.loads(request["motion"]))
    run = run_of_record({"planner": problem.planner}, motion, problem)
    if not run.verified:
        found = "a motion that is not verified"
        failed = [check.name for check in run.report.checks if not check.passed] if run.report else []
        found += f": {', '.join(failed)}" if failed else ""
        raise InputError([Issue("request", None, "body.trajectory", found, "a motion that is verified on its problem")])
    return run
