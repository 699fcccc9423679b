"""Client for a cell's controller: joint state and target in, timed points and status out.

One file that needs httpx and numpy and nothing else of OptiPlan. A server hands it out, so that the two fit:
`curl -O http://SERVER:7100/cell.py`.

Example:
    from cell import CellPlanner

    cell = CellPlanner("http://127.0.0.1:7100", "cell.yaml")             # the scene, the robot, the limits
    motion = cell.plan(joints, target=(0.5, 0.2, 0.6, 1, 0, 0, 0), budget=0.5)
    if motion.verified:
        for t, q, v in zip(motion.t, motion.q, motion.v):
            ...                                                    # to the drives
    else:
        print(motion.status, motion.reason)

    with cell.execute(motion, driver="sim", lease=1.0) as robot:      # the server drives; it stops if we go away
        robot.override(0.5)
        print(robot.wait())
"""

import json
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import numpy.typing as npt

PATIENCE = 90.0
"""s that a server has for an answer; a motion that is to be executed is verified first."""
RESUME = 30.0
"""s for which a stream of events that broke off is taken up again; `RETRY` s between two tries."""
RETRY = 1.0
EXECUTIONS = "/api/executions"


@dataclass(frozen=True)
class CellMotion:
    """What a server answered.

    Attributes:
        status: `verified`; `not verified`, whose motion must not be driven; `failed`, `busy`, `late` or `unreachable`.
        reason: why it is not verified, in a sentence; empty where it is.
        joint_names: of the planned joints.
        t: times (k,), s, from 0.
        q: positions (k, n), rad or m.
        v: velocities (k, n), rad/s or m/s.
        a: accelerations (k, n), rad/s^2 or m/s^2.
        seconds: of planning and proof.
        run: id on the server.
    """

    status: str
    reason: str = ""
    joint_names: tuple[str, ...] = ()
    t: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    q: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    v: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    a: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    seconds: float = 0.0
    run: str = ""

    @property
    def verified(self) -> bool:
        """Whether the motion is proved free of collision and within limits."""
        return self.status == "verified"


class CellPlanner:
    """A problem on a server, to be planned again and again from other states to other targets.

    Args:
        url: of the server.
        problem: path or text of a problem file (YAML); its start and goal are used where `plan` gives none.
        token: where the server wants one.

    Raises:
        ValueError: the server refuses the problem; says everything that is wrong with it.
        httpx.HTTPError: it cannot be reached.
    """

    def __init__(self, url: str, problem: str | Path, token: str = "") -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(base_url=url, headers=headers, timeout=httpx.Timeout(10.0))
        text = str(problem) if "\n" in str(problem) else Path(problem).read_text("utf-8")
        answer = self._http.post("/api/problems", json={"problem": text, "name": _stem(problem)})
        if answer.status_code != 201:
            raise ValueError(_error(answer))
        self.problem: str = answer.json()["hash"]

    def plan(
        self,
        joints: Sequence[float] | Mapping[str, float] | None = None,
        target: Sequence[float] | None = None,
        *,
        joint_target: Sequence[float] | Mapping[str, float] | None = None,
        velocities: Sequence[float] | Mapping[str, float] | None = None,
        accelerations: Sequence[float] | Mapping[str, float] | None = None,
        budget: float = 1.0,
        deadline: float | None = None,
        planner: str | None = None,
        rate: float = 200.0,
        warm_start: str = "",
    ) -> CellMotion:
        """Plan from a state to a target and wait for the answer; nothing is raised, `status` says what happened.

        Args:
            joints: positions of the planned joints now, (n,) or `{joint: value}`, rad or m; so the others.
            target: pose of the tool in the world: x, y, z, m, and the quaternion x, y, z, w.
            joint_target: or positions of the joints (n,).
            velocities: of a robot that moves (n,), rad/s or m/s; with `joints`, where it will be when the answer is
                there, such as a row of `q`, `v` and `a` of the motion before.
            accelerations: likewise (n,), rad/s^2 or m/s^2.
            budget: s for planning and proof.
            deadline: s from now after which no answer is wanted.
            planner: another one than the problem's.
            rate: points a second of the answer, at least; fewer are quicker to send where motions are long.
            warm_start: `run` of an earlier motion, where not much has changed since: planning begins at it.
        """
        given = {"joints": joints, "velocities": velocities, "accelerations": accelerations, "target": target}
        given |= {"joint_target": joint_target, "budget": [budget], "rate": [rate]}
        given |= {"deadline": None if deadline is None else [deadline]}
        try:
            asked = _request({name: _numbers(name, value) for name, value in given.items() if value is not None})
        except ValueError as error:
            return CellMotion("failed", str(error))
        asked |= {"problem": self.problem, "planner": planner, "warm_start": warm_start or None}
        wait = max(0.0, asked.get("deadline") or asked["budget"] + 20.0) + 1.0
        try:
            answer = self._http.post("/api/plan", json=asked, timeout=wait)
            if answer.status_code == 200:
                return _motion(json.loads(answer.content))
        except httpx.TimeoutException:
            return CellMotion("late", f"no answer within {wait:g} s")
        except httpx.HTTPError as error:
            return CellMotion("unreachable", str(error))
        except Exception as error:  # a closed connection, an answer that is none of ours: a controller goes on
            return CellMotion("failed", f"{type(error).__name__}: {error}")
        status = {429: "busy", 503: "busy", 504: "late"}.get(answer.status_code, "failed")
        return CellMotion(status, _error(answer))

    def execute(self, motion: CellMotion | str, driver: str = "sim", **options: Any) -> "RemoteExecution":
        """Have the server execute a motion of it.

        Args:
            motion: verified, or the id of a run.
            driver: of the server.
            options: `override`, `clearance`, `deviation`, `rate`, `patience`, `lease`; see `POST /api/executions`.

        Raises:
            CellError: the server refuses, or cannot be reached.
        """
        about = self._sent("POST", EXECUTIONS, {**_motion_of(motion), "driver": driver, **options})
        return RemoteExecution(self._http, self._sent, _motion_of, about)

    def _sent(self, method: str, path: str, body: Mapping[str, Any] | None) -> Any:
        """Return the answer to a request.

        Raises:
            CellError: it is refused, or nobody answers.
        """
        try:
            answer = self._http.request(method, path, json=body, timeout=PATIENCE)
        except httpx.HTTPError as error:
            raise CellError(0, f"{self._http.base_url}: {error or type(error).__name__}") from error
        if answer.status_code >= 400:
            raise CellError(answer.status_code, _error(answer))
        return answer.json()

    def close(self) -> None:
        """Close the connection; the problem stays on the server."""
        self._http.close()

    def __enter__(self) -> "CellPlanner":
        """Itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connection."""
        self.close()


class CellError(Exception):
    """A server that refuses, or cannot be reached: `status` is that of HTTP, 0 where there is none."""

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(detail)
        self.status = status


class RemoteExecution:
    """A motion that a server executes, as `CellPlanner.execute` and `op.Client.execute` start it.

    Methods return the robot's state. What the server refuses is raised: `CellError`, of `op.Client` its `ServerError`.
    `id` is that on the server; `about` has `name`, `driver`, `duration` (s), `rate` (Hz), `joint_names`, `lease` (s).
    """

    def __init__(
        self,
        http: httpx.Client,
        send: Callable[[str, str, Mapping[str, Any] | None], Any],
        motion_of: Callable[[Any], Mapping[str, Any]],
        about: Mapping[str, Any],
    ) -> None:
        self.id, self.about = str(about["id"]), dict(about)
        self._http, self._send, self._motion_of = http, send, motion_of
        self._closed = threading.Event()
        if about["lease"] is not None:
            threading.Thread(target=self._renew, args=(about["lease"],), name="lease", daemon=True).start()

    def override(self, speed: float) -> dict[str, Any]:
        """Set the wanted speed, 0 to 1 of the planned motion's."""
        return self._say("override", {"speed": speed})

    def pause(self) -> dict[str, Any]:
        """Stop along the path; `resume` and `reverse` go on."""
        return self._say("pause")

    def resume(self) -> dict[str, Any]:
        """Go on forwards."""
        return self._say("resume")

    def reverse(self) -> dict[str, Any]:
        """Stop, and go back along the path."""
        return self._say("reverse")

    def stop(self, reason: str = "asked to stop") -> dict[str, Any]:
        """Stop along the path, which ends the execution."""
        return self._say("stop", {"reason": reason})

    def update_scene(
        self, poses: Mapping[str, Any], velocities: Mapping[str, Sequence[float]] | None = None, spread: float = 0.0
    ) -> dict[str, Any]:
        """Obstacles of the scene have moved.

        `poses` by name: each an `op.Pose`, or x, y, z, m, and the quaternion x, y, z, w; `velocities` (3,) of those
        that do not stand still, m/s; `spread`: how fast they may depart from that course, m/s.
        """
        moved = {name: list(map(float, velocity)) for name, velocity in (velocities or {}).items()}
        given = {"poses": {name: _pose(pose) for name, pose in poses.items()}, "velocities": moved, "spread": spread}
        return self._say("obstacles", given)

    def state_in(self, latency: float) -> dict[str, list[float]]:
        """Return `joints`, `velocity` and `acceleration` in `latency` s: the start of a motion that is to take over."""
        return dict(self._say("state", {"latency": latency}))

    def splice(self, motion: Any) -> bool:
        """Let another verified motion take over where it begins; return whether it does. Where not, the robot stops."""
        return bool(self._say("splice", self._motion_of(motion))["taken"])

    def events(self) -> Iterator[dict[str, Any]]:
        """States as they come, 25 a second, at last `end` with its `reason` and whether it is `clean`.

        A stream that breaks is taken up again for `RESUME` s; then an `httpx.HTTPError` is raised.
        """
        lost = 0.0
        while True:
            try:
                for _, event in server_events(self._http, f"{EXECUTIONS}/{self.id}/events"):
                    lost = 0.0
                    if event["type"] == "end" and event.get("clean") is None:
                        break  # that of the stream alone
                    yield event
                    if event["type"] == "end":
                        return
                gone: Exception = httpx.RemoteProtocolError("the stream ended before the execution")
            except httpx.HTTPError as error:
                gone = error
            lost = lost or time.monotonic()
            if time.monotonic() - lost > RESUME:
                raise gone
            time.sleep(RETRY)

    def wait(self, timeout: float = math.inf) -> dict[str, Any]:
        """Wait for the end, at most `timeout` s; return `ended`, the reason or None, `clean`, and the last `state`."""
        until = time.monotonic() + timeout
        while True:
            found = self._send("GET", f"{EXECUTIONS}/{self.id}", None)
            if found["ended"] is not None or time.monotonic() >= until:
                return dict(found)
            time.sleep(min(0.1, max(0.0, until - time.monotonic())))

    def close(self) -> None:
        """Renew the lease no more: the robot stops, if it has one."""
        self._closed.set()

    def __enter__(self) -> "RemoteExecution":
        """Itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Renew the lease no more."""
        self.close()

    def _say(self, what: str, given: Mapping[str, Any] | None = None) -> dict[str, Any]:
        answer: dict[str, Any] = self._send("POST", f"{EXECUTIONS}/{self.id}/{what}", given or {})
        return answer

    def _renew(self, lease: float) -> None:
        while not self._closed.wait(lease / 4):
            try:
                self._say("alive")
            except Exception as error:  # the next time may do better, and where not, the robot stops
                if getattr(error, "status", 0) in (404, 409):
                    return


def server_events(
    http: httpx.Client, path: str, headers: Mapping[str, str] | None = None
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the events of a stream with their ids, empty where they have none.

    Raises:
        httpx.HTTPStatusError: the server refuses; its answer is read.
        httpx.HTTPError: the connection breaks.
    """
    number = ""
    with http.stream("GET", path, headers=headers, timeout=PATIENCE) as lines:
        if lines.status_code != 200:
            lines.read()
            raise httpx.HTTPStatusError(_error(lines), request=lines.request, response=lines)
        for line in lines.iter_lines():
            if line.startswith("id:"):
                number = line[3:].strip()
            elif line.startswith("data:"):
                yield number, json.loads(line[5:])
                number = ""


def _pose(given: Any) -> list[float]:
    """x, y, z and quaternion, from a pose's `matrix` (4, 4) by the method of Bar-Itzhack."""
    if not hasattr(given, "matrix"):
        return [float(x) for x in given]
    R = np.asarray(given.matrix)[:3, :3]
    K = np.zeros((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[3, :3] = K[:3, 3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = np.trace(R)
    return [*map(float, np.asarray(given.matrix)[:3, 3]), *map(float, np.linalg.eigh(K)[1][:, -1])]


def _motion_of(motion: CellMotion | str) -> dict[str, Any]:
    """A motion as the server takes it; a `ValueError` says where it is not verified."""
    if isinstance(motion, CellMotion) and not motion.verified:
        raise ValueError(f"motion: found one that is {motion.status}; expected a verified one")
    return {"run": motion.run if isinstance(motion, CellMotion) else motion}


def _motion(answer: Mapping[str, Any]) -> CellMotion:
    seconds = sum(value for value in (answer["timings"] or {}).values() if isinstance(value, float))
    points = answer["trajectory"]
    if points is None:
        failure = answer["failure"] or {}
        return CellMotion(
            "failed", f"{failure.get('kind')}: {failure.get('detail')}", seconds=seconds, run=answer["id"]
        )
    verified = answer["verified"] is True
    return CellMotion(
        status="verified" if verified else "not verified",
        reason="" if verified else "the motion breaks a limit or touches something; its run.json says where",
        joint_names=tuple(points["joint_names"]),
        seconds=seconds,
        run=answer["id"],
        **{key: np.array(points[key], float) for key in ("t", "q", "v", "a")},
    )


def _numbers(name: str, values: Any) -> Any:
    """Numbers, or numbers by joint, as the server takes them; a `ValueError` says of which argument they are none."""
    if isinstance(values, Mapping) and name in _BY_JOINT:
        return {str(joint): _numbers(f"{name}[{joint!r}]", [value])[0] for joint, value in values.items()}
    try:
        found = [math.nan if isinstance(value, str | bytes) else float(value) for value in values]
    except (TypeError, ValueError, OverflowError):
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise ValueError(f"{name}: found {' '.join(repr(values).split())[:80]}; expected finite numbers")
    return found


_BY_JOINT = ("joints", "joint_target", "velocities", "accelerations")
"""Arguments that have one value a planned joint."""


def _request(given: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of a request, each where the server wants it."""
    state = {"joints": "joints", "velocities": "velocity", "accelerations": "acceleration"}
    start = {key: given[name] for name, key in state.items() if name in given}
    if start and "joints" not in start:
        raise ValueError("joints: found nothing; expected those at which the robot has these velocities, accelerations")
    asked: dict[str, Any] = {name: given[name][0] for name in ("budget", "rate", "deadline") if name in given}
    if asked.get("rate") == 0.0:
        raise ValueError("rate: found 0; expected points a second above 0")
    pose, joints = given.get("target"), given.get("joint_target")
    if pose is not None and (joints is not None or len(pose) != 7):
        found = f"{len(pose)} numbers" if joints is None else "a joint_target beside it"
        raise ValueError(f"target: found {found}; expected x, y, z and the quaternion x, y, z, w, or a joint_target")
    if pose is not None:
        asked["goal"] = {"pose": {"position": pose[:3], "quaternion": pose[3:]}}
    elif joints is not None:
        asked["goal"] = {"joints": joints}
    return asked | ({"start": start} if start else {})


def _stem(problem: str | Path) -> str | None:
    return None if "\n" in str(problem) else Path(problem).stem


def _error(answer: httpx.Response) -> str:
    try:
        return str(answer.json()["error"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {answer.status_code}"
