"""`optiplan.bench.peers:Peer`: a third-party planner in a process and an environment of its own.

The peer is a script of `benchmarks/peers/`, run by the interpreter that has its libraries. It reads one JSON object
from its standard input and writes one to its standard output; benchmarks/peers/README.md says what they hold.
"""

import json
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.shapes import shape_data
from optiplan.planners.base import Budget, Failure, PlanResult, Progress
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.path_timing import timed_path
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

POLL = 0.05
"""s between two looks at the budget."""


@dataclass(frozen=True)
class PeerOptions:
    """Which peer.

    Attributes:
        adapter: the script.
        python: the interpreter that runs it.
        settings: passed to the script, as `name=value`.
        search: s that the script is told it has; None: the budget of the run, of which starting Python and loading its
            libraries, which is not planning, takes some.
    """

    adapter: str = ""
    python: str = "python3"
    settings: tuple[str, ...] | None = None
    search: float | None = None

    def __post_init__(self) -> None:
        """Raise ValueError without a script: found out before a suite, not in its first run."""
        if not Path(self.adapter).is_file():
            raise ValueError(f"adapter: no file {self.adapter or 'given'}")


class Peer:
    """Peer planner: problem, goals and verifier are ours; the path, and the timing if any, are the peer's.

    `timings` tells `peer`, the seconds that the script counts: starting Python and loading the robot are not planning.
    """

    Options = PeerOptions

    def __init__(self, options: PeerOptions) -> None:
        self.options = options

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        if problem.scene.attached or problem.vias:
            return PlanResult(None, Failure("unsupported", "peers are not told of attached objects and vias"), {})
        model = CollisionModel(problem.robot, problem.scene)
        goals = ranked_goals(problem, model, budget)
        if isinstance(goals, Failure):
            return PlanResult(None, goals, {})
        progress("peer", 0.0)
        began = time.perf_counter()
        told = {"settings": self._settings(), "budget": self.options.search or budget.seconds}
        answer = self._ask(request(problem, goals, budget) | told, budget)
        timings = {"peer": answer.get("seconds", time.perf_counter() - began)}
        if "failure" in answer:
            return PlanResult(None, Failure("no-path", str(answer["failure"])), timings, {"cut_short": budget.over})
        path_found = {"path_found": True, "timed_by": "ours" if "waypoints" in answer else "peer"}
        motion = trajectory_of(answer, problem, model, budget)
        failed = None if motion is not None else Failure("limits", "the peer's path cannot be timed within the limits")
        return PlanResult(motion, failed, timings, path_found)

    def _settings(self) -> dict[str, str]:
        return dict(word.split("=", 1) for word in self.options.settings or ())

    def _ask(self, question: Mapping[str, Any], budget: Budget) -> dict[str, Any]:
        command = [self.options.python, self.options.adapter]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
            sent: str | None = json.dumps(question)
            while True:
                try:
                    out, err = process.communicate(sent, timeout=POLL)
                    break
                except subprocess.TimeoutExpired:
                    sent = None  # communicate goes on with what it was given first
                    if budget.over:
                        process.kill()
                        process.communicate()
                        return {"failure": f"no answer within the budget of {budget.seconds:g} s"}
        try:
            answer: dict[str, Any] = json.loads(out.strip().splitlines()[-1])
        except (IndexError, ValueError):
            return {"failure": f"exit code {process.returncode} without an answer: {err.strip()[-500:]}"}
        return answer


def request(problem: Problem, goals: list[Array], budget: Budget) -> dict[str, Any]:
    """Return the request to a peer: all in the robot's base frame, joints in the order of `joints`; rad, m, s."""
    robot, limits = problem.robot, problem.limits
    return {
        "version": 1,
        "joints": list(robot.joint_names),
        "urdf": robot.urdf,
        "locked": dict(robot.locked),
        "allowed": [list(pair) for pair in robot.allowed],
        "lower": limits.lower.tolist(),
        "upper": limits.upper.tolist(),
        "velocity": limits.velocity.tolist(),
        "acceleration": limits.acceleration.tolist(),
        "start": problem.start.tolist(),
        "goals": [goal.tolist() for goal in goals],
        "obstacles": [
            {"name": body.name, "shape": shape_data(body.shape), "pose": body.X_WO.homogeneous.tolist()}
            for body in problem.scene.obstacles
        ],
        "seed": problem.seed,
        "budget": budget.seconds,
    }


def trajectory_of(
    answer: Mapping[str, Any], problem: Problem, model: CollisionModel, budget: Budget
) -> Trajectory | None:
    """Return the peer's motion unchanged.

    `pieces` are polynomials (breakpoints, coefficients as in `Trajectory`). `samples` (times, positions, velocities)
    are joined by cubics, q and dq/dt as given at each of them. `waypoints` are timed by us, corners rounded.
    """
    names = problem.robot.joint_names
    if "pieces" in answer:
        parts = answer["pieces"]
        return Trajectory(names, np.array(parts["breakpoints"]), np.array(parts["coefficients"]))
    if "samples" in answer:
        parts = {name: np.array(values, float) for name, values in answer["samples"].items()}
        return Trajectory(names, parts["times"], _cubics(parts["times"], parts["positions"], parts["velocities"]))
    return timed_path(model, np.array(answer["waypoints"], float), problem.limits, budget)


def _cubics(t: Array, q: Array, v: Array) -> Array:
    """Coefficients (m, 4, n) of the cubics between samples (m + 1) of q and dq/dt."""
    h, rise = np.diff(t)[:, None], np.diff(q, axis=0)
    square = 3 * rise / h**2 - (2 * v[:-1] + v[1:]) / h
    cube = -2 * rise / h**3 + (v[:-1] + v[1:]) / h**2
    return np.stack([q[:-1], v[:-1], square, cube], axis=1)
