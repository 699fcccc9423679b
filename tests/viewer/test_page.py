import json
import os
import re
from pathlib import Path

import pytest

from optiplan.errors import OptiPlanError
from optiplan.viewer import page
from optiplan.viewer.page import export_page, render_page
from optiplan.viewer.scene import build_scene


def test_page_is_whole_small_and_asks_for_nothing(shelf, motion, tmp_path):
    path = tmp_path / "new" / "page.html"
    export_page(shelf, [("quintic", motion(shelf), None)], path)
    text = path.read_text("utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert text.rstrip().endswith("</html>")
    assert len(text) < 10e6
    own = re.sub(r"<script>!function.*?</script>|/\*! For license.*?</script>", "", text, flags=re.DOTALL)
    assert not re.findall(r"""(?:src|href)=["'](?!data:)[^"']*["']""", own)
    assert os.listdir(path.parent) == ["page.html"]


def test_names_are_escaped_and_data_survives(shelf, motion):
    label = "</script><script>alert(1)</script>"
    text = render_page(build_scene(shelf, [(label, motion(shelf), None)]))
    assert "<b>shelf</b>" not in text
    assert "a &lt;b&gt;shelf&lt;/b&gt; &amp; &quot;more&quot;" in text
    assert label not in text
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)[1])
    assert (data["name"], data["runs"][0]["label"]) == (shelf.name, label)


def test_failed_export_leaves_the_old_file(shelf, tmp_path, monkeypatch):
    path = tmp_path / "page.html"
    path.write_text("old")

    def refuse(*_):
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(OSError, match="disk full"):
        export_page(shelf, [], path)
    assert os.listdir(tmp_path) == ["page.html"]
    assert path.read_text() == "old"


def test_missing_meshcat_is_a_clear_error(shelf, monkeypatch):
    monkeypatch.setattr(page, "find_spec", lambda name: None)
    with pytest.raises(OptiPlanError, match="needs the package meshcat"):
        render_page(build_scene(shelf, []))
