"""Every example of `problems/` ends verified, and the README says what is true."""

import re
from pathlib import Path

import pytest

from optiplan.problem.load import load_problem
from tests.planned import planned_until

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "problems").glob("*.yaml"))


def test_there_are_a_dozen_numbered_from_one():
    assert len(EXAMPLES) >= 12
    assert [int(path.stem.split("_")[0]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))


def test_the_first_is_the_smallest():
    lines = [len(path.read_text().splitlines()) for path in EXAMPLES]
    assert lines[0] == min(lines) <= 12


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_verified(path, example):
    result = example(path.stem)
    assert result.failure is None, result.failure
    assert result.verified, [check for check in result.report.failures]
    assert result.ratio is None or result.ratio >= 1.0 - 1e-9  # None: a circle ends where it begins


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_says_what_it_shows(path):
    assert path.read_text().startswith("# ")


def snippets(language):
    text = (ROOT / "README.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.parametrize("code", snippets("python"))
def test_readme_python_runs(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})


@pytest.mark.parametrize("text", [text for text in snippets("yaml") if "start:" in text])
def test_readme_problem_can_be_planned(text, tmp_path):
    path = tmp_path / "problem.yaml"
    path.write_text(text)
    problem = load_problem(path)
    assert planned_until(problem, problem.planner, 60.0).verified
