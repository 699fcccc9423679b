"""Tasks in time: meeting what moves, going with it, waiting for it."""
