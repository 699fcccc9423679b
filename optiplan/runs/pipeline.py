"""Pipeline of planning and verification: `run` plans, verifies the result and returns both as a `Run`."""

import logging
import resource
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from optiplan.errors import InputError, OptiPlanError, PlannerAnswerError, named_reason
from optiplan.libraries import clock, time_loading
from optiplan.planners.base import Budget, Candidate, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.safety_ends import ending_at
from optiplan.planners.common.tracking_tube import planned_in_tube
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.registry import make_planner
from optiplan.planners.third_party import options_set
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.runs.common_bound import duration_bound
from optiplan.runs.metrics import measure
from optiplan.runs.preparation import prepare
from optiplan.runs.proofs_on_the_way import ProofsOnTheWay
from optiplan.runs.run import Run
from optiplan.runs.selection import best_verified
from optiplan.runs.wished_clearance import wished
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import verify as verifier

_log = logging.getLogger(__name__)

_NOTHING = 1e-3
"""s; import statements of what is there already take less, and so does looking through no other motions."""

_LATE = 0.05
"""s beyond the budget, of planning, proving and measuring, that are not worth a word."""

_KEPT = 20.0
"""s in which an earlier motion that is the answer is proved and measured."""

_ANEW, _LEAST_ANEW = 1.5, 1.0
"""Time for planning anew with the wished clearance / time that planning and proving the answer took; s at least."""

_PROVING, _MOST_PROVING = 0.05, 0.25
"""Share of the budget, and s at the most, that the planner leaves for the proof."""


def run(
    problem: Problem,
    planner: str | Planner[Any],
    options: Mapping[str, Any],
    budget: Budget,
    progress: Progress,
    earlier: Trajectory | None = None,
) -> Run:
    """Plan, verify and measure; planning and proving are held to the budget.

    The result is the best verified candidate of the planner, slowed down slightly where only that helps. An exception
    of the planner leaves the best motion proved before it, and `info["fault"]`; without such a motion it is raised.

    Args:
        problem: its own `planner` and `options` are ignored.
        planner: name in the registry, or a planner itself, which the run calls by its class.
        options: of the planner of that name; a planner itself has its own.
        budget: counted from the planner's start; loading libraries is no part of it, and its time, s, is `libraries` in
            the timings, not in `plan`. Neither is what is found out once for a robot (`robot`). The planner leaves as
            much of it as the last proof took; where that is not enough, `beyond the budget` are the seconds after its
            end.
        progress: called with the planner's stages, then `verify`; see `ProofsOnTheWay` for what else it may be told.
        earlier: a motion that planners may begin at, of a problem not far from this one.

    Raises:
        UnknownChoiceError: no such planner or option.
        InputError: an invalid value of an option.
        RuntimeError: the planner raised SystemExit, and there is no motion.
    """
    if isinstance(planner, str):
        name, chosen = planner, make_planner(planner, options)
    else:
        name, chosen, options = type(planner).__name__, planner, options_set(planner)
    prepared = prepare(problem.robot)
    budget.start()
    began, spent, loaded = clock(), processor_time(), time_loading()
    within = budget.leaving(reserve(budget.seconds))
    proofs, asked = ProofsOnTheWay(problem, progress, within), planned_in_tube(problem)
    try:
        if problem.task or (problem.vias and chosen.joins_legs):
            from optiplan.planners.task.planner import plan_task

            result = plan_task(chosen, asked, within, proofs)
        else:
            result = plan_through(chosen, asked, within, proofs, earlier)
    except OptiPlanError:  # the options do not fit the problem, or the answer is none
        raise
    except (Exception, SystemExit) as error:
        if not proofs.verified:
            if isinstance(error, SystemExit):  # it would end the program, with exit code 0 as if a motion were verified
                raise RuntimeError(f"the planner raised SystemExit({error.code!r})") from error
            raise
        *before, best = sorted(proofs.verified, key=lambda motion: problem.cost(motion.trajectory), reverse=True)
        result = PlanResult(best.trajectory, None, {}, _fault(error), tuple(before), best.seconds)
    timings = {**prepared, "plan": clock() - began - proofs.seconds}
    spent = processor_time() - spent - proofs.processor
    if time_loading() - loaded > _NOTHING:
        timings["libraries"] = time_loading() - loaded
    found = proved(problem, name, options, result, budget, proofs, timings)
    late = {"beyond the budget": budget.overrun} if budget.overrun > _LATE else {}
    return replace(found, plan_cpu=spent, timings={**found.timings, **late})


def answer(
    problem: Problem,
    planner: str | Planner[Any],
    options: Mapping[str, Any],
    budget: Budget,
    progress: Progress,
    earlier: Trajectory | None = None,
) -> Run:
    """Plan as `run` does, never worse than a motion that is at hand, and keep the clearance that the problem wishes.

    Args:
        problem: the problem.
        planner: name in the registry, or a planner itself.
        options: of the planner of that name.
        budget: seconds of planning and proof.
        progress: called with the planner's stages.
        earlier: a motion of a problem not far from this one; one of other joints is of no use. Where it costs less
            (see `Objective`) than what is found, it is verified on this problem, and is the answer if it holds.

    Returns:
        The run; its `info["warm_start"]` is `kept`, `beaten` (the answer costs no more) or `refused` where there was an
        earlier motion, and its `info["wish"]` what became of the wish.

    Raises:
        UnknownChoiceError: no such planner or option.
        InputError: an invalid value of an option.
    """
    known = earlier if earlier is not None and earlier.joint_names == problem.robot.joint_names else None
    found = run(problem, planner, options, budget, progress, known)
    if known is not None and found.trajectory is not None and not found.verified and not budget.over:
        found = run(problem, planner, options, budget.share(1.0), progress)  # it led astray
    best = found if earlier is None else _better(found, known, progress)
    return _wider(best, planner, budget, progress)


def proved(
    problem: Problem,
    planner: str,
    options: Mapping[str, Any],
    result: PlanResult,
    budget: Budget,
    proofs: ProofsOnTheWay,
    planning: Mapping[str, float],
) -> Run:
    """Verify and measure a planner's result.

    Args:
        problem: the problem.
        planner: its name.
        options: its options.
        result: the planner's result.
        budget: what remains of it.
        proofs: the progress, with what it proved on the way.
        planning: seconds that it took, `plan` and what else is known.
    """
    timings = dict(planning)
    selection = bound = metrics = None
    if result.trajectory is not None:
        proofs("verify", 0.0)
        seconds = timings["plan"] + proofs.seconds if result.seconds is None else result.seconds
        began = time.perf_counter()
        selection = best_verified(problem, [*result.earlier, Candidate(result.trajectory, seconds)], budget, proofs)
        timings["verify"] = selection.proof
        others = time.perf_counter() - began + proofs.seconds - selection.proof
        if others > _NOTHING:
            timings["other proofs"] = others
        for seconds, motion in selection.answers:
            proofs.proved(motion, seconds)
        bound = duration_bound(problem, selection.trajectory)
        began = time.perf_counter()
        metrics = measure(problem, selection.trajectory, selection.report)
        timings["measure"] = time.perf_counter() - began
    slowed = {"slowed": selection.slowed} if selection is not None and selection.slowed > 1.0 else {}
    return Run(
        problem=problem,
        planner=planner,
        options=dict(options),
        trajectory=None if selection is None else selection.trajectory,
        failure=result.failure,
        report=None if selection is None else selection.report,
        lower_bound=bound,
        metrics=metrics,
        timings=timings,
        stages=dict(result.timings),
        info={**result.info, **slowed},
        improvements=() if selection is None else selection.improvements,
    )


def chosen(
    problem: Problem, planner: str | None, options: Mapping[str, Any] | None = None
) -> tuple[str, Mapping[str, Any]]:
    """Return the planner's name and options: those given, else the problem's own.

    Options of the problem apply to its own planner only.
    """
    name = problem.planner if planner is None else planner
    return name, options if options is not None else problem.options if name == problem.planner else {}


def plan_and_verify_once(
    problem: Problem,
    planner: str,
    options: Mapping[str, Any],
    budget: Budget,
    progress: Progress,
    earlier: Trajectory | None = None,
    *,
    by: Callable[..., Run] = run,
) -> Run:
    """Plan by `run`, as for comparisons, or by `answer`; an exception of the planner becomes its failure.

    Failure kinds besides those of planners: `input`, the options do not fit this problem (witness: `issues`);
    `bug`, an unexpected exception (witness: `traceback`).
    """
    began = time.perf_counter()
    try:
        return by(problem, planner, options, budget, progress, earlier)
    except PlannerAnswerError as error:
        failure = Failure("bug", str(error), {})
    except OptiPlanError as error:
        issues = [vars(issue) for issue in error.issues] if isinstance(error, InputError) else []
        failure = Failure("input", str(error), {"issues": issues})
    except Exception as error:
        failure = Failure("bug", f"{type(error).__name__}: {error}", {"traceback": traceback.format_exc()})
    return Run(
        problem=problem,
        planner=planner,
        options=dict(options),
        trajectory=None,
        failure=failure,
        report=None,
        lower_bound=None,
        metrics=None,
        timings={"plan": time.perf_counter() - began},
        stages={},
    )


def _fault(error: BaseException) -> dict[str, Any]:
    """Log an exception of a planner that had a verified motion already, and return it as an entry of a run's `info`."""
    reason = named_reason(error)
    _log.error("the planner failed, and the best motion proved before is the answer: %s", reason)
    return {"fault": {"error": reason, "traceback": "".join(traceback.format_exception(error))}}


def reserve(seconds: float) -> float:
    """Return the seconds of a budget reserved for verification."""
    return min(_PROVING * seconds, _MOST_PROVING)


def processor_time() -> float:
    """Return the processor time, s, of this process and of the child processes that it waited for."""
    waited = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + waited.ru_utime + waited.ru_stime


def _better(run: Run, known: Trajectory | None, progress: Progress) -> Run:
    """The run, or one of the motion that was at hand, where that is better and holds."""
    answer = run.trajectory if run.verified else None
    cost = run.problem.cost
    if known is not None and answer is not None and cost(answer) <= cost(known):
        return replace(run, info={**run.info, "warm_start": "beaten"})
    if known is None or not verifier.holds(run.problem, known):
        return replace(run, info={**run.info, "warm_start": "refused"})
    info = {**run.info, "warm_start": "kept"}
    result = PlanResult(known, None, run.stages, info, seconds=0.0)
    proofs = ProofsOnTheWay(run.problem, progress)
    kept = proved(run.problem, run.planner, run.options, result, Budget(_KEPT), proofs, run.timings)
    return replace(kept, plan_cpu=run.plan_cpu)


@dataclass(frozen=True, eq=False)
class _Near:
    """Looks for a motion near an answer that holds on a problem which asks for more; see `wished_clearance.Near`.

    A single motion among bodies at rest is optimised once more. All else is planned anew, in about as long as before.

    Attributes:
        found: the run of the answer.
        planner: that found it.
        progress: called with the stages of planning anew.
    """

    found: Run
    planner: Planner[Any]
    progress: Progress

    def __call__(self, asking: Problem, budget: Budget) -> Trajectory | None:
        answer = self.found.trajectory
        assert answer is not None
        if asking.task or asking.vias or asking.scene.dynamic_obstacles:
            took = self.found.timings["plan"] + self.found.timings["verify"]
            seconds = max(_LEAST_ANEW, _ANEW * took)
            within = budget.share(seconds / max(budget.remaining, seconds))
            again = run(asking, self.planner, {}, within, self._told)
            return again.trajectory if again.verified else None
        motion = self.planner.near(ending_at(asking, asking.start, answer.end), answer, budget)
        return motion if motion is not None and verifier.holds(asking, motion) else None

    def _told(self, stage: str, share: float) -> None:
        self.progress(f"{stage} with the wished clearance", share)


def _wider(found: Run, planner: str | Planner[Any], budget: Budget, progress: Progress) -> Run:
    """The run, or one of a motion that keeps the wished clearance, where that costs little."""
    if found.trajectory is None or not found.verified or found.problem.wished_clearance == 0.0:
        return found
    began = clock()
    chosen = make_planner(planner, found.options) if isinstance(planner, str) else planner
    if type(chosen).near is Planner.near:
        return found
    near = _Near(found, chosen, progress)
    try:
        wish = wished(found.problem, found.trajectory, found.timings.get("verify", 0.0), near, budget)
    except Exception as error:
        return replace(found, info={**found.info, **_fault(error)})
    if wish is None:
        return found
    kept = replace(found, info={**found.info, "wish": wish.to_dict()})
    if wish.motion is not None:
        seconds = budget.seconds - budget.remaining
        result = PlanResult(wish.motion, None, found.stages, kept.info, seconds=seconds)
        proofs = ProofsOnTheWay(found.problem, progress)
        wider = proved(found.problem, found.planner, found.options, result, budget, proofs, found.timings)
        kept = replace(wider, plan_cpu=found.plan_cpu, improvements=(*found.improvements, *wider.improvements))
    return replace(kept, timings={**found.timings, "wish": clock() - began})
