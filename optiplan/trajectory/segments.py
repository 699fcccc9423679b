"""Segments of a motion: when which step of a task is done."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from optiplan.arrays import is_finite
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass

PASSING = "passing"
"""Kind of the events on a path of the tool, which it passes without a stop."""

ON_PATH = "path"
"""Kind of the segments along a path of the tool, to it and away from it."""

STOPPED = ("attach", "detach", "tool", "gripper", "process")

EVENTS = (*STOPPED, PASSING)
"""Kinds of segments that other programs act upon."""

RESTING = (*STOPPED, "dwell")
"""Kinds of segments before and after which the arm stands still."""

TOUR = "tour"
"""Kind of the segments that lead to the targets of a tour, at each of which the arm stands still."""


@dataclass(frozen=True)
class Segment:
    """A part of a motion, from `begin` to `end`, s; an event where both are one.

    Attributes:
        step: number of the step of the task, from 1.
        kind: key of the step: `move`, `attach`, ….
        name: of the step.
        begin: s.
        end: s.
        object: that is taken or released, or the tool that is; empty of other kinds.
        link: that takes it or lets it go.
    """

    step: int
    kind: str
    name: str
    begin: float
    end: float
    object: str = ""
    link: str = ""

    def scaled(self, rate: float) -> "Segment":
        """Return the segment of a motion that is so many times as fast; at its end where it was, without rounding."""
        return replace(self, begin=self.begin / rate, end=self.end / rate)

    def to_data(self) -> dict[str, Any]:
        """Return it JSON-ready; without `object` and `link` where it has none."""
        return {key: value for key, value in asdict(self).items() if value != ""}


def segment_data(segments: Sequence[Segment]) -> dict[str, Any]:
    """Return `segments` and, for programs that act upon them, `events` with their time `t`, s; JSON-ready."""
    data = [one.to_data() for one in segments]
    events = [{"t": one.pop("begin"), **one} for one in map(dict, data) if one["kind"] in EVENTS]
    return {"segments": data, "events": events}


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
            step, begin, end = one["step"], one["begin"], one["end"]
            if not all(map(is_finite, (step, begin, end))) or step != int(step):
                raise TypeError("a step is a whole number, times are finite ones")
            held = str(one.get("object", "")), str(one.get("link", ""))
            segment = Segment(int(step), str(one["kind"]), str(one["name"]), float(begin), float(end), *held)
            if not "".join(
                (segment.kind, segment.name, *held)
            ).isprintable():  # they stand in programs that are exported
                raise ValueError(segment.name)
            found.append(segment)
        except (TypeError, KeyError, ValueError, OverflowError, AttributeError):
            raise InputError([Issue(file, None, f"segments[{k}]", f"{one!r:.60}", expected)]) from None
    return tuple(found)
