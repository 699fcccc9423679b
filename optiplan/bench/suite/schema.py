"""The schema of a suite file, `version: 1`: which problems, which planners, how often, under which limits."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from optiplan.config.document import Document, Number, Strict, Whole, read_yaml, validate
from optiplan.config.values import FileVersion, Name
from optiplan.problem.schema.problem import LimitScalesSpec, ObjectiveSpec

COMMON = frozenset({"set", "difficulty", "limits", "objective"})
KINDS = {
    "glob": frozenset({"first", "every"}),
    "mbm": frozenset({"robot", "sets", "first", "every"}),
    "robometrics": frozenset({"robot", "sets", "first", "every"}),
    "generate": frozenset({"robot", "count", "seed", "params"}),
}
"""Kinds of sources, with the keys that each takes beside those of `COMMON`."""

VARIABLE = re.compile(r"\$\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)(?::-(?P<default>[^}]*))?\}")

Positive = Annotated[Number, Field(gt=0.0)]
Count = Annotated[Whole, Field(ge=1)]
SET_NAME = r"^[^./\\][^/\\]*$"
"""Of the name of a set: folders are called so."""
SetName = Annotated[Name, Field(pattern=SET_NAME)]
Seed = Annotated[Whole, Field(ge=0, lt=2**31)]
Item = TypeVar("Item")


def _each_once(what: Callable[[Any], str]) -> AfterValidator:
    def check(values: tuple[Item, ...]) -> tuple[Item, ...]:
        names = [what(value) for value in values]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"found {twice} twice; expected each once")
        return values

    return AfterValidator(check)


def _named(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


class SourceSpec(Strict):
    """A source of problems: exactly one of the keys of `KINDS`, with the keys that kind takes.

    Attributes:
        glob: pattern of problem files, relative to the suite file.
        mbm: folder of MotionBenchMaker sets (`scene*.yaml`, `request*.yaml`), relative to the suite file.
        robometrics: a file of robometrics problems.
        generate: name of a generator of scenes.
        set: name of the set; for `mbm` what stands before the names of its folders.
        difficulty: label of all problems of this source that the suite's own table does not name.
        limits, objective: as in a problem file, for all problems of this source; what is given here goes before what
            their files say, key by key.
        robot: a name or a robot file relative to the suite file, instead of the one in the data.
        sets: only these folders or groups.
        first: number of problems to keep of each set.
        every: keep every k-th problem of each set, the first included.
        count: how many problems to generate.
        seed: of the generator.
        params: of the generator.
    """

    glob: Name | None = None
    mbm: Name | None = None
    robometrics: Name | None = None
    generate: Name | None = None
    set: SetName | None = None
    difficulty: Name | None = None
    limits: LimitScalesSpec | None = None
    objective: ObjectiveSpec | None = None
    robot: Name | None = None
    sets: tuple[Name, ...] | None = None
    first: Count | None = None
    every: Count = 1
    count: Count = 1
    seed: Seed = 0
    params: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        found = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(found) != 1:
            raise ValueError(f"exactly one of: {', '.join(KINDS)}")
        useless = sorted(self.model_fields_set - KINDS[found[0]] - COMMON - {found[0]})
        if useless:
            valid = ", ".join(sorted(KINDS[found[0]] | COMMON))
            raise ValueError(f"found '{useless[0]}' beside '{found[0]}'; expected beside it only: {valid}")
        return self

    @property
    def kind(self) -> str:
        """Key of the source's kind."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)


class SuitePlannerSpec(Strict):
    """A planner's `name`, options of that planner beside it, and a `label` where a name alone is not unique."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name
    label: Name | None = None

    @property
    def shown(self) -> str:
        """Name in the results."""
        return self.label or self.name

    @property
    def options(self) -> dict[str, Any]:
        """The planner's own."""
        return dict(self.model_extra or {})


class RunLimitsSpec(Strict):
    """Hard limits of one run: `wall` clock, s (default: the budget and 60 s), resident `memory`, MB of 1e6 bytes."""

    wall: Positive | None = None
    memory: Annotated[Positive, Field(ge=300.0)] = 4000.0


class SuiteSpec(Strict):
    """A suite file.

    Every problem meets every planner with every seed, `repetitions` times, within `budget` (s of the planner's own
    time). `metrics` are names of numbers to keep of each trajectory, all when not given. `difficulty` gives labels to
    problems by their ids, `{hard: [box/0003, …]}`: frozen here, so that they do not move with the results.
    """

    version: FileVersion
    name: Annotated[Name, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    problems: Annotated[tuple[SourceSpec, ...], Field(min_length=1)]
    planners: Annotated[
        tuple[Annotated[SuitePlannerSpec, BeforeValidator(_named)], ...],
        Field(min_length=1),
        _each_once(lambda planner: f"the planner '{planner.shown}' (give one a label:)"),
    ]
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1), _each_once(lambda seed: f"the seed {seed}")] = (0,)
    repetitions: Count = 1
    budget: Positive
    limits: RunLimitsSpec = RunLimitsSpec.model_construct()
    metrics: tuple[Name, ...] | None = None
    difficulty: dict[Name, tuple[Name, ...]] = Field(default_factory=dict)

    @property
    def wall(self) -> float:
        """Hard limit of one run, s."""
        return self.budget + 60.0 if self.limits.wall is None else self.limits.wall


def read_suite(path: Path | str) -> tuple[SuiteSpec, Document]:
    """A suite file and the lines of its values.

    Raises:
        InputError: the file cannot be used; holds every issue found, in file order.
    """
    document = read_yaml(path)
    return validate(SuiteSpec, document), document


def expand_environment(text: str) -> str:
    """The text with `${NAME}` and `${NAME:-default}` replaced from the environment.

    Raises:
        KeyError: a variable that is not set, without a default; holds its name.
    """

    def value(match: re.Match[str]) -> str:
        found = os.environ.get(match["name"]) or match["default"]
        if found is None:
            raise KeyError(match["name"])
        return found

    return VARIABLE.sub(value, text)
