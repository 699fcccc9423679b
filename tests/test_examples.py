"""Every example of `problems/` ends verified, and the README says what is true."""

import re
import threading
from pathlib import Path

import pytest

from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "problems").glob("*.yaml"))
BUDGET = 120.0
"""Seconds, ten times what the slowest needs: a mere limit, as each run ends with its first verified answer."""

TO_THE_END = ("49_hand_over", "51_tool_changer")
"""Tasks whose steps are joined and optimised together as well: of two arms, and of one. They take what they need."""


class EndsWithAnAnswer:
    """Progress that ends the search once a motion is verified: planners would use what they are given for a better."""

    def __init__(self):
        self.answered = threading.Event()

    def __call__(self, stage, fraction):
        pass

    def proved(self, motion, seconds):
        self.answered.set()


def test_there_are_a_dozen_numbered_from_one():
    assert len(EXAMPLES) >= 12
    assert [int(path.stem.split("_")[0]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))


def test_the_first_is_the_smallest():
    lines = [len(path.read_text().splitlines()) for path in EXAMPLES]
    assert lines[0] == min(lines) <= 12


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_verified(path):
    problem = load_problem(path)
    progress = EndsWithAnAnswer()
    budget = Budget(BUDGET) if path.stem in TO_THE_END else Budget(BUDGET, progress.answered)
    result = run(problem, problem.planner, problem.options, budget, progress)
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
    assert load_problem(path).robot.name == "panda"
