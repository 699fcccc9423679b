"""How long each arm takes for each job, planned alone, and what can be told of the ways between jobs.

A job is planned from the start, with what the jobs before it leave where they leave it; the other arms stand still. Its
time to where the arm first stops belongs to the way, the rest to the job. The way from one job to the next is taken to
last as long as a straight joint motion, times what the way from the start took longer than such a motion.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.planners.base import Budget, Progress
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.problem.problem import Problem, derived
from optiplan.problem.task.scene_change import columns, scene_after
from optiplan.problem.task.steps import Detach, Event
from optiplan.problem.task.timeline import steps_in_time
from optiplan.records import dataclass
from optiplan.runs.run import Run
from optiplan.studies.assembly.schedule import Durations
from optiplan.studies.assembly.statement import ArmProblem, Assembly
from optiplan.studies.proof import Plan

_MOVED = 1e-6
"""rad or m: an arm that has moved no farther stands where it stood."""

_SHARE = 3.0
"""A job alone may take this many times its share of the budget, since most take much less than theirs."""

_KEPT = 0.5
"""Of an even share of the budget that each job keeps, however long those before it take."""

_LEAST = 1e-6
"""s: a job takes no less."""


@dataclass(frozen=True, eq=False)
class JobAlone:
    """A job that an arm did alone.

    Attributes:
        way: s, from the start to where the arm first stops.
        work: s, from there to the end.
        first: (n,) configuration there.
        last: (n,) configuration at the end.
        left: bodies that it released, where it released them.
    """

    way: float
    work: float
    first: Array
    last: Array
    left: tuple[Obstacle, ...]


@dataclass(frozen=True, eq=False)
class Measured:
    """What each arm can do.

    Attributes:
        alone: by arm and number of the job.
        unable: why an arm cannot do a job, by arm and number of the job.
    """

    arms: tuple[str, ...]
    alone: Mapping[tuple[str, int], JobAlone]
    unable: Mapping[tuple[str, int], str]
    durations: Durations


def measure_jobs(assembly: Assembly, plan: Plan, budget: Budget, progress: Progress) -> Measured:
    """Plan each job alone by each arm that may do it; what the budget leaves out counts as not done.

    Raises:
        InputError: the steps of a job make no problem.
    """
    problems = {arm: assembly.of_arm(arm) for arm in assembly.arms}
    alone: dict[tuple[str, int], JobAlone] = {}
    wrong = {(arm, k): issue for arm, one in problems.items() for k, issue in one.unable.items()}
    for job in assembly.jobs:
        if all((arm, job.number) in wrong for arm in job.arms):
            raise InputError([wrong[job.arms[0], job.number]])
    unable = {key: f"{issue.field}: {issue.found}" for key, issue in wrong.items()}
    left: dict[int, tuple[Obstacle, ...]] = {}
    todo = [(k, arm) for k in assembly.order for arm in assembly.jobs[k].arms if (arm, k) not in unable]
    kept = _KEPT * budget.remaining / max(1, len(todo))
    for count, (k, arm) in enumerate(todo):
        progress("jobs alone", count / len(todo))
        if budget.over:
            unable[arm, k] = "not planned within the budget"
            continue
        problem = _alone(problems[arm], k, [body for j in _before(assembly, k) for body in left.get(j, ())])
        run = plan(problem, _next_share(budget, len(todo) - count, kept))
        if run.verified:
            alone[arm, k] = _measured(problem, run, arm)
            left.setdefault(k, alone[arm, k].left)
        else:
            unable[arm, k] = run.why_not
    arms = tuple(problems)
    return Measured(arms, alone, unable, _durations(assembly, arms, alone, problems))


def _next_share(budget: Budget, jobs: int, kept: float) -> Budget:
    """Return the budget of the first of the remaining jobs, which leaves `kept` seconds to each of the others."""
    left = budget.remaining
    return budget.leaving(left - max(left / jobs, min(_SHARE * left / jobs, left - kept * (jobs - 1))))


def _alone(given: ArmProblem, job: int, moved: list[Obstacle]) -> Problem:
    """Return the problem of one job, with bodies where the jobs before it left them; its steps count from 1.

    No clearance is wished: that takes as long as planning, and what counts is how long the job takes.
    """
    own = given.steps[job]
    task = tuple(
        replace(step, number=step.number - own.start + 1, waits=()) for step in given.problem.task if step.number in own
    )
    return derived(given.problem, task=task, scene=_with(given.problem.scene, moved), wished_clearance=0.0)


def _with(scene: Scene, moved: list[Obstacle]) -> Scene:
    last = {body.name: body for body in moved}
    if not last:
        return scene
    standing = tuple(one for one in scene.obstacles if one.name not in last)
    held = tuple(one for one in scene.attached if one.name not in last)
    return replace(scene, obstacles=(*standing, *last.values()), attached=held)


def _before(assembly: Assembly, job: int) -> list[int]:
    """Return all jobs that are done before a job, in order."""
    found = set(assembly.jobs[job].after)
    for k in reversed(assembly.order):
        if k in found:
            found |= set(assembly.jobs[k].after)
    return [k for k in assembly.order if k in found]


def _measured(problem: Problem, run: Run, arm: str) -> JobAlone:
    motion = run.trajectory
    assert motion is not None, "a verified run has a motion"
    scene, released = problem.scene, set[str]()
    own = columns(problem.robot, problem.robot.groups[arm])
    way, first = 0.0, np.asarray(motion.start)
    for step, _, _, end in steps_in_time(problem, motion):
        q = motion(end)
        if way == 0.0 and np.abs(q - motion.start)[own].max() > _MOVED:
            way, first = end, q
        if isinstance(step.action, Event):
            scene = scene_after(scene, step.action, problem.robot, q)
        if isinstance(step.action, Detach):
            released.add(step.action.body)
    left = tuple(body for body in scene.obstacles if body.name in released)
    return JobAlone(way, max(_LEAST, motion.duration - way), first, np.asarray(motion.end), left)


def _durations(
    assembly: Assembly,
    arms: tuple[str, ...],
    alone: Mapping[tuple[str, int], JobAlone],
    problems: Mapping[str, ArmProblem],
) -> Durations:
    count = len(assembly.jobs)
    work, travel = np.full((len(arms), count), np.inf), np.full((len(arms), count + 1, count), np.inf)
    for a, arm in enumerate(arms):
        problem = problems[arm].problem
        jobs = [k for k in range(count) if (arm, k) in alone]
        if not jobs:
            continue
        done = [alone[arm, k] for k in jobs]
        times = TravelTimes(problem.limits)
        first, last = np.array([one.first for one in done]), np.array([one.last for one in done])
        way = np.array([one.way for one in done])
        straight = times.between(np.asarray(problem.start)[None], first)[0]
        longer = np.divide(way, straight, out=np.ones_like(way), where=straight > 0.0).clip(min=1.0)
        work[a, jobs] = [one.work for one in done]
        travel[a, -1, jobs] = way
        between = times.between(last, first) * longer
        np.fill_diagonal(between, np.inf)
        travel[np.ix_([a], jobs, jobs)] = between[None]
    return Durations(work, travel, tuple(job.after for job in assembly.jobs))
