"""Locate robots, problems and control files: beside the package in a checkout, inside it once installed."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def robots_dir() -> Path:
    """Folder of the robots, one folder each with a `robot.yaml`."""
    return _data_dir("robots")


def problems_dir() -> Path:
    """Folder of the numbered example problems."""
    return _data_dir("problems")


def control_dir() -> Path:
    """Folder of the example control files."""
    return _data_dir("control")


def _data_dir(name: str) -> Path:
    """The checkout's folder where there is one (an installed package has no pyproject.toml beside it)."""
    checkout = PACKAGE.parent
    return checkout / name if (checkout / "pyproject.toml").is_file() else PACKAGE / "_data" / name
