"""Resolved suite: problems, checked planners, the list of runs, and its hash."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.bench.execution.code_version import own_code, own_digest, planner_code
from optiplan.bench.execution.executed import METRICS as EXECUTION_METRICS
from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.results.records import BenchPlanner, BenchProblem, BenchTask
from optiplan.bench.sources.base import Found, Place
from optiplan.bench.sources.readers import read_source
from optiplan.bench.suite.schema import SourceSpec, SuiteSpec, read_suite
from optiplan.config.document import Document, validate
from optiplan.config.messages import choices, some
from optiplan.errors import InputError, Issue, OptiPlanError, UnknownChoiceError
from optiplan.planners.base import Progress, silent
from optiplan.planners.registry import make_planner
from optiplan.problem.from_data import goal_or_task, in_one_form, planned_robot
from optiplan.problem.hashing import source_of
from optiplan.problem.schema.problem import ProblemSpec
from optiplan.records import dataclass
from optiplan.runs.metrics import Metrics

METRICS = (*(item.name for item in fields(Metrics)), *EXECUTION_METRICS)


@dataclass(frozen=True)
class Suite:
    """A suite file, resolved.

    Attributes:
        spec: the file's content.
        text: the file itself.
        problems: in the order in which they are run.
        planners: likewise.
    """

    spec: SuiteSpec
    text: str
    problems: tuple[BenchProblem, ...]
    planners: tuple[BenchPlanner, ...]

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(self.problems) * len(self.planners) * len(self.spec.seeds) * self.spec.repetitions

    def tasks(self) -> Iterator[BenchTask]:
        """Every run, problem by problem: planners meet a problem under like load, and workers keep it loaded.

        The runs of one problem come in a random order, drawn from the problem's id: the same every time, and no planner
        is always the first, on a cold machine, or the last.
        """
        spec = self.spec
        hard = (spec.budget, spec.wall, spec.limits.memory)
        for problem in self.problems:
            runs = list(product(range(spec.repetitions), spec.seeds, self.planners))
            order = np.random.default_rng(list(hashlib.sha256(problem.id.encode()).digest())).permutation(len(runs))
            for repetition, seed, planner in (runs[k] for k in order):
                yield BenchTask(problem, planner, seed, repetition, *hard, spec.metrics)

    @cached_property
    def parts(self) -> dict[str, Any]:
        """Content that identifies the suite, JSON-ready, part by part."""
        spec = self.spec
        return {
            "planners": {planner.label: [planner.name, dict(planner.options)] for planner in self.planners},
            "seeds": list(spec.seeds),
            "repetitions": spec.repetitions,
            "budget": spec.budget,
            "limits": {"wall": spec.wall, "memory": spec.limits.memory},
            "metrics": None if spec.metrics is None else list(spec.metrics),
            "problems": {p.id: [p.hash, p.set_name, p.difficulty] for p in self.problems},
        }

    @cached_property
    def code(self) -> dict[str, Any]:
        """The code that runs are made with now: OptiPlan's, in words and by its digest, and each planner's own."""
        return code_of(self.planners)

    @property
    def hash(self) -> str:
        """SHA-256, in hex, of `parts`; neither the suite's name nor where files lie counts."""
        return hash_of_parts(self.parts)


def code_of(planners: Iterable[BenchPlanner]) -> dict[str, Any]:
    """Return what identifies the code of runs by these planners, as `Suite.code`."""
    own = {planner.label: planner_code(planner.name, planner.options) for planner in planners}
    return {"optiplan": own_code(), "digest": own_digest(), "planners": own}


def hash_of_parts(parts: Mapping[str, Any]) -> str:
    """SHA-256, in hex, of what identifies a suite."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def load_suite(path: Path | str, scratch: Path, progress: Progress = silent) -> Suite:
    """Read a suite file, find its problems and check its planners.

    Args:
        path: the YAML file.
        scratch: folder for files that problems need and that no source holds; made only for such files.
        progress: called with every problem read and the fraction of sources done.

    Raises:
        InputError: with every issue found; problems are checked as far as is possible without loading their scenes.
        UnknownChoiceError: no such robot.
    """
    spec, document = read_suite(path)
    issues: list[Issue] = []
    planners = _planners(spec, document, issues)
    for index, name in enumerate(spec.metrics or ()):
        if name not in METRICS:
            issues.append(document.issue(("metrics", index), f"unknown metric '{name}'", choices(name, METRICS)))
    places = [Place(source, index, document, scratch) for index, source in enumerate(spec.problems)]
    problems = _labelled(_problems(places, issues, progress), spec, document, issues)
    if issues:
        raise InputError(sorted(issues, key=lambda issue: (issue.file, issue.line or 0)))
    return Suite(spec, document.path.read_text(encoding="utf-8"), problems, planners)


def suite_differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return the differences between the `parts` of two suites, one sentence each."""
    words = []
    for part in new:
        if old.get(part) == new[part]:
            continue
        if part in ("planners", "problems"):
            words += [f"{part}: {text}" for text in _entries(old.get(part, {}), new[part])]
        else:
            words.append(f"{part}: {json.dumps(old.get(part))} there, {json.dumps(new[part])} here")
    return words


def code_differences(old: Mapping[str, Any] | None, new: Mapping[str, Any]) -> list[str]:
    """Return the differences between the `code` of two suites, one sentence each; None: it was not recorded."""
    if old is None:
        return [f"code: not recorded there, optiplan {new['optiplan']} here"]
    words = []
    if old["digest"] != new["digest"]:
        words.append(f"code: optiplan {old['optiplan']} there, {new['optiplan']} here")
    changed = [label for label, digest in new["planners"].items() if old["planners"].get(label, digest) != digest]
    return words + ([f"code: changed files of the planners {some(changed)}"] if changed else [])


def _entries(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    changed = [name for name in new if name in old and old[name] != new[name]]
    for what, names in (("only there", old.keys() - new.keys()), ("only here", new.keys() - old.keys())):
        if names:
            yield f"{what}: {some(sorted(names))}"
    if changed:
        yield f"changed: {some(changed)}"


def _planners(spec: SuiteSpec, document: Document, issues: list[Issue]) -> tuple[BenchPlanner, ...]:
    for index, planner in enumerate(spec.planners):
        place = ("planners", index)
        try:
            make_planner(planner.name, planner.options)
        except UnknownChoiceError as error:
            issues.append(document.issue(place, f"unknown {error.kind} '{error.found}'", ", ".join(error.choices)))
        except InputError as error:
            issues += [document.issue((*place, issue.field), issue.found, issue.expected) for issue in error.issues]
        except (Exception, SystemExit):  # a third-party planner that cannot be constructed: reported by its runs
            continue
    return tuple(BenchPlanner(planner.shown, planner.name, planner.options) for planner in spec.planners)


def _problems(places: list[Place], issues: list[Issue], progress: Progress) -> dict[str, BenchProblem]:
    """The problems of all sources by their ids."""
    robots = RobotCache()
    found: dict[str, BenchProblem] = {}
    for place in places:
        try:
            for item in read_source(place):
                progress(f"reading problems: {item.id}", place.index / len(places))
                if item.id in found:
                    what = f"a second problem '{item.id}'"
                    issues.append(place.issue(place.spec.kind, what, "other names, or another set:"))
                try:
                    found[item.id] = _problem(_with_stated(item, place.spec), place.spec.difficulty, robots)
                except InputError as error:  # the others may have issues, too
                    issues += error.issues
        except InputError as error:
            issues += error.issues
    return found


def _with_stated(item: Found, source: SourceSpec) -> Found:
    """Put what the source states of limits and objective over what the problem's file says, key by key."""
    stated = {
        key: spec.model_dump(mode="json", exclude_unset=True)
        for key, spec in (("limits", source.limits), ("objective", source.objective))
        if spec is not None
    }
    own = {key: item.data.get(key, {}) for key in stated}
    if not stated or not all(isinstance(values, Mapping) for values in own.values()):  # the schema will tell
        return item
    data = {**item.data, **{key: {**own[key], **values} for key, values in stated.items()}}
    document = None if item.document is None else replace(item.document, data=data)
    return replace(item, data=data, document=document, origin={**item.origin, **stated})


def _problem(item: Found, difficulty: str | None, robots: RobotCache) -> BenchProblem:
    """Check an item against the schema, and take its identity.

    Raises:
        InputError: it does not fit, or its robot or meshes cannot be read.
    """
    document = in_one_form(item.document or Document(Path(item.id), item.data, {}), item.base, robots)
    spec, missing = validate(ProblemSpec, document), goal_or_task(document)
    if missing:
        raise InputError(missing)
    try:
        data, digest = source_of(spec, item.name, item.base, planned_robot(document, item.base, robots))
    except InputError:
        raise
    except (OptiPlanError, OSError) as error:
        file = str(item.document.path if item.document else item.id)
        raise InputError([Issue(file, None, "problem", str(error), "a robot and meshes that can be read")]) from error
    return BenchProblem(item.id, item.set_name, item.difficulty or difficulty, digest, data, item.origin)


def _labelled(
    found: Mapping[str, BenchProblem], spec: SuiteSpec, document: Document, issues: list[Issue]
) -> tuple[BenchProblem, ...]:
    """The problems with the labels of the suite's own table, which goes before those of the sources."""
    labels: dict[str, str] = {}
    complete = not issues  # else labels may be of problems that could not be read
    for label, names in spec.difficulty.items():
        for index, name in enumerate(names):
            if name in found and name not in labels:
                labels[name] = label
            elif complete:
                what = f"'{name}' a second time" if name in labels else f"'{name}', which no source gives"
                issues.append(document.issue(("difficulty", label, index), what, "ids of problems, each once"))
    return tuple(replace(problem, difficulty=labels.get(id_, problem.difficulty)) for id_, problem in found.items())
