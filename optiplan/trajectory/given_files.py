"""Samples and other data in the files of a motion, for programs that execute it."""

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

from optiplan.records import dataclass

if TYPE_CHECKING:
    from optiplan.trajectory.sample_file import Samples


SAMPLES = frozenset({"t", "q", "v", "a"})
"""Keys of `trajectory.json` that are compared with the pieces; they are the motion only where it has none."""

KNOWN = SAMPLES | {"joint_names", "pieces", "segments", "events", "wheel_names", "wheels"}
"""Keys of `trajectory.json` that are read, or compared with the motion."""


@dataclass(frozen=True, eq=False)
class GivenFiles:
    """Content of the files of a motion, to compare with it.

    Attributes:
        samples: of `trajectory.json`; None without any.
        motion: `trajectory.json` as parsed.
        record: `run.json` as parsed; empty where there is none.
    """

    samples: "Samples | None" = None
    motion: Mapping[str, Any] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, motion: Mapping[str, Any], record: Mapping[str, Any], file: str) -> "GivenFiles":
        """Return the data beside the pieces of a parsed `trajectory.json`.

        Raises:
            InputError: samples that cannot be read, naming `file`.
        """
        from optiplan.trajectory.sample_file import samples_from_dict

        samples = samples_from_dict(motion, file) if SAMPLES & motion.keys() else None
        return cls(samples, motion, record)
