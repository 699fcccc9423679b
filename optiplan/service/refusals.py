"""Reasons to refuse a request, each with its HTTP status."""

from collections.abc import Mapping, Sequence
from typing import Any

from optiplan.errors import OptiPlanError


class Refusal(OptiPlanError):
    """A request that is refused.

    Attributes:
        status: HTTP status.
        issues: everything that is wrong with the input, as data.
        headers: of the answer.
    """

    def __init__(
        self,
        status: int,
        error: str,
        issues: Sequence[Mapping[str, Any]] = (),
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(error)
        self.status, self.issues, self.headers = status, list(issues), dict(headers or {})


def error_body(error: object, issues: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """The body of every answer that is an error."""
    return {"error": str(error), "issues": list(issues)}


def not_found(what: str, name: str) -> Refusal:
    """There is nothing of that name."""
    return Refusal(404, f"there is no {what} '{name}'")


def internal_error(request: str) -> Refusal:
    """A bug was met, which the log tells with the id of the request."""
    return Refusal(500, f"internal error; the log has it under request {request}")


def busy(why: str, seconds: float) -> Refusal:
    """Too much is asked for now; the client may try again after some seconds."""
    return Refusal(429, why, headers={"Retry-After": str(max(1, round(seconds)))})
