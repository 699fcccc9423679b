"""What is proved of how long any motion of a problem takes."""

from collections.abc import Callable, Mapping
from typing import Any

from optiplan.arrays import is_finite
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass

NO_TIME = 1e-12
"""s; a goal whose bound is less than that is where the robot stands."""


@dataclass(frozen=True)
class DurationBound:
    """No motion of the problem is shorter than `seconds`; that is proved.

    Attributes:
        seconds: the bound, s.
        alone: s; the same without obstacles: what the slowest joint needs alone.
        joints: of the robot over whose positions the proof is made, in their order; none if obstacles add nothing.
        parts: boxes of configurations that were examined.
        history: (seconds of work, bound in s), each higher than the one before.
        left_out: what the problem demands and the bound does not count; with it motions can only be longer.
        recorded: whether it was read from data, where nothing proves it; its sentence says so.
    """

    seconds: float
    alone: float
    joints: tuple[str, ...] = ()
    parts: int = 0
    history: tuple[tuple[float, float], ...] = ()
    left_out: tuple[str, ...] = ()
    recorded: bool = False

    def gap(self, duration: float) -> float | None:
        """Return the share by which a motion of this `duration`, s, can be longer than the shortest one, at most.

        duration / seconds - 1; None where the bound is 0. Of a verified motion it is never negative: that would be a
        fault.
        """
        return None if self.seconds < NO_TIME else duration / self.seconds - 1.0

    def words(self, duration: float | None = None) -> str:
        """Return the bound in a sentence, with how far a motion of `duration`, s, is from the optimum at most."""
        proved = "as recorded, not proved again" if self.recorded else "proved"
        said = f"no motion is shorter than {self.seconds:.3f} s, {proved}"
        gap = None if duration is None else self.gap(duration)
        if gap is None:
            return said
        if not gap >= 0.0:
            return f"a motion of {duration} s contradicts the bound, please report it: {said}"
        return f"at most {100.0 * gap:.1f} % from the optimum, {proved}: {said}"

    def to_dict(self) -> dict[str, Any]:
        """Return the content as plain data, JSON-ready."""
        return {
            "seconds": self.seconds,
            "alone": self.alone,
            "joints": list(self.joints),
            "parts": self.parts,
            "history": [list(one) for one in self.history],
            "left_out": list(self.left_out),
        }

    @classmethod
    def from_dict(cls, data: Any, file: str = "bound") -> "DurationBound":
        """Return a bound from the content of `to_dict`; it is a recorded one.

        Args:
            data: parsed JSON.
            file: name of the file for the message.

        Raises:
            InputError: naming each field that is missing or of another kind.
        """
        if not isinstance(data, Mapping):
            raise InputError([Issue(file, None, "proved_bound", f"{data!r:.120}", "a JSON object")])
        found = {"joints": [], "parts": 0, "history": [], "left_out": [], **data}
        issues = [
            Issue(file, None, f"proved_bound.{key}", f"{found[key]!r:.120}" if key in found else "nothing", expected)
            for key, (fits, expected) in _FIELDS.items()
            if key not in found or not fits(found[key])
        ]
        if issues:
            raise InputError(issues)
        return cls(
            float(found["seconds"]),
            float(found["alone"]),
            tuple(found["joints"]),
            found["parts"],
            tuple((float(when), float(seconds)) for when, seconds in found["history"]),
            tuple(found["left_out"]),
            recorded=True,
        )


def _seconds(value: Any) -> bool:
    return is_finite(value) and value >= 0.0


def _names(value: Any) -> bool:
    return isinstance(value, list | tuple) and all(isinstance(one, str) for one in value)


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _history(value: Any) -> bool:
    pairs = isinstance(value, list | tuple) and all(isinstance(one, list | tuple) and len(one) == 2 for one in value)
    return pairs and all(_seconds(seconds) for one in value for seconds in one)


_FIELDS: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "seconds": (_seconds, "a number >= 0, s"),
    "alone": (_seconds, "a number >= 0, s"),
    "joints": (_names, "a list of names"),
    "parts": (_count, "a whole number >= 0"),
    "history": (_history, "a list of pairs of numbers >= 0"),
    "left_out": (_names, "a list of texts"),
}
