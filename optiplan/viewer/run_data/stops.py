"""Where the motion of a task rests on its way, and why, for the page."""

from collections.abc import Mapping
from typing import Any

from optiplan.arrays import is_finite


def stops_told(record: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Return the stops that a record (`run.json`) tells of: `t`, s, the step that each comes `after`, and `why`."""
    told = ((record or {}).get("info") or {}).get("stops")
    stops = [one for one in told if isinstance(one, Mapping)] if isinstance(told, list | tuple) else []
    return [
        {"t": float(one["t"]), "after": int(one["after"]), "why": str(one.get("why", ""))}
        for one in stops
        if is_finite(one.get("t")) and is_finite(one.get("after"))
    ]
