"""Tolerances and samples that planners of several families share."""

NO_MOTION = 1e-9
"""rad or m: a joint that moves by less stands still; the rest is rounding."""

POSITION_LIMIT_ROUNDING = 1e-9
"""rad or m: rounding beyond a position limit."""

LEAST_GAIN = 0.01
"""Share of a path's cost: a search that gains less counts as one that gains nothing."""
