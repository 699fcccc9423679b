"""Wall time by named stage."""

from collections.abc import Iterator
from contextlib import contextmanager

from optiplan.libraries import clock


class Stopwatch:
    """Accumulate wall time by stage in `seconds`, the `timings` of a PlanResult."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._counted = 0.0

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside to `name`, without that of nested stages, which is added to theirs."""
        begin, before = clock(), self._counted
        try:
            yield
        finally:
            own = clock() - begin - (self._counted - before)
            self.seconds[name] = self.seconds.get(name, 0.0) + own
            self._counted += own

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Add the time spent inside to no stage."""
        begin = clock()
        try:
            yield
        finally:
            self._counted += clock() - begin
