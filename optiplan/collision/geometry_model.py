"""Geometry models of thousands of bodies in seconds."""

from collections.abc import Sequence

import pinocchio as pin

MANY = 300
"""Bodies from which on the quick way pays."""


def geometry_of(bodies: Sequence[pin.GeometryObject]) -> pin.GeometryModel:
    """A geometry model that holds these bodies, in this order, and no pairs.

    `addGeometryObject` enlarges the table of pairs, n by n, for every body: n^3 / 3 numbers are copied, which takes
    minutes for 5,000 bodies. Many bodies are put into the list of a model that already counts them, and adding the
    last one makes the whole table at once.
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
    """A model without bodies whose number of bodies says `count`; None where the archive does not begin with it."""
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
