"""Read an assembly file: a problem whose task is a list of jobs, each for any of some arms; and state problems of it.

The steps of a job say `{arm}` where the name of the arm stands. A job is stated for an arm by its steps with that name,
and with `arm`; the whole by the steps of all jobs, of which the first waits for the jobs of other arms before it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from optiplan.config.document import Document, Strict, plain, read_yaml, validate
from optiplan.config.messages import choices, describe
from optiplan.config.values import Name
from optiplan.errors import InputError, Issue
from optiplan.problem.from_data import read_problem
from optiplan.problem.problem import Problem
from optiplan.problem.schema.loops import LoopReader
from optiplan.problem.task.steps import Attach, Detach, Move, StraightLine
from optiplan.records import dataclass

ASSEMBLY = "<assembly>"
"""Stands for the file of an assembly that has none."""

BESIDE = ("task", "goal", "via")
"""Keys of a problem that `jobs` stand in place of."""


class JobSpec(Strict):
    """A job: steps of a task, the arms that may do it (all of `robots` by default), and the jobs done before it."""

    name: Annotated[Name, Field(max_length=60)]
    steps: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=1000)]
    arms: Annotated[list[Name], Field(min_length=1)] | None = None
    after: tuple[Name, ...] = ()


class JobsSpec(Strict):
    """The jobs of an assembly."""

    jobs: Annotated[list[JobSpec], Field(min_length=1, max_length=100)]


@dataclass(frozen=True)
class Job:
    """A job.

    Attributes:
        number: its place in the file, from 0.
        arms: names of the arms that may do it.
        after: numbers of the jobs that are done before it.
        listed: whether the file names the arms.
    """

    number: int
    name: str
    arms: tuple[str, ...]
    after: tuple[int, ...]
    listed: bool


@dataclass(frozen=True)
class _PlacedSteps:
    """Steps of a task, and where each stands in the file."""

    steps: list[dict[str, Any]]
    places: list[tuple[str | int, ...]]

    def add(self, steps: Sequence[dict[str, Any]], places: Sequence[tuple[str | int, ...]]) -> range:
        """Add the steps of a job; return their numbers in the task."""
        self.steps.extend(steps)
        self.places.extend(places)
        return range(len(self.steps) - len(steps) + 1, len(self.steps) + 1)


@dataclass(frozen=True, eq=False)
class ArmProblem:
    """Jobs of one arm, one after another: a problem, and the numbers of the steps of each job in it.

    Attributes:
        unable: why the steps of a job make no sense for this arm, by the number of the job.
    """

    problem: Problem
    steps: Mapping[int, range]
    unable: Mapping[int, Issue]


@dataclass(frozen=True, eq=False)
class Assembly:
    """An assembly file that can be read.

    Attributes:
        order: numbers of the jobs, in an order in which each comes after those before it.
    """

    document: Document
    jobs: tuple[Job, ...]
    order: tuple[int, ...]

    @property
    def arms(self) -> list[str]:
        """The arms that some job may be done by, in the order of their first job."""
        return list(dict.fromkeys(arm for job in self.jobs for arm in job.arms))

    def whole(self, given: Sequence[tuple[int, str]]) -> tuple[Problem, dict[int, range]]:
        """Return the problem of all jobs as they are given to arms, and the numbers of the steps of each job.

        Args:
            given: job and arm, in an order in which they could be done one after another.

        Raises:
            InputError: it makes no problem.
        """
        arms, parts, numbers = dict(given), _PlacedSteps([], []), dict[int, range]()
        for number, arm in given:
            job, own = self.jobs[number], self._steps(number, arm)
            waits = [self._last_name(k, arms[k]) for k in job.after if arms[k] != arm]
            named = [_named(job.name, step, k == len(own.steps) - 1) for k, step in enumerate(own.steps)]
            if waits:
                named[0] = {**named[0], "wait_for": waits}
            numbers[number] = parts.add(named, own.places)
        return self._problem(parts), numbers

    def of_arm(self, arm: str) -> ArmProblem:
        """Return the jobs that an arm may do.

        Raises:
            InputError: what is wrong with the file, or with a job that names this arm.
        """
        left = [k for k in self.order if arm in self.jobs[k].arms]
        unable: dict[int, Issue] = {}
        while left:
            parts, numbers = _PlacedSteps([], []), dict[int, range]()
            for number in left:
                own = self._steps(number, arm)
                numbers[number] = parts.add(own.steps, own.places)
            problem, wrong = self._stated(parts)
            if problem is None:
                blamed = {k: issue for step, issue in wrong for k in left if step in numbers[k]}
                asked = any(self.jobs[k].listed or len(self.jobs[k].arms) == 1 for k in blamed)
                if asked or any(step is None for step, _ in wrong):
                    raise InputError([issue for _, issue in wrong])
                unable |= blamed
                left = [k for k in left if k not in blamed]
                continue
            self._check_jobs(problem, numbers)
            return ArmProblem(problem, numbers, unable)
        return ArmProblem(self._problem(_PlacedSteps([{"dwell": 1.0}], [("jobs",)])), {}, unable)

    def _check_jobs(self, problem: Problem, numbers: Mapping[int, range]) -> None:
        """Refuse jobs that move nothing, and those that end with an object in hand, after which no other arm could."""
        for number, steps in numbers.items():
            held = {held.name: False for held in problem.scene.attached}
            actions = [step.action for step in problem.task if step.number in steps]
            for action in actions:
                if isinstance(action, Attach | Detach):
                    held[action.body] = isinstance(action, Attach)
            place = ("jobs", number, "steps")
            if not any(isinstance(action, Move | StraightLine) for action in actions):
                raise InputError([self.document.issue(place, "a job that moves nothing", "a move or a line")])
            if kept := [name for name, taken in held.items() if taken]:
                found = f"a job that ends with '{kept[0]}' in hand"
                raise InputError([self.document.issue(place, found, f"a detach of '{kept[0]}' in the same job")])

    def _steps(self, number: int, arm: str) -> _PlacedSteps:
        """Return the steps of a job as an arm does them."""
        reader, place = LoopReader(self.document), ("jobs", number, "steps")
        written = list(reader.steps(self.document.data["jobs"][number]["steps"], place, {"arm": arm}))
        issues = list(reader.issues)
        for one in written:
            if not isinstance(one.step, Mapping):
                issues.append(self.document.issue(one.place, describe(one.step), "a step of a task"))
            elif one.step.get("arm", arm) != arm:
                words = f"'{one.step['arm']}' in a step of a job"
                issues.append(self.document.issue((*one.place, "arm"), words, "no such key, or '{arm}'"))
            elif "wait_for" in one.step:
                words = "a step of a job that waits"
                issues.append(self.document.issue((*one.place, "wait_for"), words, "`after` of the job"))
        if not written and not issues:
            issues = [self.document.issue(place, "no step when they are written out", "a step")]
        if issues:
            raise InputError(issues)
        return _PlacedSteps([{**one.step, "arm": arm} for one in written], [one.place for one in written])

    def _last_name(self, number: int, arm: str) -> str:
        return str(_named(self.jobs[number].name, self._steps(number, arm).steps[-1], True)["name"])

    def _problem(self, parts: _PlacedSteps) -> Problem:
        """Return the problem of these steps.

        Raises:
            InputError: it makes none; issues are those of the assembly file.
        """
        problem, wrong = self._stated(parts)
        if problem is None:
            raise InputError([issue for _, issue in wrong])
        return problem

    def _stated(self, parts: _PlacedSteps) -> tuple[Problem | None, list[tuple[int | None, Issue]]]:
        """Return the problem of these steps, or what is wrong in the file, with the number of the step if it is one."""
        known = self.document
        data = {key: value for key, value in known.data.items() if key not in ("jobs", "tasks")}
        lines = {place: line for place, line in known.lines.items() if place[:1] not in (("jobs",), ("tasks",))}
        for k, place in enumerate(parts.places):
            size = len(place)
            lines |= {("task", k, *key[size:]): line for key, line in known.lines.items() if key[:size] == place}
        if (line := known.lines.get(("jobs",))) is not None:
            lines["task",] = line
        try:
            document = Document(known.path, data | {"task": parts.steps}, lines)
            return Problem.of(read_problem(document, known.path.resolve().parent)), []
        except InputError as error:
            return None, [_in_file(known, parts, issue) for issue in error.issues]


def read_assembly(source: Path | str | Mapping[str, Any]) -> Assembly:
    """Read an assembly file, or its content with paths relative to the working directory.

    Raises:
        InputError: with every issue of its jobs, by file and line.
    """
    document = Document(Path(ASSEMBLY), plain(source), {}) if isinstance(source, Mapping) else read_yaml(source)
    if not isinstance(document.data, dict):
        raise InputError([document.issue((), describe(document.data), "a mapping with `robots` and `jobs`")])
    given = {key: document.data[key] for key in ("jobs",) if key in document.data}
    spec = validate(JobsSpec, replace(document, data=given))
    issues = [document.issue((key,), f"`{key}` beside `jobs`", "one of them") for key in BESIDE if key in document.data]
    robots = document.data.get("robots")
    standing = [str(name) for name in robots] if isinstance(robots, Mapping) else []
    issues += _wrong_jobs(document, spec.jobs, bool(standing))
    if issues:
        raise InputError(issues)
    numbers = {job.name: k for k, job in enumerate(spec.jobs)}
    jobs = tuple(
        Job(
            k,
            job.name,
            tuple(dict.fromkeys(standing if job.arms is None else job.arms)),
            tuple(dict.fromkeys(numbers[name] for name in job.after)),
            job.arms is not None,
        )
        for k, job in enumerate(spec.jobs)
    )
    assembly = Assembly(document, jobs, _order(document, jobs))
    _check_arms(assembly)
    return assembly


def _wrong_jobs(document: Document, jobs: Sequence[JobSpec], side_by_side: bool) -> Iterator[Issue]:
    """Yield jobs of one name, without arms where no robots stand side by side, and after what is no other job."""
    names = [job.name for job in jobs]
    for k, name in enumerate(names):
        if (first := names.index(name)) < k:
            found = f"'{name}', the name of job {first + 1} too"
            yield document.issue(("jobs", k, "name"), found, "a name of its own")
        if jobs[k].arms is None and not side_by_side:
            found = "a job without `arms`, and no `robots`"
            yield document.issue(("jobs", k), found, "robots side by side, or `arms` of the job")
    for k, job in enumerate(jobs):
        others = [name for name in dict.fromkeys(names) if name != job.name]
        for i, name in enumerate(job.after):
            if name not in others:
                found = f"'{name}', no name of another job"
                yield document.issue(("jobs", k, "after", i), found, choices(name, others))


def _check_arms(assembly: Assembly) -> None:
    """Refuse arms that are no groups of the robot or share joints, and what is wrong with the rest of the problem."""
    known = assembly._problem(_PlacedSteps([{"dwell": 1.0}], [("jobs",)])).robot.groups
    groups = list(known)
    issues = [
        assembly.document.issue(("jobs", job.number, "arms"), f"'{arm}', no group of the robot", choices(arm, groups))
        for job in assembly.jobs
        for arm in job.arms
        if arm not in groups
    ]
    if issues:
        raise InputError(issues)
    for k, arm in enumerate(assembly.arms):
        for other in assembly.arms[:k]:
            if shared := [name for name in known[arm] if name in known[other]]:
                number = next(job.number for job in assembly.jobs if arm in job.arms)
                found = f"'{arm}', which moves {shared[0]} as '{other}' does"
                issues.append(assembly.document.issue(("jobs", number, "arms"), found, "arms with joints of their own"))
    if issues:
        raise InputError(issues)


def _order(document: Document, jobs: Sequence[Job]) -> tuple[int, ...]:
    """Return the jobs, each after those before it, otherwise as in the file.

    Raises:
        InputError: some wait for each other.
    """
    order: list[int] = []
    while len(order) < len(jobs):
        ready = [job.number for job in jobs if job.number not in order and set(job.after) <= set(order)]
        if not ready:
            circle = _circle(jobs, set(order))
            found = f"a circle: {' after '.join(jobs[k].name for k in [*circle, circle[0]])}"
            raise InputError(
                [document.issue(("jobs", circle[0], "after"), found, "jobs that can be done in some order")]
            )
        order.append(ready[0])
    return tuple(order)


def _circle(jobs: Sequence[Job], done: set[int]) -> list[int]:
    way = [next(job.number for job in jobs if job.number not in done)]
    while True:
        before = next(k for k in jobs[way[-1]].after if k not in done)
        if before in way:
            return way[way.index(before) :]
        way.append(before)


def _named(job: str, step: Mapping[str, Any], last: bool) -> dict[str, Any]:
    """Return a step with the name of its job, if it has one or is the last."""
    name = f"{job}: {step['name']}" if "name" in step else job if last else None
    return dict(step) if name is None else {**step, "name": name}


def _in_file(document: Document, parts: _PlacedSteps, issue: Issue) -> tuple[int | None, Issue]:
    """Return an issue about a step as one about the file, with the number of the step."""
    if issue.path[:1] != ("task",):
        return None, issue
    k = issue.path[1] if len(issue.path) > 1 else None
    if not isinstance(k, int):
        return None, document.issue(("jobs",), issue.found, issue.expected)
    return k + 1, document.issue((*parts.places[k], *issue.path[2:]), issue.found, issue.expected)
