"""Checks of a report."""

from optiplan.verify.report import Check, Report


def named(report: Report | None, name: str) -> Check:
    """Return the one check of that name."""
    assert report is not None
    (found,) = [check for check in report.checks if check.name == name]
    return found


def failed(report: Report) -> list[str]:
    """Return the names of the checks that failed."""
    return [check.name for check in report.failures]
