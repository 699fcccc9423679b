"""Every shape keeps the contract of `Shape`: a new one is a class, a line in `ShapeSpec`, and an example here."""

import coal
import numpy as np
import pytest
from pydantic import ValidationError

from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import SHAPES, ShapeSpec, build_geometry, shape_data, shape_from_spec, shape_of_body

EXAMPLES = {
    "box": [0.2, 0.4, 0.6],
    "sphere": 0.3,
    "cylinder": {"radius": 0.1, "length": 0.5},
    "capsule": {"radius": 0.1, "length": 0.5},
    "half_space": {"normal": [0.0, 0.6, 0.8], "offset": 0.2},
}
OWN = pytest.mark.parametrize("kind", sorted(EXAMPLES))
FAR = 3.0  # m


def made(kind: str) -> Shape:
    return shape_from_spec(ShapeSpec.model_validate({kind: EXAMPLES[kind]}))


def test_every_shape_has_an_example():
    assert {*EXAMPLES, "mesh", "points", "octree"} == set(SHAPES) == set(ShapeSpec.model_fields)


@OWN
def test_data_and_shape_are_two_forms_of_one_thing(kind):
    assert type(made(kind)) is SHAPES[kind]
    assert shape_data(made(kind)) == {kind: EXAMPLES[kind]}
    assert made(kind) == made(kind)
    assert len({made(kind), made(kind)}) == 1
    with pytest.raises(ValidationError):
        ShapeSpec.model_validate({kind: "large"})


@OWN
def test_a_body_of_coal_is_known_again(kind):
    body = build_geometry(made(kind))
    assert type(body) is SHAPES[kind].body_type
    assert shape_of_body(body) == made(kind)


@OWN
def test_the_support_is_what_keeps_a_half_space_away(kind):
    """A half-space {x: n . x >= d} beyond the shape is at the distance d - h(n), which coal finds without `support`."""
    rng, shape = np.random.default_rng(0), made(kind)
    body = build_geometry(shape)
    if shape.endless:  # two half-spaces have no distance
        assert shape.support(np.array([[0.0, 1.2, 1.6], [0.0, 0.0, 1.0]])).tolist() == [pytest.approx(0.4), np.inf]
        return
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    found = []
    for n in directions:
        wall, here, result = coal.Halfspace(-n, -FAR), coal.Transform3s(), coal.DistanceResult()
        found.append(FAR - coal.distance(wall, here, body, here, coal.DistanceRequest(), result))
    assert shape.support(directions) == pytest.approx(found, abs=1e-9)
    assert shape.support(2.0 * directions) == pytest.approx(2.0 * shape.support(directions))


@OWN
def test_the_page_draws_it(kind):
    picture, body = made(kind).picture(), build_geometry(made(kind))
    if isinstance(picture, dict):
        assert picture["kind"] in {"box", "sphere", "cylinder", "capsule", "plane"}, "what shapes.js can draw"
        return
    assert picture is not None
    box = body.aabb_local
    assert picture.min(axis=0) == pytest.approx(box.min_, rel=0.02), "points of the surface, to its ends"
    assert picture.max(axis=0) == pytest.approx(box.max_, rel=0.02)


def test_what_is_no_listed_shape_is_none():
    assert shape_of_body(coal.Cone(0.1, 0.2)) is None
