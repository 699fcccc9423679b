"""Geometry models of thousands of bodies, built in seconds."""

from collections.abc import Sequence

import pinocchio as pin

MANY = 300
"""Least number of bodies for which the quick construction pays."""


def geometry_of(bodies: Sequence[pin.GeometryObject]) -> pin.GeometryModel:
    """Return a geometry model of these bodies, in this order, without pairs.

    `addGeometryObject` enlarges the n-by-n table of pairs for every body. This copies n^3 / 3 numbers, which takes
    minutes for 5,000 bodies. So many bodies are put into the list of a model that already counts them; adding the last
    one then makes the whole table at once.
    """
    model = _counting(len(bodies) - 1) if len(bodies) > MANY else None
    if model is None:
        model, first = pin.GeometryModel(), 0
    else:
        first = len(bodies) - 1
        for body in bodies[:first]:
            model.geometryObjects.append(body)
    for body in bodies[first:]:
        model.addGeometryObject(body)
    model.removeAllCollisionPairs()  # also clears the table
    return model


def _counting(count: int) -> pin.GeometryModel | None:
    """Return a model without bodies whose count of bodies is `count`; None if the archive does not begin with it."""
    words = pin.GeometryModel().saveToString().split(" ")
    for place in (place for place, word in enumerate(words[:8]) if word == "0"):
        model = pin.GeometryModel()
        try:
            model.loadFromString(" ".join([*words[:place], str(count), *words[place + 1 :]]))
        except (RuntimeError, ValueError):
            continue
        if model.ngeoms == count and not len(model.geometryObjects):
            return model
    return None
