"""Wall time by named stage."""

from collections.abc import Iterator
from contextlib import contextmanager

from optiplan.libraries import clock


class Stopwatch:
    """Accumulate wall time by stage in `seconds`, the `timings` of a PlanResult."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside to `name`, without that of nested stages, which is added to theirs."""
        begin, before = clock(), sum(self.seconds.values())
        try:
            yield
        finally:
            within = sum(self.seconds.values()) - before
            self.seconds[name] = self.seconds.get(name, 0.0) + clock() - begin - within
