"""What a scene's `Safety` required of a motion, and the pairs that it requires less of, for reports."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from optiplan.collision.floors import Floors
from optiplan.collision.model import CollisionModel
from optiplan.config.messages import some
from optiplan.geometry.safety import Safety

MOST_NAMED = 6
"""Pairs that a report names; the witness has all."""


def asked_words(model: CollisionModel, safety: Safety | None, floors: Floors | None) -> dict[str, Any]:
    """Return what was required, m, and the pairs with lower floors, for the witness of a check; or nothing."""
    if safety is None or floors is None:
        return {}
    nearer = [
        {
            "pair": sorted((model.pairs[one.pair].name_a, model.pairs[one.pair].name_b)),
            "required": one.asked,
            "distance": one.distance,
            "floor": one.base,
            "built": one.end < 0,
            **({} if one.end < 0 else {"q": [None if np.isnan(x) else float(x) for x in floors.ends[one.end]]}),
        }
        for one in floors.near
    ]
    required = {"scene": safety.scene, "self": safety.own, "within": safety.within, "pairs": len(safety.pairs)}
    return {"required": required, "nearer": nearer}


def safety_scope(witness: Mapping[str, Any]) -> list[str]:
    """Return what was required, and which pairs were nearer, from the witness of a check of collisions."""
    if "required" not in witness:
        return []
    required, nearer = witness["required"], witness["nearer"]
    count = required["pairs"]
    groups = f", {count} group{'' if count == 1 else 's'} of pairs as stated" if count else ""
    scene, own = 1e3 * required["scene"], 1e3 * required["self"]
    said = f"clearance required: {scene:g} mm from the scene, {own:g} mm of the robot from itself"
    found = [f"{said}{groups}, of pairs of links that can meet"]
    way = f"growing to what is required within {required['within']:g} rad or m, summed over the joints that move a pair"
    for built, where in ((False, f"nearer at an end, with floors of 0.8 of that, {way}"), (True, "built nearer")):
        names: dict[str, dict[str, Any]] = {}
        for one in nearer:
            name = " – ".join(one["pair"])
            if one["built"] is built and (name not in names or one["distance"] < names[name]["distance"]):
                names[name] = one
        pairs = [f"{name} ({1e3 * one['distance']:.2g} mm)" for name, one in sorted(names.items())]
        found += [f"{where}: {some(pairs, MOST_NAMED)}"] if pairs else []
    return found
