"""The changes of docs/how-to/adding.md work: applied to a copy of the package, used there, tested, and taken back."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SECTION = re.compile(r"^## (?P<title>.+?)\n(?P<body>.*?)(?=^## |\Z)", re.DOTALL | re.MULTILINE)
BLOCK = re.compile(r"```(?P<language>\w+)\n(?P<text>.*?)```", re.DOTALL)
COPIED, LINKED = ("optiplan", "tests", "pyproject.toml"), ("robots", "problems", "control", "docs", "benchmarks")
ONLY_THE_COPY = """\
import sys

sys.meta_path[:] = [one for one in sys.meta_path if "editable" not in type(one).__module__]
"""
"""Written as sitecustomize.py: an editable installation finds the checkout before it looks into the copy."""
RUN = """\
import sys

import pytest

import optiplan

assert optiplan.__file__.startswith(sys.argv[1]), optiplan.__file__
exec(compile(sys.argv[2], "how-to/adding.md", "exec"), {})
sys.exit(pytest.main(["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", *sys.argv[3:]]))
"""


@dataclass(frozen=True)
class Change:
    """A section of the page: the change, code that uses it, and arguments of pytest."""

    diff: str
    use: str
    tests: tuple[str, ...]

    def without(self, path: str) -> str:
        """The change but for what it does to one file."""
        parts = re.split(r"(?m)^(?=diff --git )", self.diff)
        kept = [part for part in parts if f" b/{path}\n" not in part]
        assert len(kept) == len(parts) - 1, f"the change has no {path}"
        return "".join(kept)


def changes() -> dict[str, Change]:
    """The sections of the page by title."""
    found = {}
    for section in SECTION.finditer((ROOT / "docs" / "how-to" / "adding.md").read_text("utf-8")):
        blocks = {block["language"]: block["text"] for block in BLOCK.finditer(section["body"])}
        tests = shlex.split(blocks["sh"].removeprefix("python -m pytest "))
        found[section["title"]] = Change(blocks["diff"], blocks.get("python", ""), tuple(tests))
    return found


CHANGES = changes()


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    """A copy of the package and its tests, with the native core in place."""
    folder = tmp_path_factory.mktemp("package")
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name)
        else:
            shutil.copy2(ROOT / name, folder / name)
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)
    (folder / "sitecustomize.py").write_text(ONLY_THE_COPY)
    return folder


@pytest.fixture
def tried(copy):
    """Apply a change, use and test it: the finished process. Afterwards the change is taken back."""
    applied = []

    def apply(diff: str, *options: str) -> None:
        command = ["git", "apply", *options]
        done = subprocess.run(command, cwd=copy, input=diff, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"docs/how-to/adding.md no longer fits the code: mend its diff\n{done.stderr}"

    def attempt(diff: str, use: str, tests: tuple[str, ...]) -> subprocess.CompletedProcess[str]:
        apply(diff)
        applied.append(diff)
        command = [sys.executable, "-c", RUN, str(copy), use, *tests]
        environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, text=True, check=False, timeout=250
        )

    yield attempt
    for diff in applied:
        apply(diff, "--reverse")


@pytest.mark.parametrize("title", CHANGES)
def test_the_change_works_and_passes_the_tests_of_its_kind(title, tried):
    change = CHANGES[title]
    done = tried(change.diff, change.use, change.tests)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\d+ (?:passed|skipped)", done.stdout), "no test was selected"


@pytest.mark.parametrize(
    ("title", "forgotten"),
    [
        ("A path constraint", "optiplan/problem/constraints/measures.py"),
        ("An objective", "optiplan/planners/trajopt/terms/integrals.py"),
        ("A shape", "tests/geometry/test_shapes.py"),
    ],
)
def test_a_forgotten_file_is_noticed(title, forgotten, tried):
    change = CHANGES[title]
    done = tried(change.without(forgotten), "", change.tests)
    assert done.returncode == 1, done.stdout + done.stderr
    assert " failed" in done.stdout


def test_contributing_names_every_section():
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    named = set(re.findall(r"docs/how-to/adding\.md#([\w-]+)", text))
    assert named == {title.lower().replace(" ", "-") for title in CHANGES}
