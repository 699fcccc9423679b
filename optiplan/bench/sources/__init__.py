"""Sources of the problems of a suite."""
