"""The main planner: minimum-time B-spline, collision rows linearised from coal, sequential quadratic programming."""
