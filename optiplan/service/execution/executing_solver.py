"""A solver process that moves a robot: when the server ends, however that happens, it has time for a proved stop."""

from optiplan.bench.execution.keeper import RESPITE
from optiplan.service.execution import solver


def main() -> None:
    """See `solver.main`."""
    solver.main(RESPITE)
