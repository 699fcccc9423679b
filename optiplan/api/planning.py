"""`plan`, `verify` and `retime`: a proved motion for a problem, and the proof of a motion that is there."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optiplan.arrays import Array, number_argument
from optiplan.errors import (
    InputError,
    Issue,
    UnknownChoiceError,
    described,
    options_argument,
    progress_argument,
    seed_argument,
    wrong_argument,
)
from optiplan.planners.base import Budget, Planner, PlanResult, Progress, silent
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.third_party import planner_object
from optiplan.problem.problem import JointGoal, Problem, Via
from optiplan.problem.tracking_error import TrackingError, error_argument
from optiplan.robot.given_configurations import configuration, is_by_name
from optiplan.runs import pipeline
from optiplan.runs.proofs_on_the_way import ProofsOnTheWay
from optiplan.runs.run import Run
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import verify as verifier
from optiplan.verify.report import Report

if TYPE_CHECKING:
    from optiplan.trajectory.sample_file import Samples


BUDGET = 20.0
"""Seconds of planning and proof, when none are given."""

_STRAIGHT = 1e-9  # rad or m: a waypoint that is nearer than this to the line between its neighbours is no corner
_HIT = 1e-6  # rad or m: tolerance of waypoints


def plan(  # noqa: PLR0913  # one keyword for each thing that may differ from the problem's own
    problem: Problem,
    planner: str | Planner[Any] | None = None,
    options: Mapping[str, Any] | None = None,
    budget: float | Budget = BUDGET,
    seed: int | None = None,
    progress: Progress | None = None,
    warm_start: Run | Trajectory | None = None,
    tracking_error: TrackingError | Array | None = None,
) -> Run:
    """Plan a motion, prove it and measure it.

    No motion within the budget is no exception: then `Run.trajectory` is None, and `Run.failure` says why.

    Args:
        problem: the task.
        planner: a name of `op.planners()`, `module:Class`, or a planner itself (see `op.Planner`), which brings its
            options along; None: the problem's own, which is `trajopt` where it names none.
        options: of that planner, by name; None: the problem's own options for its own planner, the defaults of others.
        budget: seconds of wall time for planning and proof, or a `Budget`, which another thread can cancel.
        seed: of what is random; None: the problem's own. The same problem, planner, options and seed give the same
            motion, as long as the budget does not cut the work short.
        progress: called with the name of a stage and the fraction (0 to 1) of it that is done. If it has a method
            `found(motion, bound)`, that is called with each better motion, not verified yet, and a lower bound on
            durations, s (0: none known); if it has `proved(motion, seconds)`, that is called with verified ones and the
            seconds since planning began: at once with the first one, with later ones as far as proofs take no more than
            a tenth of the time, with the others in the end.
        warm_start: an earlier run, or a motion, of a problem not far from this one (another scene, goal or start, a
            robot that is on its way by now). `trajopt` begins at it and mostly needs no search. Where it costs less
            (see `Objective`) than what is found, it is verified on *this* problem, after the planning, and is the
            answer if it holds. `Run.info["warm_start"]` says what became of it: `kept`, `beaten` (the answer costs no
            more) or `refused`.
        tracking_error: how far the joints may be from the motion, rad or m: a number, (n,) or `{joint: value}`; None:
            the problem's own. Clearance, position limits and path constraints of poses, pairs and couplings are proved
            for every configuration with |q_j - q_j(t)| <= tracking_error_j at any time; `Report.scope` says so.

    Returns:
        The run: `verified`, `trajectory`, `report`, `failure`, `duration`, `ratio`, `metrics`, `improvements`.

    Raises:
        InputError: an argument that does not fit, or options that do not go with the problem.

    Example:
        >>> import optiplan as op
        >>> run = op.plan(op.load_problem("01_reach"), budget=5.0, seed=1)
        >>> run.verified
        True
    """
    checked_problem(problem, "plan")
    asked, chosen = _planner(problem, planner, options)
    progress_argument("plan", progress, "a function of a stage's name and a fraction")
    clock = budget if isinstance(budget, Budget) else Budget(positive_seconds("plan", budget))
    told = progress or silent
    if seed is not None:
        problem = problem.with_seed(seed_argument("plan", seed))
    if tracking_error is not None:
        problem = with_tracking_error(problem, tracking_error)
    known = _known(warm_start)
    try:
        return pipeline.answer(problem, asked, chosen, clock, told, known)
    except UnknownChoiceError as error:
        argument = {"planner": "planner", "option": "options"}.get(error.kind.partition(" ")[0])
        if argument is None:
            raise
        raise error.of_argument("plan", argument) from None


def plan_within(problem: Problem, budget: Budget) -> Run:
    """Return the run of a problem with its own planner within a budget: a `studies.proof.Plan`."""
    return plan(problem, budget=budget)


def with_tracking_error(problem: Problem, error: TrackingError | Array) -> Problem:
    """Return the problem with the argument `tracking_error` of `op.plan`."""
    each = error_argument("plan", problem.robot, error)
    try:
        return problem.with_parts(tracking_error=float(each[0]) if np.ptp(each) == 0.0 else each)
    except InputError as issue:
        raise issue.about("op.Problem", "op.plan") from None


def verify(problem: Problem, motion: "Trajectory | Samples | Run | Path | str | Sequence[Array]") -> Report:
    """Verify a motion of any origin against its problem.

    Args:
        problem: that the motion is for.
        motion: a `Trajectory`; `Samples`, or (t, q) with times (k,), s, and positions (k, n), rad or m; a `Run`; or the
            path of a run folder, a `trajectory.json` or a CSV of samples. Samples are interpolated; the report says
            how.

    Returns:
        The report: `verified`, and every check with its worst value, limit, time and place. A bad motion is a refusal,
        not an exception.

    Raises:
        InputError: what is given is no motion, or a file of it cannot be read.

    Example:
        >>> import optiplan as op
        >>> problem = op.load_problem("01_reach")
        >>> op.verify(problem, op.plan(problem).trajectory).verified
        True
    """
    from optiplan.trajectory.sample_file import Samples

    checked_problem(problem, "verify")
    names = problem.robot.joint_names
    if isinstance(motion, Trajectory):
        return verifier.verify(problem, motion)
    if isinstance(motion, str | Path):
        from optiplan.runs.run_folder import load_run
        from optiplan.runs.stored_runs import judged

        stored = load_run(motion, names)
        if stored.trajectory is None:
            raise wrong_argument(
                "verify", "motion", f"{str(motion)!r}, a run without a trajectory", "a run with a trajectory"
            )
        return judged(problem, stored)
    if isinstance(motion, Run) and motion.trajectory is not None:
        return verifier.verify(problem, motion.trajectory)
    if isinstance(motion, Sequence) and not isinstance(motion, str) and len(motion) == 2:
        try:
            motion = Samples(names, np.asarray(motion[0], float), np.asarray(motion[1], float), file="op.verify")
        except (TypeError, ValueError, OverflowError):
            raise wrong_argument("verify", "motion", described(motion), "times (k,) and positions (k, n)") from None
    if isinstance(motion, Samples):
        report = verifier.verify(problem, motion.trajectory())
        return replace(report, scope=(*report.scope, f"interpolation of the samples: {motion.interpolation}"))
    found = "a run without a trajectory" if isinstance(motion, Run) else described(motion)
    raise wrong_argument("verify", "motion", found, "a Trajectory, Samples, (t, q), a Run with a motion, or a path")


def retime(problem: Problem, waypoints: Array | Sequence[Sequence[float]], deviation: float = 0.0) -> Run:
    """Time a path within the limits of a problem, and prove the motion.

    Without a deviation the path stays what it is, straight lines in joint space from waypoint to waypoint: the motion
    stops at every corner, in the shortest time from each to the next that limits of velocity, acceleration and jerk
    allow, slower where torque asks for it. With one, corners are rounded (planner `rounded`) and it does not stop.

    Args:
        problem: robot, scene and limits; the run's own problem goes from the first waypoint past all to the last.
        waypoints: (k, n), k >= 2, rad or m; each may be values by joint, `{joint: value}`.
        deviation: from the straight lines, rad or m of the joint that deviates most; 0 or at least 1e-4.

    Returns:
        The run. A path that is not free is no exception but a motion that is not verified, or a failure.

    Raises:
        InputError: an argument that does not fit, or a waypoint that is outside the limits or in collision.

    Example:
        >>> import optiplan as op
        >>> problem = op.load_problem("12_planar")
        >>> op.retime(problem, [problem.start, problem.start + 0.1]).verified
        True
    """
    checked_problem(problem, "retime")
    if problem.task:
        raise wrong_argument(
            "retime", "problem", "a problem with a task", "one with a goal, which the last waypoint replaces"
        )
    points = _waypoints(problem, waypoints)
    hit = max(number_argument("retime", "deviation", deviation, "a number >= 0", 0.0), _HIT)
    vias = [Via(JointGoal(q, hit)) for q in points[1:-1]]
    try:
        task = problem.with_vias().with_start(points[0]).with_goal(JointGoal(points[-1])).with_vias(*vias)
    except InputError as error:
        raise _of_waypoints(error, len(points)) from None
    if deviation > 0.0:
        return plan(task, "rounded", {"deviation": float(deviation)})
    began, proofs = time.perf_counter(), ProofsOnTheWay(task, silent)
    fastest = stop_at_corners(_corners(points), task.limits, task.robot.joint_names)
    motion = within_torque(task.robot, task.limits, fastest) or fastest  # which the verifier refuses for its torque
    timings = {"plan": time.perf_counter() - began}
    return pipeline.proved(task, "retime", {}, PlanResult(motion, None, {}), Budget(BUDGET), proofs, timings)


def checked_problem(problem: Any, function: str, argument: str = "problem") -> None:
    """Refuse an argument of a function that is no problem."""
    if not isinstance(problem, Problem):
        raise wrong_argument(function, argument, described(problem), "op.load_problem(…) or op.Problem(…)")


def _planner(problem: Problem, planner: Any, options: Any) -> tuple[str | Planner[Any], Mapping[str, Any]]:
    """The planner that is asked for, and its options."""
    options_argument("plan", options)
    if planner is None or isinstance(planner, str):
        return pipeline.chosen(problem, planner, options)
    found = planner_object(planner)
    if found is None:
        expected = (
            "the name of a planner (see op.planners()) or a planner, an object with plan(problem, budget, progress)"
        )
        raise wrong_argument("plan", "planner", described(planner), expected)
    if options:
        expected = "none: a planner that is an object is made with its options"
        raise wrong_argument("plan", "options", described(options), expected)
    return found, {}


def positive_seconds(function: str, budget: Any) -> float:
    """Return the seconds of a budget that is a number.

    Raises:
        InputError: it is none, or not above 0.
    """
    return number_argument(function, "budget", budget, "a number of seconds above 0", above=0.0)


def _known(warm_start: Any) -> Trajectory | None:
    """The motion that is at hand."""
    if warm_start is not None and not isinstance(warm_start, Run | Trajectory):
        raise wrong_argument("plan", "warm_start", described(warm_start), "a Run or a Trajectory")
    return warm_start.trajectory if isinstance(warm_start, Run) else warm_start


def _waypoints(problem: Problem, waypoints: Any) -> Array:
    robot = problem.robot
    if isinstance(waypoints, Sequence) and any(map(is_by_name, waypoints)):
        named = enumerate(waypoints)
        given = robot.joint_names, robot.configurations
        waypoints = [configuration(*given, q, "retime", f"waypoints[{k}]") for k, q in named]
    try:
        points = np.asarray(waypoints, float)
    except (TypeError, ValueError, OverflowError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1:] != (robot.n,) or len(points) < 2 or not np.isfinite(points).all():
        found = described(points) if points.size else described(waypoints)
        raise wrong_argument("retime", "waypoints", found, f"an array (k, {robot.n}) of finite numbers, k >= 2")
    return points


def _of_waypoints(error: InputError, count: int) -> InputError:
    """What is wrong with the start, the vias or the goal, told of the waypoints (count of them) that they were."""
    return InputError(_of_waypoint(issue, count) for issue in error.issues)


def _of_waypoint(issue: Issue, count: int) -> Issue:
    match issue.path:
        case ("start", *rest):
            at = 0
        case ("goal", *rest):
            at = count - 1
        case ("via", int(k), *rest):
            at = k + 1
        case _:
            return issue
    joint = "".join(f"[{key}]" for key in rest if isinstance(key, int))
    expected = issue.expected.partition("; for degrees")[0]  # of a file
    return replace(issue, file="op.retime", field=f"waypoints[{at}]{joint}", expected=expected)


def _corners(points: Array) -> Array:
    """The points (k, n) without those that lie on the way from the last corner to the next point: (m, n)."""
    kept = [points[0]]
    for q, after in pairwise(points[1:]):
        back, ahead = q - kept[-1], after - q
        length = float(np.linalg.norm(back) * np.linalg.norm(ahead))
        whole = after - kept[-1]
        share = float(back @ whole) / max(float(whole @ whole), 1e-300)
        if length > 0.0 and (back @ ahead < 0.0 or np.abs(back - share * whole).max() > _STRAIGHT):
            kept.append(q)
    return np.array([*kept, points[-1]])
