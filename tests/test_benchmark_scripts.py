"""Every script of `benchmarks/` starts: it finds what it imports, and `--help` says what it is for."""

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LIBRARIES = {"asked.py", "published.py", "service_outages.py", "service_process.py"}
"""Modules that scripts import, not scripts."""
SCRIPTS = sorted(
    str(path.relative_to(ROOT / "benchmarks"))
    for folder in ("", "demonstrations")
    for path in (ROOT / "benchmarks" / folder).glob("*.py")
    if path.name not in LIBRARIES
)
START = """
import contextlib, io, json, os, runpy, sys, traceback
answers, folder, scripts, path = {}, sys.argv[1], sys.argv[2:], [*sys.path]
for script in scripts:
    own = os.path.dirname(f"{folder}/{script}")  # Python finds modules beside a script
    sys.argv, sys.path[:], printed = [script, "--help"], [own, *path], io.StringIO()
    try:
        with contextlib.redirect_stdout(printed):
            runpy.run_path(f"{folder}/{script}", run_name="__main__")
        ended = "it went on after --help"
    except SystemExit as stop:
        ended = stop.code
    except BaseException:
        ended = traceback.format_exc()
    answers[script] = [ended, printed.getvalue()]
print(json.dumps(answers))
"""


@pytest.fixture(scope="module")
def answers():
    """Of `--help`: (exit code or traceback, what was printed), by script; one process, which imports libraries once."""
    command = [sys.executable, "-c", START, str(ROOT / "benchmarks"), *SCRIPTS]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    return json.loads(ended.stdout.splitlines()[-1])


@pytest.mark.parametrize("script", SCRIPTS)
def test_help_says_what_it_is_for(answers, script):
    code, printed = answers[script]
    assert code == 0, code
    first_line = (ROOT / "benchmarks" / script).read_text().split('"""')[1].splitlines()[0]
    assert first_line[:40] in " ".join(printed.split())


def test_percentiles_take_problems_that_count_as_infinitely_long(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    from published import percentiles

    assert percentiles([1.0, None, 2.0, math.inf, math.inf], 25, 50, 95) == [1.0, 2.0, math.inf]
    assert percentiles([1.0, 2.0], 50) == [1.5]


def test_runs_without_a_budget_are_not_continued(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    from pose_goals import recorded

    file = tmp_path / "runs.jsonl"
    file.write_text("{}\n")
    with pytest.raises(SystemExit, match="runs with --budget unknown; expected 1, or another file"):
        recorded(argparse.Namespace(resume=True, results=file, budget=1.0))
