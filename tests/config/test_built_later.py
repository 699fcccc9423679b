from typing import Annotated

import pytest
from pydantic import AfterValidator, Field, ValidationError

from optiplan.config.built_later import BuiltLater
from optiplan.config.document import Strict
from optiplan.problem.schema.ends import AlternativeSpec, GoalSpec
from optiplan.problem.schema.problem import ProblemSpec
from optiplan.problem.schema.scene import SceneSpec
from optiplan.robot.spec import RobotSpec


class Part(Strict):
    size: Annotated[float, Field(gt=0.0)]
    name: str = "part"


def few(parts):
    if len(parts) > 2:
        raise ValueError("found many; expected few")
    return parts


class Now(Strict):
    parts: Annotated[tuple[Part, ...], AfterValidator(few)] = ()
    one: Part | None = None


class Later(Strict):
    parts: Annotated[tuple[Part, ...], BuiltLater(), AfterValidator(few)] = ()
    one: Annotated[Part | None, BuiltLater()] = None


@pytest.mark.parametrize("data", [{}, {"one": {"size": 2}}, {"parts": [{"size": 1.0}, {"size": 2, "name": "b"}]}])
def test_values_are_as_without_the_mark(data):
    now, later = Now.model_validate(data), Later.model_validate(data)
    assert now.model_dump(mode="json", exclude_none=True) == later.model_dump(mode="json", exclude_none=True)
    assert later.parts == now.parts


@pytest.mark.parametrize(
    "data", [{"one": {"size": -1}}, {"one": {"size": 1, "nme": 2}}, {"parts": [{"size": 1}] * 3}, {"parts": [{}, 3]}]
)
def test_errors_are_as_without_the_mark(data):
    found = []
    for kind in (Now, Later):
        with pytest.raises(ValidationError) as error:
            kind.model_validate(data)
        found.append([(one["type"], one["loc"], one["msg"]) for one in error.value.errors()])
    assert found[0] == found[1]


def test_json_schema_is_as_without_the_mark_but_for_titles():
    assert untitled(Now.model_json_schema()) == untitled(Later.model_json_schema())


def untitled(schema):
    if isinstance(schema, list):
        return [untitled(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: untitled(one) for key, one in schema.items() if key != "title"}


def test_the_mark_stands_right_behind_the_type():
    specs = (ProblemSpec, SceneSpec, AlternativeSpec, GoalSpec, RobotSpec)
    marked = [field.metadata for spec in specs for field in spec.model_fields.values() if _mark(field.metadata)]
    assert len(marked) >= 10
    assert all(isinstance(metadata[0], BuiltLater) for metadata in marked)


def _mark(metadata):
    return any(isinstance(one, BuiltLater) for one in metadata)
