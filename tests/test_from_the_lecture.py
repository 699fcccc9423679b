"""docs/how-to/from-the-lecture.md: every line of the page runs, in the order of the page and in one folder."""

import re
import shlex
from pathlib import Path

import pytest

from optiplan.cli.main import run

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "from-the-lecture.md"
TEXT = PAGE.read_text(encoding="utf-8")


def lines(text: str) -> list[str]:
    """Commands and Python of the page: its blocks, and what stands as code in the last column of its tables."""
    found: list[str] = []
    for k, part in enumerate(re.split(r"^```", text, flags=re.MULTILINE)):
        if k % 2:
            language, _, code = part.partition("\n")
            found += code.splitlines() if language == "sh" else [code]
        else:
            for row in re.findall(r"^\|.* \| (.*) \|$", part, re.MULTILINE):
                found += re.findall(r"`([^`]+)`", row)
    return [line for line in found if line not in WORDS]


WORDS = {"dh:"}
"""Code in a table that is a word of a file."""
LINES = lines(TEXT)
COMMANDS = [line for line in LINES if line.startswith("optiplan ")]
PYTHON = [line for line in LINES if not line.startswith("optiplan ")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("page")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_of_the_page_runs(command, folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    assert run(shlex.split(command)[1:]) == 0, capfd.readouterr().err


def test_every_line_of_python_runs(folder, monkeypatch):
    """After the commands, one of which writes the run that is read."""
    monkeypatch.chdir(folder)
    names: dict[str, object] = {}
    for code in PYTHON:
        if code == PYTHON[0] or "motion =" in code:
            exec(compile(code, PAGE.name, "exec"), names)
        else:
            result = eval(compile(f"({code})", PAGE.name, "eval"), names)
            assert result is not None, code


def test_the_words_of_the_lecture_and_the_toolbox_are_there():
    asked = "tpoly lspb jtraj ctraj mstraj fkine ikine jacob0 jacobe vellipse fellipse manipulability maniplty trinterp"
    for word in [*asked.split(), "tr2rpy", "eul2tr", "teach", "plot", "repeatability", "DualQuaternion", "Mecanum"]:
        assert word in TEXT, word
    assert len(COMMANDS) >= 30
    assert len(PYTHON) >= 30


def test_the_whole_page_was_found():
    """Nothing in a table's last column is left out but words of files and other pages."""
    assert TEXT.count("```") == 6
    assert all(name in "".join(LINES) for name in ("puma.html", "repeatability(", "Rotation.from_euler"))
