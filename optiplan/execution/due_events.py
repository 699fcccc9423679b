"""Events of a path, each handed out once."""

import math

from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.trajectory.segments import Segment


class DueEvents:
    """The events of a path that are due.

    Attributes:
        done: place up to which they were handed out, s.
    """

    def __init__(self, path: ProvedPath, missed: tuple[Segment, ...] = ()) -> None:
        self._path, self._missed, self.done = path, missed, -math.inf

    def by(self, place: float) -> tuple[Segment, ...]:
        """Return the events that have become due by a place of the path, s."""
        due = tuple(event for event in self._path.events if self.done < event.begin <= place)
        self.done = max(self.done, place)
        due, self._missed = self._missed + due, ()
        return due

    def then(self, path: ProvedPath, place: float) -> "DueEvents":
        """Return those of a path that takes over at a place, s, after what is due by then."""
        return DueEvents(path, self.by(place))
