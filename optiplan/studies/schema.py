"""The schema of a design study, `version: 1`: parameters of a robot, what they change, and what is wanted."""

from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from optiplan.config.document import Number, Strict, Whole
from optiplan.config.values import FileName, FileVersion, Length, Name, NotNegative

Identifier = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=60)]
Formula = Annotated[str, Field(strict=True, pattern=r"^=")]
Amount = Number | Formula
"""A number, or an expression of the parameters such as `=foot / 2`."""
Change = Amount | Annotated[list[Amount], Field(min_length=1, max_length=64)]
"""An amount, or a list of them."""


def _rising(values: tuple[float, float]) -> tuple[float, float]:
    if not values[0] < values[1]:
        raise ValueError(f"found [{values[0]:g}, {values[1]:g}]; expected lower < upper")
    return values


class ParameterSpec(Strict):
    """A number of the robot that may be chosen.

    Attributes:
        range: lower and upper end.
        given: the value to compare with; by default the middle of the range.
        unit: shown beside the values.
    """

    range: Annotated[tuple[Number, Number], AfterValidator(_rising)]
    given: Number | None = None
    unit: Name = ""

    @model_validator(mode="after")
    def _given_is_inside(self) -> Self:
        low, high = self.range
        if self.given is not None and not low <= self.given <= high:
            raise ValueError(f"found given {self.given:g}; expected a value of the range {low:g} to {high:g}")
        return self


class SupportSpec(Strict):
    """The polygon on which the robot stands, in the frame of its base: the convex hull of `corners`, m."""

    height: Amount = 0.0
    corners: Annotated[
        list[Annotated[list[Amount], Field(min_length=2, max_length=2)]], Field(min_length=3, max_length=64)
    ]


class StatesSpec(Strict):
    """The states of the robot that measures are taken over.

    Attributes:
        count: states, uniform within the limits of position.
        motion: share of the limits of velocity and acceleration that each joint moves with, its signs random.
        seed: of the states.
        voxel: edge, m, of the cubes that the reached volume is counted in.
    """

    count: Annotated[Whole, Field(ge=10, le=1_000_000)] = 4000
    motion: Annotated[Number, Field(ge=0.0, le=1.0)] = 1.0
    seed: Annotated[Whole, Field(ge=0, lt=2**31)] = 0
    voxel: Length = 0.25


class RequiredSpec(Strict):
    """What a measure must be, at least, at most, or both."""

    least: Number | None = None
    most: Number | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.least is None and self.most is None:
            raise ValueError("found neither least nor most; expected at least one of them")
        return self


class SearchSpec(Strict):
    """NSGA-II: designs of a generation, generations, seed."""

    population: Annotated[Whole, Field(ge=4, le=1000)] = 40
    generations: Annotated[Whole, Field(ge=1, le=10_000)] = 40
    seed: Annotated[Whole, Field(ge=0, lt=2**31)] = 0


class ProofSpec(Strict):
    """How the chosen designs are proved: seconds of planning for each task."""

    budget: Annotated[NotNegative, Field(gt=0.0, le=3600.0)] = 3.0


class StudySpec(Strict):
    """A design study.

    Attributes:
        robot: with a Denavit–Hartenberg table: a bundled name, the path of a robot.yaml, or its content.
        parameters: by name.
        changes: places in the robot file, `dh.rows.elbow.a` for one, and what stands there: numbers, expressions of
            the parameters, or lists of these. Rows of the table and links go by name or by number.
        support: the polygon on which the robot stands.
        tasks: problem files, or their content without a robot, in which the design takes the robot's place.
        maximise, minimise: measures or parameters.
        require: bounds of measures.
    """

    version: FileVersion
    name: Name
    robot: FileName | dict[str, Any]
    parameters: Annotated[dict[Identifier, ParameterSpec], Field(min_length=1, max_length=40)]
    changes: Annotated[dict[Name, Change], Field(min_length=1)]
    support: SupportSpec | None = None
    tasks: list[FileName | dict[str, Any]] = Field(default=[])
    states: StatesSpec = StatesSpec.model_construct()
    maximise: list[Name] = Field(default=[])
    minimise: list[Name] = Field(default=[])
    require: dict[Name, RequiredSpec] = Field(default={})
    search: SearchSpec = SearchSpec.model_construct()
    proof: ProofSpec = ProofSpec.model_construct()
