"""Tools: what a robot has at its flange, and changes during a task."""
