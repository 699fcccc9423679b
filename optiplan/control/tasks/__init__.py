"""Tasks: what a controller tries to do, each an error and its Jacobian."""
