"""`rounded`: straight lines in joint space from via to via, with corners rounded within a stated deviation."""

from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.context import PlanContext
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import contact_witness, out_of_time, too_heavy
from optiplan.planners.common.path_timing import stopping
from optiplan.planners.common.refused_path import refused_path
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.planners.vias.via_chains import chain_tolerances, distinct, ranked_chains
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.paths.corners import bezier_corners, bspline_corners, reversals, through_corners
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.time_path import TimingOptions, time_path
from optiplan.trajectory.trajectory import Trajectory

_DOING = "rounding corners"
_SHARPEST = 1e-4  # rad or m, of a deviation
_HALVINGS = 4  # of the deviation, where the rounded path touches something
_SLOW = 1.5  # times the duration with a stop at each corner: corners with so little room are not rounded


@dataclass(frozen=True)
class RoundedOptions(PlannerOptions):
    """Options of `rounded`."""

    curve: Literal["bezier", "bspline"] = option(
        "bezier", "of the corners: quintic Bézier blends, or the whole path as a cubic B-spline."
    )
    deviation: float = option(
        0.05,
        "from the straight lines, rad or m of the joint that deviates most; smaller where that avoids a collision. A "
        "via whose tolerance is smaller is hit, on a straight stretch between two corners.",
        least=_SHARPEST,
    )
    goals: int = option(8, "how many goal configurations to try, the quickest to reach first.", above=0)


class Rounded(Planner[RoundedOptions]):
    """Planner of rounded corners, with stops where a path turns back or has no room for them.

    Times and velocities of vias are ignored.
    """

    Options = RoundedOptions

    passes_vias = True

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        work = PlanContext.of(problem, budget)
        watch = work.watch
        with watch.stage("goals"):
            chains = ranked_chains(problem, work.model, budget, self.options.goals)
        if isinstance(chains, Failure):
            return PlanResult(None, chains, watch.seconds)
        refused: list[Failure] = []
        for k, chain in enumerate(chains):
            if budget.over:
                return PlanResult(None, out_of_time(budget, _DOING), watch.seconds)
            progress("goals", k / len(chains))
            with watch.stage("collision"):
                sections = self._free_sections(work, chain)
            if isinstance(sections, Failure):
                refused.append(sections)
                continue
            with watch.stage("timing"):
                timed = [_timed(work, section) for section in sections]
            motions = [motion for motion in timed if motion is not None]
            if len(motions) == len(sections):
                return PlanResult(
                    join_trajectories(motions), None, watch.seconds, {"goal": k, "cut_short": budget.over}
                )
            refused.append(too_heavy(problem.robot, problem.limits, chain))
        return PlanResult(None, out_of_time(budget, _DOING) if budget.over else refused[0], watch.seconds)

    def _free_sections(self, work: PlanContext, chain: Array) -> "list[_Section] | Failure":
        """Return the free path in sections from stop to stop, or the failure."""
        deviation, refused = self.options.deviation, None
        for _ in range(_HALVINGS + 1):
            sections = self._sections(work.problem, chain, deviation)
            refused = _refused(work, sections)
            if refused is None or work.budget.over:
                break
            deviation = max(0.5 * deviation, _SHARPEST)
        return refused or sections

    def _sections(self, problem: Problem, chain: Array, deviation: float) -> "list[_Section]":
        limits, names = problem.limits, problem.robot.joint_names
        kept = distinct(chain, np.empty(0))
        points, hit = chain[kept], chain_tolerances(problem)[kept] < deviation
        if len(points) == 1:
            return [_Section(stop_at_corners(points[[0, 0]], limits, names), points[[0, 0]])]
        curve = bezier_corners if self.options.curve == "bezier" else bspline_corners
        stops = [0, *(i for i, back in enumerate(reversals(points, limits), 1) if back), len(points) - 1]
        sections = []
        for a, b in pairwise(stops):
            part = slice(a, b + 1)
            corners, shares = through_corners(points[part], hit[part], deviation, limits)
            sections.append(_Section(curve(corners, shares, limits, names), points[part]))
        return sections


class _Section(NamedTuple):
    """A path that turns back nowhere, and the points (k, n), rad or m, whose corners it rounds."""

    path: Trajectory
    points: Array


def _timed(work: PlanContext, section: _Section) -> Trajectory | None:
    """Return the motion along a section, or with a stop at each of its corners where that is far quicker, and free.

    None where gravity is too much.
    """
    robot, limits = work.problem.robot, work.problem.limits
    motion = time_path(section.path, robot, limits, TimingOptions(stop=lambda: work.budget.over))
    stops = stopping(robot, limits, section.points)
    if motion is None or stops is None or motion.duration <= _SLOW * stops.duration:
        return motion
    return stops if first_contact(work.model, stops, lambda: work.budget.over) is None else motion


def _refused(work: PlanContext, sections: list[_Section]) -> Failure | None:
    """Report the first colliding pair of a path in sections; the path parameter is internal and omitted."""
    paths = [section.path for section in sections]
    for k, path in enumerate(paths):
        touch = first_contact(work.model, path, lambda: work.budget.over)
        if touch is None:
            continue
        detail = f"the rounded path is not free: {touch.contact.meeting}"
        shown = refused_path(paths, k, touch.t, work.problem.limits)
        return Failure("collision", detail, contact_witness(touch.q, touch.contact) | shown)
    return None
