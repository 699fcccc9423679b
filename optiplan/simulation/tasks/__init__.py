"""Tasks in closed loops: what is taken and released on the way, and where objects end."""
