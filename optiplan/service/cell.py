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
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import numpy.typing as npt


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

    def close(self) -> None:
        """Close the connection; the problem stays on the server."""
        self._http.close()

    def __enter__(self) -> "CellPlanner":
        """Itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connection."""
        self.close()


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
