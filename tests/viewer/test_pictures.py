"""The script that makes the pictures of the README and the documentation still does."""

import importlib.util
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from optiplan.viewer.pictures import browser_program

ROOT = Path(__file__).parent.parent.parent
PICTURES = ROOT / "docs" / "pictures"


@pytest.fixture
def make(tmp_path, monkeypatch):
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if browser_program() is None:
        if os.environ.get("CI"):
            pytest.fail("no chromium on this machine; CI must install it")
        pytest.skip("no chromium on this machine")
    spec = importlib.util.spec_from_file_location("make_pictures", PICTURES / "make.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "HERE", tmp_path)
    return module


def pixels(path):
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), dtype=float)


def test_failure_is_drawn_as_stored(make, tmp_path):
    """The robot where it touches is red; the stored picture is of the same motion, from the same place."""
    with ThreadPoolExecutor(1) as thread:  # where no loop of playwright's runs yet
        thread.submit(make.failure).result()
    drawn, stored = pixels(tmp_path / "failure.png"), pixels(PICTURES / "failure.png")
    red = (drawn[..., 0] > 150) & (drawn[..., 1] < 110) & (drawn[..., 2] < 110)
    assert red.mean() > 0.01
    assert drawn.shape == stored.shape == (800, 1280, 3)
    assert np.abs(drawn - stored).mean() < 6.0  # fonts and renderers differ a little between machines


def test_moving_picture_moves_and_is_small():
    from PIL import Image

    picture = PICTURES / "shelf.webp"
    assert picture.stat().st_size <= 3_000_000
    with Image.open(picture) as image:
        assert image.is_animated
        assert image.n_frames >= 40
        assert image.size == (800, 500)
        assert image.info["loop"] == 0
