"""Where the problems of a suite come from."""
