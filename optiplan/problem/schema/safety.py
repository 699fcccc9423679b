"""The schema of `clearance` in a problem file: how far bodies stay apart."""

from collections.abc import Sequence
from itertools import product
from typing import Annotated, Any

from pydantic import Field

from optiplan.config.document import Document, Strict
from optiplan.config.messages import choices
from optiplan.config.values import Name
from optiplan.errors import Issue
from optiplan.geometry.safety import MOST, WITHIN, Safety, named_by
from optiplan.geometry.scene import Scene
from optiplan.problem.partial import mapping
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pairs import PROVED, WORDS

Distance = Annotated[float, Field(strict=True, ge=0.0, le=MOST, allow_inf_nan=False)]
"""m, of bodies that stay apart."""

Way = Annotated[float, Field(strict=True, ge=1e-3, le=100.0, allow_inf_nan=False)]
"""rad or m, summed over the joints."""

Names = Name | Annotated[tuple[Name, ...], Field(min_length=1)]
"""A name, or several, in which `*` stands for any text."""


class SafePairsSpec(Strict):
    """Two groups of bodies and the distance that they keep, m; 0 lets a pair come as near as it likes."""

    of: Names
    others: Annotated[Names, Field(alias="from")]
    at_least: Distance


class SafetySpec(Strict):
    """Distances, m, of the robot and what it holds from obstacles (`scene`), and of its own bodies (`self`).

    The last of `pairs` that holds a pair decides about it. `within` is the way, rad or m summed over the joints, over
    which a pair that is nearer at an end of the motion grows to the whole distance.
    """

    scene: Distance = 0.0
    own: Annotated[Distance, Field(alias="self")] = 0.0
    pairs: tuple[SafePairsSpec, ...] = ()
    within: Way = WITHIN


ClearanceSpec = Distance | SafetySpec


def safety_data(spec: Any) -> Any:
    """Return what was read as plain data, by the keys of a file."""
    return spec.model_dump(mode="json", by_alias=True) if isinstance(spec, SafetySpec) else spec


def safety_of(
    document: Document,
    spec: float | SafetySpec | None,
    scene: Scene,
    others: Sequence[str],
    robot: Robot | None,
) -> tuple[Safety | None, list[Issue]]:
    """Return what is required of the bodies of a scene and of others, links and bodies of tools; and what is wrong.

    Wrong is a name that no body has, and a group of pairs that has none, or only pairs that are not checked.
    """
    issues: list[Issue] = []
    unchecked = _unchecked(document, scene, robot)
    for k, part in enumerate(spec.pairs if isinstance(spec, SafetySpec) else ()):
        place = ("clearance", "pairs", k)
        of, from_ = (_bodies(stated, [*others, *scene.names]) for stated in (part.of, part.others))
        for key, stated, found in (("of", part.of, of), ("from", part.others, from_)):
            names = (stated,) if isinstance(stated, str) else stated
            for i, name in enumerate(names):
                if not found[name]:
                    where = (*place, key) if isinstance(stated, str) else (*place, key, i)
                    valid = choices(name, sorted({*others, *scene.names}))
                    issues.append(document.issue(where, f"'{name}', which no body is called", valid))
        pairs = {
            frozenset((a, b)) for mine in of.values() for a in mine for own in from_.values() for b in own if a != b
        }
        if pairs and part.at_least > 0.0 and pairs <= unchecked.keys():
            reasons = ", ".join(sorted({unchecked[pair] for pair in pairs}))
            expected = "pairs that are checked, or `at_least: 0`"
            issues.append(document.issue(place, f"pairs that are not checked ({reasons})", expected))
        elif not pairs and all(of.values()) and all(from_.values()):
            issues.append(document.issue(place, "one body in both groups, and no other", "two bodies"))
    return (None if issues else Safety.from_data(safety_data(spec))), issues


def _unchecked(document: Document, scene: Scene, robot: Robot | None) -> dict[frozenset[str], str]:
    """Return pairs of which nothing is checked, and why.

    In a task bodies are taken and released: there only pairs count that may touch throughout.
    """
    found: dict[frozenset[str], str] = {}
    if robot is not None and mapping(document.data).get("task") is None:
        bodies = enumerate(robot.geometry.geometryObjects)
        still = {robot.link_of(k) for k, body in bodies if body.parentJoint == 0}
        names = [one.name for one in scene.standing.obstacles]
        found = {frozenset(pair): "neither ever moves" for pair in product(still, names)}
        for held in scene.attached:
            found |= {frozenset((held.name, link)): "held, with what it may touch" for link in (held.link, *held.touch)}
    allowed = {} if robot is None else robot.allowed
    found |= {frozenset(pair): WORDS[why.partition(":")[0]] for pair, why in allowed.items() if why != PROVED}
    return found | dict.fromkeys(scene.allowed, "allowed by scene.allowed_collisions")


def _bodies(stated: str | Sequence[str], names: Sequence[str]) -> dict[str, list[str]]:
    """Return the bodies that each name or pattern means."""
    patterns = (stated,) if isinstance(stated, str) else stated
    return {pattern: [name for name in names if named_by(pattern, name)] for pattern in patterns}
