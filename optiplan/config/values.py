"""Values of a problem file: numbers with their ranges, vectors, names, and mappings of which one key is chosen."""

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from optiplan.arrays import unit_vector
from optiplan.config.document import Number, Strict

LARGEST_COORDINATE = 1e6
"""m; nothing that an arm can meet, and beyond it distances lose the micrometres that they are trusted to."""

Length = Annotated[float, Field(strict=True, gt=0.0, le=LARGEST_COORDINATE, allow_inf_nan=False)]
"""A number > 0, m."""

Coordinate = Annotated[float, Field(strict=True, ge=-LARGEST_COORDINATE, le=LARGEST_COORDINATE, allow_inf_nan=False)]
"""A number of either sign, m (or rad, or of a unit vector)."""

NotNegative = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(strict=True, ge=1e-6, le=1.0, allow_inf_nan=False)]


def _no_look_alike(value: Any) -> Any:
    if isinstance(value, bool | float):  # of which Python takes true and 1.0 for 1
        raise ValueError("1")
    return value


FileVersion = Annotated[Literal[1], BeforeValidator(_no_look_alike)]
"""The version of a file's format."""


def _printable(text: str) -> str:
    if not text.isprintable():  # they would rule the terminal that the name is printed to
        raise ValueError(f"found {text[:60]!r}; expected text of one line without control characters or unusual blanks")
    return text


Name = Annotated[str, Field(strict=True, min_length=1, max_length=200), AfterValidator(_printable)]
FileName = Annotated[str, Field(strict=True, min_length=1), AfterValidator(_printable)]
"""The path of a file, or a name that stands for one."""


def listed(value: Any) -> Any:
    """Return a name or a mapping that stands alone as a list of it; anything else as it is."""
    return [value] if isinstance(value, str | dict) else value


def _sized(count: int, words: str) -> AfterValidator:
    def check(values: tuple[Any, ...]) -> tuple[Any, ...]:
        if len(values) != count:
            raise ValueError(f"{count} values {words}")
        return values

    return AfterValidator(check)


def _unit_length(values: tuple[float, ...]) -> tuple[float, ...]:
    unit_vector(values)
    return values


def _distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) != len(names):
        raise ValueError(f"found '{names[0]}' twice; expected the names of two bodies")
    return names


def _repeated(value: Any) -> Any:
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _schema_size(count: int) -> Callable[[dict[str, Any]], None]:
    def add(schema: dict[str, Any]) -> None:
        schema.update(minItems=count, maxItems=count)

    return add


def _schema_by_name(schema: dict[str, Any]) -> None:
    listed = dict(schema)
    schema.clear()
    schema["anyOf"] = [listed, {"type": "object", "additionalProperties": listed["items"]}]


JointValues = Annotated[tuple[Number, ...], Field(json_schema_extra=_schema_by_name)]
"""One value for each planned joint; a file may name them, `{joint: value}`, which its reader puts in order."""

Vector = Annotated[tuple[Coordinate, ...], _sized(3, "[x, y, z]"), Field(json_schema_extra=_schema_size(3))]
Size = Annotated[tuple[Length, ...], _sized(3, "[x, y, z]"), Field(json_schema_extra=_schema_size(3))]
Scale = Annotated[Size, BeforeValidator(_repeated, json_schema_input_type=Length | Size)]
Direction = Annotated[Vector, AfterValidator(_unit_length)]
Quaternion = Annotated[
    tuple[Number, ...],
    _sized(4, "[x, y, z, w]"),
    AfterValidator(_unit_length),
    Field(json_schema_extra=_schema_size(4)),
]
NamePair = Annotated[
    tuple[Name, ...],
    _sized(2, "[name, name]"),
    AfterValidator(_distinct),
    Field(json_schema_extra=_schema_size(2)),
]


class ExactlyOne(Strict):
    """A mapping that has exactly one of its keys, but for those of `BESIDE`, which may stand beside it."""

    BESIDE: ClassVar[frozenset[str]] = frozenset()

    @model_validator(mode="after")
    def _one(self) -> Self:
        valid = f"exactly one of: {', '.join(key for key in type(self).model_fields if key not in self.BESIDE)}"
        if len(self.model_fields_set - self.BESIDE) != 1:
            raise ValueError(valid)
        if self.value is None:
            raise ValueError(f"found '{self.kind}' without a value; expected {valid}")
        return self

    @property
    def kind(self) -> str:
        """The key that is there."""
        return next(iter(self.model_fields_set - self.BESIDE))

    @property
    def value(self) -> Any:
        """What stands under it."""
        return getattr(self, self.kind)
