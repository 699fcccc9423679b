"""Tolerances and sizes that several modules of this room share."""

SAME_TIME = 1e-12
"""Share of the duration: breakpoints that are nearer in time are one."""

SHORTEST_DURATION = 1e-3
"""s: duration of a trajectory in which nothing moves."""

LIMIT_ROUNDING = 1e-9
"""Share of a limit that rounding may add."""
