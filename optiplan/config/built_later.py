"""Fields of schemas whose validators are built by their first value: most files have few of the keys there are."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema


class BuiltLater:
    """Marks a field, `Annotated[…, BuiltLater()]`, whose validator takes long to build and is often not needed.

    Values, errors and, but for titles, the JSON schema are as without the mark. It stands right behind the type: of an
    annotation it sees nothing that stands between.

    Attributes:
        kind: returns the type, of a field `Annotated[Any, BuiltLater(kind)]` whose module is imported by its first
            value, too; None: it stands in the annotation.
    """

    def __init__(self, kind: Callable[[], Any] | None = None) -> None:
        self.kind = kind

    def __get_pydantic_core_schema__(self, source: Any, _handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of a value that the type's own validator reads."""
        reads = _Validator((lambda: source) if self.kind is None else self.kind)
        return core_schema.no_info_plain_validator_function(
            reads, metadata={"pydantic_js_functions": [reads.json_schema]}
        )


class _Validator:
    """Validates values of a type; the validator is built by the first."""

    def __init__(self, kind: Callable[[], Any]) -> None:
        self._kind = kind

    @cached_property
    def adapter(self) -> TypeAdapter[Any]:
        return TypeAdapter(self._kind())

    def json_schema(self, _schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Return the JSON schema of the type itself."""
        return handler(self.adapter.core_schema)

    def __call__(self, value: Any) -> Any:
        return self.adapter.validate_python(value)
