"""One program for all curves between two stops of a task: moves, lines, their durations and how they meet."""
