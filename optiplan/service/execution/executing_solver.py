"""A solver process that moves a robot: when the server ends, however that happens, it has time for a proved stop."""

from optiplan.service.execution import solver

RESPITE = 3.0
"""s, from the end of the line to the server."""


def main() -> None:
    """See `solver.main`."""
    solver.main(RESPITE)
