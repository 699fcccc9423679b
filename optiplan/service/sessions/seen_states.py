"""`SeenStates`: the last states that came of a session, to be kept as a run folder."""

import base64
from array import array
from collections import deque
from collections.abc import Mapping
from typing import Any

MOST = 15_000
"""States that are kept: ten minutes at 25 a second."""


class SeenStates:
    """Rows of t, q, v, wanted positions, and the tool's target where there is one: s, rad or m, and m."""

    def __init__(self) -> None:
        self._rows: deque[array[float]] = deque(maxlen=MOST)

    def add(self, state: Mapping[str, Any]) -> None:
        """Keep a state with a position and a velocity of each joint; time must go on."""
        q, v, wanted = state.get("measured") or state["q"], state["v"], state.get("wanted") or state["q"]
        if v is None or len(q) != len(v) or None in q or (self._rows and state["t"] <= self._rows[-1][0]):
            return
        self._rows.append(array("d", [state["t"], *q, *v, *wanted, *state.get("target", ())]))

    def request(self, by: str) -> dict[str, Any] | None:
        """Return what a process needs for the folder, beside the problem; None where less than two states came."""
        if len(self._rows) < 2:
            return None
        rows = base64.b64encode(b"".join(row.tobytes() for row in self._rows)).decode()
        return {"rows": rows, "columns": len(self._rows[0]), "by": by}
