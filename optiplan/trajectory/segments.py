"""Segments of a motion: when which step of a task is done."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from optiplan.errors import InputError, Issue

EVENTS = ("attach", "detach", "gripper")
"""Kinds of segments that other programs act upon."""

RESTING = (*EVENTS, "dwell")
"""Kinds of segments before and after which the arm stands still."""


@dataclass(frozen=True)
class Segment:
    """A part of a motion, from `begin` to `end`, s; an event where both are one.

    Attributes:
        step: number of the step of the task, from 1.
        kind: key of the step: `move`, `attach`, ….
        name: of the step.
        begin: s.
        end: s.
    """

    step: int
    kind: str
    name: str
    begin: float
    end: float

    def scaled(self, factor: float) -> "Segment":
        """Return the segment of a motion that takes so many times as long."""
        return Segment(self.step, self.kind, self.name, self.begin * factor, self.end * factor)


def segment_data(segments: Sequence[Segment]) -> dict[str, Any]:
    """Return `segments` and, for programs that act upon them, `events` with their time `t`, s; JSON-ready."""
    events = [
        {"t": one.begin, "end": one.end, "step": one.step, "kind": one.kind, "name": one.name}
        for one in segments
        if one.kind in EVENTS
    ]
    return {"segments": [asdict(one) for one in segments], "events": events}


def read_segments(data: Mapping[str, Any], file: str) -> tuple[Segment, ...]:
    """Return the `segments` of a trajectory file; none where it has none.

    Raises:
        InputError: they are not what `segment_data` writes.
    """
    given = data.get("segments", [])
    expected = "a list of {step, kind, name, begin, end}, times in s"
    if not isinstance(given, list):
        raise InputError([Issue(file, None, "segments", f"{given!r:.60}", expected)])
    found = []
    for k, one in enumerate(given):
        try:
            if any(isinstance(one[key], bool | str) for key in ("step", "begin", "end")):
                raise TypeError("texts and truth values are no numbers")
            times = float(one["begin"]), float(one["end"])
            segment = Segment(int(one["step"]), str(one["kind"]), str(one["name"]), *times)
            if not (segment.kind + segment.name).isprintable():  # they stand in programs that are exported
                raise ValueError(segment.name)
            found.append(segment)
        except (TypeError, KeyError, ValueError, OverflowError):
            raise InputError([Issue(file, None, f"segments[{k}]", f"{one!r:.60}", expected)]) from None
    return tuple(found)
