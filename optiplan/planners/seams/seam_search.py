"""Find the motion along a path of the tool: posture, smoothing, timing, and the way to where it begins."""

from dataclasses import field, replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, Planner, Progress
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import out_of_time, with_reason
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.common.limit_violations import Excess
from optiplan.planners.common.tolerances import NO_MOTION
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.seams.posture_ladder import Posture, PostureLadder, rounded_down
from optiplan.planners.seams.posture_smoothing import PostureSmoothing, Stations
from optiplan.planners.seams.rungs import Rungs
from optiplan.planners.seams.seam_motion import first_within_limits, joined, joint_curves, ramped, run_up, steady
from optiplan.planners.seams.seam_tool import SeamTool
from optiplan.problem.goals_and_vias import ExactGoal
from optiplan.problem.problem import Problem, derived
from optiplan.problem.seams.actions import SeamPath
from optiplan.records import dataclass
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.trajectory import Trajectory

_SPACING, _BEND = 0.006, 0.1
"""m between stations, and rad of turn of the path between them, at most."""

_MOST = 4000
"""Stations."""

_FINER = 3
"""Times that the stations are made closer where the tool is off its path between them."""

_SHARE = 0.4
"""Share of the tolerances of place and speed that the motion may take between stations."""

_WILD = 5.0
"""Share of a speed limit beyond which a joint changes its branch."""

_ROUNDS = 12
"""Steps of smoothing."""

_ANCHORS = (0.0, 3.0, 100.0)
"""Weights of staying near the posture of the ladder, where what is smoother is not free."""

_RUNGS, _MANY, _FEWER = 160, 300, 64
"""Configurations of a rung, and of each where there are more rungs than the second number."""

_TRIES = 6
"""Postures that are tried, each without what was in the way of those before."""


@dataclass(frozen=True, eq=False)
class FoundSeam:
    """A motion to a path and along it.

    Attributes:
        approach: from the start to where the run-in begins; None where the robot is there already.
        motion: from rest to rest: run-in, path and run-out.
        times: (k,) s in `motion`, when it is at each of the requested lengths.
        info: what the search did.
    """

    approach: Trajectory | None
    motion: Trajectory
    times: Array
    info: dict[str, Any]


@dataclass(frozen=True, eq=False)
class _Along:
    """The motion along a path, from rest to rest; `begin` of the path itself, s, and lengths s(t) at knots of time."""

    motion: Trajectory
    knots: Array
    lengths: Array


@dataclass(eq=False)
class SeamSearch:
    """One search.

    Attributes:
        problem: of the joints that move; its start is where the arm stands before.
        path: the path.
        model: of that robot in its scene.
        planner: of the way to the path.
        budget: time for all of it: the posture is sought no longer than until it is found.
        approaching: time in which the way to the path is sought, which planners use up for a better one.
        info: what the search did.
    """

    problem: Problem
    path: SeamPath
    model: CollisionModel
    planner: Planner[Any]
    budget: Budget
    approaching: Budget
    progress: Progress
    info: dict[str, Any] = field(default_factory=dict)

    def run(self) -> FoundSeam | Failure:
        """Search within the budget."""
        tool = SeamTool(replace(self.problem.robot, limits=self.problem.limits), self.path)
        if self.problem.robot.n < tool.equalities:
            words = f"{self.problem.robot.n} joints cannot hold the {tool.equalities} coordinates that the path gives"
            return Failure("unsupported", words)
        check = MotionCheck(self.model, self.problem.limits, Gravity(self.problem.robot, self.problem.limits.torque))
        rungs = Rungs(self.problem, tool, check, _RUNGS)
        ladder = PostureLadder(self.problem, self.path, rungs)
        rungs.most = _RUNGS if len(ladder.lengths()) <= _MANY else _FEWER
        failure: Failure | None = None
        for k in range(_TRIES):
            self.progress("choosing the posture along the path", k / _TRIES)
            posture = ladder.climb(self.budget)
            if isinstance(posture, Failure):
                return with_reason(posture, failure) if posture.kind in ("budget", "cancelled") else failure or posture
            self.info["postures"] = k + 1
            found = self._follow(tool, posture)
            if not isinstance(found, Failure):
                return found
            if found.kind in ("budget", "cancelled"):
                return with_reason(found, failure)
            failure = failure or found
            if found.kind == "limits" or "path" not in found.witness:
                break
            rungs.barred.append((float(found.witness["path"]), np.array(found.witness["q"])))
        return failure or Failure("no-path", "no posture along the path was found")

    def _follow(self, tool: SeamTool, posture: Posture) -> FoundSeam | Failure:
        """Return the motion in a posture, or why there is none."""
        failure: Failure | None = None
        for anchor in _ANCHORS:
            along = self._along(tool, posture, anchor)
            if self.budget.over:
                return out_of_time(self.budget, "smoothing the posture along a path", failure)
            if isinstance(along, Failure):
                failure = failure or along
                continue
            approach = self._approach(along.motion.start)
            if isinstance(approach, Failure):
                return replace(approach, witness={**approach.witness, "path": 0.0, "q": along.motion.start.tolist()})
            places = np.array([low for low, _ in self.path.parts()] + [self.path.curve.length])
            times = np.interp(places, along.lengths, along.knots)
            self.info |= {"tool_length": self.path.curve.length}
            return FoundSeam(approach, along.motion, times, self.info)
        return failure or Failure("no-path", "no smooth posture was found")

    def _along(self, tool: SeamTool, posture: Posture, anchor: float) -> _Along | Failure:
        """Return the motion along the path, the tool near enough to it between stations, or why there is none."""
        spacing = _SPACING
        for _ in range(_FINER + 1):
            stations = self._stations(tool, spacing)
            smoothing = PostureSmoothing(self.problem, tool, stations)
            Q = np.stack([np.interp(stations.s, posture.s, column) for column in posture.Q.T], axis=1)
            Q = smoothing.smooth(Q, _ROUNDS, anchor)
            wild = self._wild(smoothing, Q)
            if wild is not None:
                return wild
            off = self._off_between(tool, stations.s, Q)
            if off <= 1.0 or len(stations.s) >= _MOST:
                break
            spacing *= 0.5
        self.info |= {"stations": len(stations.s)}
        error = tool.corrected(Q, stations.at, 0)[1]
        if error.max() > 1e-5:
            k = int(error.argmax())
            detail = f"the posture cannot be made smooth at {stations.s[k]:.4g} m of the path"
            return Failure("no-path", detail, {"q": Q[k].tolist(), "path": float(stations.s[k])})
        return self._timed(tool, stations, Q)

    def _wild(self, smoothing: PostureSmoothing, Q: Array) -> Failure | None:
        """Return where joints would be far too fast to be on one branch; None where they are nowhere."""
        speeds = smoothing.shares(Q)[0]
        if speeds.max() <= _WILD:
            return None
        k, j = np.unravel_index(int(speeds.argmax()), speeds.shape)
        s = float(smoothing.stations.s[k])
        name = self.problem.robot.joint_names[j]
        detail = f"no posture that was found leads on at {s:.4g} m of the path: '{name}' would jump"
        return Failure("no-path", detail, {"q": Q[k].tolist(), "path": s})

    def _stations(self, tool: SeamTool, spacing: float) -> Stations:
        """Return stations closer where the path bends, and at its corners."""
        curve = self.path.curve
        spacing = max(spacing, curve.length / _MOST)
        s, corners = [0.0], set()
        for low, high in curve.runs():
            fine = np.linspace(low, high, max(9, int((high - low) / (0.25 * spacing))) + 1)
            bend = np.linalg.norm(curve.points(0.5 * (fine[1:] + fine[:-1]), 2), axis=1)
            density = np.maximum(1.0 / spacing, bend * (_SPACING / spacing) / _BEND)
            kernel = np.ones(9) / 9.0
            density = np.convolve(np.pad(density, 4, mode="edge"), kernel, mode="valid")
            counts = np.concatenate([[0.0], np.cumsum(density * np.diff(fine))])
            number = max(6, int(np.ceil(counts[-1])))
            s += np.interp(np.linspace(0.0, counts[-1], number + 1)[1:], counts, fine).tolist()
            corners.add(len(s) - 1)
        lengths = np.array(s)
        corner = np.zeros(len(lengths), dtype=bool)
        corner[sorted(corners)[:-1]] = True
        return Stations(tool.places(lengths), corner)

    def _off_between(self, tool: SeamTool, s: Array, Q: Array) -> float:
        """Return how far the tool is off its path, direction and speed between stations, as a share of what may be."""
        path = self.path
        worst = 0.0
        for one in joint_curves(self.problem, tool, s, Q):
            own = one.low + one.curve.breakpoints
            at = np.concatenate([own[:-1] + share * np.diff(own) for share in (0.25, 0.5, 0.75)])
            states = one.state(at)
            rows = tool.rows(states[:, 0], tool.places(at), path.cone)
            off = np.linalg.norm(rows.e[:, :3], axis=1).max() / path.position
            turned = np.abs(rows.e[:, 3:]).max() / path.orientation
            speed = np.einsum("nij,nj->ni", rows.J[:, :3], states[:, 1])
            uneven = np.abs(np.linalg.norm(speed, axis=1) - 1.0).max() / path.within
            worst = max(worst, float(off), float(turned), float(uneven))
        return worst / _SHARE

    def _timed(self, tool: SeamTool, stations: Stations, Q: Array) -> _Along | Failure:
        path, parts = self.path, list[Trajectory]()
        knots, lengths, t = [0.0], [0.0], 0.0
        for one in joint_curves(self.problem, tool, stations.s, Q):
            high = one.low + one.curve.duration
            if path.ramp:
                motion = ramped(self.problem, one, path.speed, path.ramp)
                if not isinstance(motion, Trajectory):
                    return self._too_fast(
                        motion, one.state(np.array([one.low]))[0, 0], one.low, "to stop within its ramp"
                    )
                fine = np.linspace(0.0, motion.duration, 400)
                lengths += np.interp(fine[1:], *_travelled(tool, motion, (one.low, high))).tolist()
                knots += (t + fine[1:]).tolist()
                parts.append(motion)
                t += motion.duration
                continue
            motion = steady(one, path.speed)
            kept = first_within_limits(self.problem, [motion])
            if not isinstance(kept, Trajectory):
                return self._too_fast(kept, motion.start, 0.0, "along the path", motion)
            state = one.state(np.array([one.low, high]))
            states = state * np.array([1.0, path.speed, path.speed**2])[:, None]
            begin, end = (run_up(self.problem, states[k], out=k == 1) for k in (0, 1))
            for run, q in ((begin, states[0, 0]), (end, states[1, 0])):
                if not isinstance(run, Trajectory):
                    return self._too_fast(run, q, 0.0 if run is begin else high, "to gain or lose it at its ends")
            assert isinstance(begin, Trajectory)
            assert isinstance(end, Trajectory)
            parts += [begin, motion, end]
            knots, lengths = [begin.duration, begin.duration + motion.duration], [0.0, high]
        whole = joined(parts)
        along = _Along(whole, np.array(knots), np.array(lengths))
        return self._free(along)

    def _free(self, along: _Along) -> _Along | Failure:
        touch = first_contact(self.model, along.motion, lambda: self.budget.over)
        if touch is None:
            return along
        if self.budget.over:
            return out_of_time(self.budget, "checking a path for contacts")
        at = float(np.interp(touch.t, along.knots, along.lengths))
        detail = f"at {at:.4g} m of the path {touch.words}"
        return Failure("collision", detail, {**touch.witness(), "path": at})

    def _too_fast(
        self, over: Excess | None, q: Array, s: float, words: str, motion: Trajectory | None = None
    ) -> Failure:
        path = self.path
        if over is None:
            detail = f"{path.speed:g} m/s is faster than the arm {words}: torques pass their limits"
            return Failure("limits", detail, {"q": q.tolist()})
        name = self.problem.robot.joint_names[over.joint]
        unit = self.problem.robot.unit(over.quantity, over.joint)
        possible = ""
        if motion is not None:
            s, q = path.speed * over.t, motion(over.t)
            order = ORDERS.index(over.quantity)
            if order:
                slower = path.speed * abs(over.limit / over.value) ** (1.0 / order)
                possible = f"; {rounded_down(slower):.2g} m/s is possible there"
        detail = (
            f"{path.speed:g} m/s is faster than the arm {words}: '{name}' would reach {over.quantity} {over.value:.4g} "
            f"{unit}, beyond its limit {over.limit:.4g}, at {s:.4g} m{possible}"
        )
        return Failure("limits", detail, {"q": q.tolist(), "path": s, "joint": name, "quantity": over.quantity})

    def _approach(self, q: Array) -> Trajectory | Failure | None:
        """Return the motion from the start to a configuration (n,); None where the robot is there."""
        if np.abs(q - self.problem.start).max() <= NO_MOTION:
            return None
        self.progress("planning the way to the path", 0.9)
        there = derived(self.problem, goal=(ExactGoal(q),))
        time = self.budget if self.approaching.over else self.approaching
        result = plan_through(self.planner, there, time.share(0.6), self.progress)
        return result.trajectory or result.failure or Failure("no-path", "no way to the path was found")


def _travelled(tool: SeamTool, motion: Trajectory, run: tuple[float, float]) -> tuple[Array, Array]:
    """Return times and the lengths of the path at them, m, of a motion along one of its runs."""
    t = np.linspace(0.0, motion.duration, 2000)
    p = tool.poses(motion(t))[:, :3, 3]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    return t, run[0] + (run[1] - run[0]) * way / max(float(way[-1]), 1e-12)
