"""The JSON schema of problem files as they are written, with what is taken out before `ProblemSpec` reads them.

That is poses in frames, picks and places, steps that are repeated or done by name, and several robots.
"""

import json
import re
from collections.abc import Mapping
from typing import Any

EXPRESSION = {"type": "string", "pattern": "^=", "description": "Arithmetic of values by name, such as =0.1 * i."}
"""What may stand for a number in steps that are repeated or done by name; see `loops.py`."""

STEPS = {"type": "array", "items": {"$ref": "#/$defs/TaskStepSpec"}}

REPEATED = {
    "for": {"type": "object", "description": "Values by name, such as {i: 0..3}: every value with every other."},
    "steps": {**STEPS, "description": "The steps that are repeated."},
    "do": {"type": "string", "description": "The steps of this name among `tasks`."},
    "with": {"type": "object", "description": "Values by name, for the steps that are done."},
    "either": {
        "type": "array",
        "minItems": 2,
        "items": {**STEPS, "minItems": 1},
        "description": "Lists of steps, one of which is done: the one with which the whole is quickest.",
    },
}
"""Keys of a step that stands for several; see `loops.py`."""

_NOT_IN_WORLD = (
    ("AttachedSpec", "pose"),
    ("FirstToolSpec", "tcp"),
    ("ToolSpec", "tcp"),
    ("ToolShapeSpec", "pose"),
    ("RegionSpec", "offset"),
)
"""Poses in a frame of their own: see `frames.py`."""


def as_written(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of `ProblemSpec` with what files have beside it."""
    from optiplan.robot.side_by_side import ArmSpec

    stated = schema["$defs"]
    in_steps = _reached(stated, "TaskStepSpec", set())
    plain = {name: _calculated(one) if name in in_steps else one for name, one in stated.items()}
    definitions = {name: _in_frames(one) for name, one in plain.items()} | _picks()
    definitions["BarePoseSpec"] = plain["PoseSpec"]
    for name, key in _NOT_IN_WORLD:
        own = definitions[name]["properties"]
        bare = {**own[key], "$ref": "#/$defs/BarePoseSpec"}
        definitions[name] = {**definitions[name], "properties": {**own, key: bare}}
    definitions["TaskStepSpec"] = _step(definitions["TaskStepSpec"])
    definitions["ArmSpec"] = {key: one for key, one in ArmSpec.model_json_schema().items() if key != "$defs"}
    definitions["FrameSpec"] = _frame(definitions["PoseSpec"])
    more = {
        "robots": {"type": "object", "additionalProperties": {"$ref": "#/$defs/ArmSpec"}},
        "frames": {"type": "object", "additionalProperties": {"$ref": "#/$defs/FrameSpec"}},
        "tasks": {"type": "object", "additionalProperties": STEPS},
    }
    required = [key for key in schema["required"] if key != "robot"]
    one = {"required": required, "oneOf": [{"required": ["robot"]}, {"required": ["robots"]}]}
    return {**schema, **one, "$defs": definitions, "properties": {**schema["properties"], **more}}


def _in_frames(definition: dict[str, Any]) -> dict[str, Any]:
    """Return a definition; of a pose with the frame in which it is stated."""
    keys = definition.get("properties", {})
    if not {"position", "quaternion"} <= keys.keys() or "to" in keys:  # of one frame in another
        return definition
    words = "The frame, obstacle or fixed link in which the pose is stated; the world without it."
    own = {"in": {"type": "string", "description": words}}
    words = "A pose from there on, in its own axes: position, m, and rotation."
    offset = {} if "offset" in keys else {"offset": {"$ref": "#/$defs/BarePoseSpec", "description": words}}
    return {**definition, "properties": {**keys, **own, **offset}}


def _frame(pose: dict[str, Any]) -> dict[str, Any]:
    """Return the definition of a named frame: a pose that may move."""
    moves = {"$ref": "#/$defs/MotionSpec", "description": "How the frame moves, and all that is in it."}
    return {**pose, "title": "FrameSpec", "properties": {**pose["properties"], "motion": moves}}


def _picks() -> dict[str, Any]:
    """Return the definitions of picks and places, and of what is in them."""
    from optiplan.problem.schema.picks import KINDS

    found: dict[str, Any] = {}
    for spec in KINDS.values():
        own = spec.model_json_schema(mode="validation", ref_template="#/$defs/{model}")
        found |= {name: _in_frames(_calculated(one)) for name, one in own.pop("$defs", {}).items()}
        found[spec.__name__] = _calculated(own)
    return found


def _step(step: dict[str, Any]) -> dict[str, Any]:
    """Return the definition of a step, which may be a pick or a place, or stand for several."""
    from optiplan.problem.schema.picks import KINDS

    picked = {kind: {"$ref": f"#/$defs/{spec.__name__}"} for kind, spec in KINDS.items()}
    return {**step, "properties": {**step["properties"], **picked, **REPEATED}}


def _reached(definitions: Mapping[str, Any], name: str, known: set[str]) -> set[str]:
    """Return the names of all definitions that one refers to, itself among them, and those already `known`."""
    if name not in known:
        known.add(name)
        for other in re.findall(r'"#/\$defs/(\w+)"', json.dumps(definitions[name])):
            _reached(definitions, other, known)
    return known


def _calculated(schema: Any) -> Any:
    """Return a schema in which an expression may stand for every number."""
    if isinstance(schema, list):
        return [_calculated(one) for one in schema]
    if not isinstance(schema, Mapping):
        return schema
    if schema.get("type") not in ("number", "integer"):
        return {key: _calculated(one) for key, one in schema.items()}
    number = {key: one for key, one in schema.items() if key not in ("description", "title", "default")}
    return {**{key: one for key, one in schema.items() if key not in number}, "anyOf": [number, EXPRESSION]}
