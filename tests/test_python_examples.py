"""Every script of `examples/` runs from an empty folder, and so does its notebook; each says what it shows."""

import ast
import importlib.util
import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SCRIPTS = sorted((ROOT / "examples").glob("[0-9]*.py"))
NOTEBOOK = ROOT / "examples" / "notebook.ipynb"
LESSONS = sorted((ROOT / "examples" / "lessons").glob("*.ipynb"))
SHOWS = {
    "c_shaped_link": "joint 1 at    0°: joint 2 touches nothing",
    "lspb_bounds": "c: V 0.0200, t_b -32.0000 s",
    "mecanum_base": "hands (1, 1, 1, 1): rank 2",
    "sclerp_corrected": "J1_printed  does not arrive",
    "wrist_singularity": "null motion of the joints: [ 0.  0.  0.  1.  0. -1.]",
}
"""What each lesson finds, by its name; the rest it asserts itself."""
SECONDS = 120
"""For one of them; each takes a tenth of that where nothing else runs."""

SAYS = {
    "01": "Run: verified",
    "02": "proved clearance: ",
    "03": "Run: verified",
    "04": "the motion is not free",
    "05": "refused for velocity",
    "06": "velocity: ",
    "07": "(the old motion: refused)",
    "08": "off the line",
    "09": "large-circle, circle",
    "10": "trajopt     Run: verified",
    "11": "the tool is ",
    "12": "on the way: Run: verified",
    "13": ", limit -0.999; holds at",
    "14": "step 2: attach cube",
    "15": "in the end: Run: verified",
    "16": "end 1: Run: verified",
    "17": "behind the ball in",
    "18": "0 touched",
    "19": "the process of the simulation ended by signal 9",
    "20": "from the optimum, proved",
}
"""A part of what each prints, by its number."""

BY_THEMSELVES = ("01", "16", "17", "18", "19")
"""The first, and those that begin processes, which look for the script; a process takes a second to begin."""


def test_they_are_numbered_from_one():
    assert [path.name[:3] for path in SCRIPTS] == [f"{number:02}_" for number in range(1, 21)]


def test_the_first_is_the_smallest():
    lines = [len(path.read_text().splitlines()) for path in SCRIPTS]
    assert lines[0] == min(lines) <= 15


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_says_what_it_shows_and_how_to_run_it(path):
    told = ast.get_docstring(ast.parse(path.read_text()))
    assert told is not None
    assert told.splitlines()[0].endswith(".")
    assert f"Run it: python examples/{path.name}" in told


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_uses_the_front_door_alone(path):
    """A reader needs to know one import of ours."""
    imported = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Import | ast.ImportFrom)]
    ours = [ast.unparse(node) for node in imported if "optiplan" in ast.unparse(node)]
    assert ours == ["import optiplan as op"]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_runs(path, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    if path.name[:2] in BY_THEMSELVES:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
        ended = subprocess.run([sys.executable, str(path)], env=environment, timeout=SECONDS, check=False)
        assert ended.returncode == 0, capfd.readouterr().err
    else:
        monkeypatch.setattr(sys, "argv", [str(path)])
        runpy.run_path(str(path), run_name="__main__")
    assert SAYS[path.name[:2]] in capfd.readouterr().out
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def runner():
    spec = importlib.util.spec_from_file_location("run_notebook", ROOT / "examples" / "run_notebook.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_notebook_runs(runner, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notebook = json.loads(NOTEBOOK.read_text("utf-8"))
    stored = [kinds(cell) for cell in notebook["cells"]]
    names = runner.run_cells(notebook)
    assert names["run"].verified
    assert [kinds(cell) for cell in notebook["cells"]] == stored
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_lessons_run_and_show_what_is_stored(runner, path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notebook = json.loads(path.read_text("utf-8"))
    assert len(path.read_text("utf-8")) < 100_000
    stored = [kinds(cell) for cell in notebook["cells"]]
    runner.run_cells(notebook)
    assert [kinds(cell) for cell in notebook["cells"]] == stored
    printed = [text for cell in notebook["cells"] for out in cell.get("outputs", []) for text in out.get("text", [])]
    assert SHOWS[path.stem] in "".join(printed)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_cell_is_not_passed_over(runner):
    cells = [{"cell_type": "code", "source": [line]} for line in ("x = 1\n", "x / 0")]
    with pytest.raises(ZeroDivisionError):
        runner.run_cells({"cells": cells})


def test_stored_notebook_is_small_and_begins_with_words():
    text = NOTEBOOK.read_text("utf-8")
    notebook = json.loads(text)
    assert len(text) < 100_000
    assert (notebook["nbformat"], notebook["cells"][0]["cell_type"]) == (4, "markdown")


def kinds(cell):
    """What kinds of output a cell has."""
    return [sorted(output.get("data", {"text": 0})) for output in cell.get("outputs", [])]
