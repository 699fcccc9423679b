"""Chunks of set-points of a learned policy: proved as they are, the nearest that is proved, or the proved stop."""
