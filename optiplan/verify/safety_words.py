"""What a scene's `Safety` asked of a motion, and of which pairs less, for reports."""

from typing import Any

from optiplan.collision.floors import Floors
from optiplan.collision.model import CollisionModel
from optiplan.geometry.safety import Safety

MOST_NAMED = 6
"""Pairs that a report names; the witness has all."""


def asked_words(model: CollisionModel, safety: Safety | None, floors: Floors | None) -> dict[str, Any]:
    """Return the witness of a check of collisions: what was asked, m, and the pairs with lower floors; or nothing."""
    if safety is None or floors is None:
        return {}
    nearer = [
        {
            "pair": sorted((model.pairs[one.pair].name_a, model.pairs[one.pair].name_b)),
            "asked": one.asked,
            "distance": one.distance,
            "floor": one.base,
            "built": one.end < 0,
            **({} if one.end < 0 else {"q": floors.ends[one.end].tolist()}),
        }
        for one in floors.near
    ]
    asked = {"scene": safety.scene, "self": safety.own, "within": safety.within, "pairs": len(safety.pairs)}
    return {"asked": asked, "nearer": nearer}


def safety_scope(witness: dict[str, Any]) -> list[str]:
    """Return what was asked, and which pairs were nearer, from the witness of a check of collisions."""
    if "asked" not in witness:
        return []
    asked, nearer = witness["asked"], witness["nearer"]
    groups = f", {asked['pairs']} groups of pairs as stated" if asked["pairs"] else ""
    said = f"clearance asked: {1e3 * asked['scene']:g} mm from the scene, {1e3 * asked['self']:g} mm of the robot"
    found = [f"{said} from itself{groups}, of pairs of links that can meet"]
    way = f"growing to what is asked within {asked['within']:g} rad or m, summed over the joints"
    for built, where in ((False, f"nearer at an end, with floors of 0.8 of that, {way}"), (True, "built nearer")):
        names: dict[str, dict[str, Any]] = {}
        for one in nearer:
            name = " – ".join(one["pair"])
            if one["built"] is built and (name not in names or one["distance"] < names[name]["distance"]):
                names[name] = one
        told = [f"{name} ({1e3 * one['distance']:.2g} mm)" for name, one in sorted(names.items())]
        more = f" and {len(told) - MOST_NAMED} more" if len(told) > MOST_NAMED else ""
        found += [f"{where}: {', '.join(told[:MOST_NAMED])}{more}"] if told else []
    return found
