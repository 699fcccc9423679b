"""Shared by all tests: reproducible hypothesis runs, data sets that lie beside the checkout where there are any."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

from tests.viewer.browsing import browser  # noqa: F401  # one for all: a process runs playwright's loop once

settings.register_profile("suite", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("suite")

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of optional test data: $OPTIPLAN_SHARED, by default `../shared` beside the checkout."""
    folder = Path(os.environ.get("OPTIPLAN_SHARED", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip(f"no test data in {folder}")
    return folder


@pytest.fixture(scope="session")
def problems() -> Path:
    """Folder of the numbered examples."""
    return ROOT / "problems"
