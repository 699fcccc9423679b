"""Error of coal's distances; margins of collision queries are multiples of it."""

DISTANCE_ERROR = 1e-6
"""m; GJK and EPA stop at this error (coal's default tolerance), so a distance is known up to it."""
