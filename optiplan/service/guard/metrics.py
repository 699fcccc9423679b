"""Counts of requests, in the text format that Prometheus reads.

Source: prometheus.io, "Exposition formats", text format 0.0.4.
"""

from collections import Counter
from collections.abc import Mapping

BOUNDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, float("inf"))
"""s, of the histogram of answers."""
METHODS = ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH")


class RequestCounts:
    """Counts since the server began."""

    def __init__(self) -> None:
        self._requests: Counter[tuple[str, int]] = Counter()
        self._slots: Counter[float] = Counter()
        self._seconds = 0.0

    def add(self, method: str, status: int, seconds: float) -> None:
        """Count a request."""
        self._requests[method if method in METHODS else "other", status] += 1
        self._slots[next(bound for bound in BOUNDS if seconds <= bound)] += 1
        self._seconds += seconds

    def text(self, gauges: Mapping[str, float], runs: Mapping[str, int]) -> str:
        """All counts.

        Args:
            gauges: further values by name.
            runs: how many runs there are of each state.
        """
        lines = ["# HELP optiplan_requests_total Requests answered.", "# TYPE optiplan_requests_total counter"]
        for (method, status), count in sorted(self._requests.items()):
            lines.append(f'optiplan_requests_total{{method="{method}",status="{status}"}} {count}')
        lines += ["# HELP optiplan_request_seconds Time to answer.", "# TYPE optiplan_request_seconds histogram"]
        total = 0
        for bound in BOUNDS:
            total += self._slots[bound]
            name = "+Inf" if bound == float("inf") else f"{bound:g}"
            lines.append(f'optiplan_request_seconds_bucket{{le="{name}"}} {total}')
        lines += [f"optiplan_request_seconds_sum {self._seconds:.6f}", f"optiplan_request_seconds_count {total}"]
        lines += ["# HELP optiplan_runs Runs by state.", "# TYPE optiplan_runs gauge"]
        lines += [f'optiplan_runs{{state="{state}"}} {count}' for state, count in sorted(runs.items())]
        for name, value in gauges.items():
            lines += [f"# TYPE optiplan_{name} gauge", f"optiplan_{name} {value:g}"]
        return "\n".join(lines) + "\n"
