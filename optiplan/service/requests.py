"""Requests as data: what identifies one, which files it may read, and what its refusal says."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from optiplan.service.execution.solver_pool import SolverAnswer
from optiplan.service.refusals import Refusal


def refusal_of(answer: SolverAnswer) -> Refusal:
    """The refusal that a process's error is: what was asked is wrong, or we are."""
    return Refusal(500 if "bug" in answer.data else 422, answer.data["error"], answer.data["issues"])


def digest_of(value: Any) -> str:
    """SHA-256, in hex, of JSON-ready data."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def names_files(request: Mapping[str, Any]) -> bool:
    """Whether a problem may read files besides the bundled ones."""
    text = json.dumps(request["problem"])
    return any(word in text for word in ("file", "urdf", ".yaml", "/"))
