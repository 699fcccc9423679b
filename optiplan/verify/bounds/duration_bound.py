"""What is proved of how long any motion of a problem takes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

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
    """

    seconds: float
    alone: float
    joints: tuple[str, ...] = ()
    parts: int = 0
    history: tuple[tuple[float, float], ...] = ()
    left_out: tuple[str, ...] = ()

    def gap(self, duration: float) -> float | None:
        """Return the share by which a motion of this `duration`, s, can be longer than the shortest one, at most.

        duration / seconds - 1; None where the bound is 0. Of a verified motion it is never negative: that would be a
        fault.
        """
        return None if self.seconds < NO_TIME else duration / self.seconds - 1.0

    def words(self, duration: float | None = None) -> str:
        """Return the bound in a sentence, with how far a motion of `duration`, s, is from the optimum at most."""
        said = f"no motion is shorter than {self.seconds:.3f} s, proved"
        gap = None if duration is None else self.gap(duration)
        if gap is None:
            return said
        if not gap >= 0.0:
            return f"a motion of {duration} s contradicts the bound, please report it: {said}"
        return f"at most {100.0 * gap:.1f} % from the optimum, proved: {said}"

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
    def from_dict(cls, data: Mapping[str, Any]) -> "DurationBound":
        """Return a bound from the content of `to_dict`."""
        return cls(
            float(data["seconds"]),
            float(data["alone"]),
            tuple(data.get("joints", ())),
            int(data.get("parts", 0)),
            tuple((float(when), float(seconds)) for when, seconds in data.get("history", ())),
            tuple(data.get("left_out", ())),
        )
