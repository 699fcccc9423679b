"""The pages: the tutorial does what it says, every public name is in the reference, links and tables hold."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
from ruamel.yaml import YAML

import optiplan as op
from tests.test_layers import GROUND, ROOMS

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
TUTORIAL = sorted((DOCS / "tutorial").glob("*.md"))
RUN = [*TUTORIAL, *(DOCS / "how-to" / f"{name}.md" for name in ("retime", "replanning", "outside-planner"))]
BLOCK = re.compile(
    r"(?:<!-- (?P<mark>[^>]*) -->\n)?```(?P<language>\w+)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)```", re.DOTALL
)
PROGRAM = f'#!/bin/sh\nexec "{sys.executable}" -c "from optiplan.cli.main import main; main()" "$@"\n'


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, and what the comment before it says: `not run: …` or `exit code N`."""

    language: str
    title: str
    text: str
    mark: str

    @property
    def is_run(self) -> bool:
        return not self.mark.startswith("not run: ")

    @property
    def exit_code(self) -> int:
        return int(self.mark.removeprefix("exit code ")) if self.mark.startswith("exit code ") else 0


def blocks(page: Path) -> list[Block]:
    found = [match.groupdict(default="") for match in BLOCK.finditer(page.read_text(encoding="utf-8"))]
    return [Block(each["language"], each["title"], each["text"], each["mark"]) for each in found]


def without_numbers(text: str) -> set[str]:
    """The lines of an output, numbers masked and spaces folded."""
    return {" ".join(re.sub(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", "#", line).split()) for line in text.splitlines()}


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_page_runs(page, tmp_path, monkeypatch):
    """Every file is written, every shell block ends with its exit code, the Python blocks run in one namespace.

    What a page shows as output is printed by the commands above it, up to the numbers.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "optiplan"
    program.write_text(PROGRAM)
    program.chmod(0o755)
    search = os.pathsep.join([str(tmp_path / "bin"), os.environ["PATH"]])
    python = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    names: dict[str, object] = {}
    printed: set[str] = set()
    for block in blocks(page):
        if block.title:
            Path(block.title).write_text(block.text)
        elif block.language == "sh" and block.is_run:
            text = block.text.replace("PYTHONPATH=.", f'PYTHONPATH=".:{python}"')
            command = ["bash", "-euo", "pipefail", "-c", text]
            environment = {**os.environ, "PATH": search, "PYTHONPATH": python, "COLUMNS": "200"}
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=200)
            assert done.returncode == block.exit_code, f"{block.text}\n{done.stdout}\n{done.stderr}"
            printed |= without_numbers(done.stdout + done.stderr)
        elif block.language == "text":
            assert without_numbers(block.text) <= printed
        elif block.language == "python" and block.is_run:
            exec(compile(block.text, page.name, "exec"), names)


def test_tutorial_says_what_it_does_not_run():
    marks = {block.mark for page in TUTORIAL for block in blocks(page) if block.mark}
    assert all(re.fullmatch(r"exit code [0-4]|not run: .+", mark) for mark in marks), marks
    assert len([mark for mark in marks if mark.startswith("not run: ")]) <= 2  # installing, and serving until Ctrl-C


@pytest.mark.parametrize("page", sorted((DOCS / "how-to").glob("*.md")), ids=lambda page: page.stem)
def test_blocks_of_the_how_tos_can_be_read(page):
    imported = set()
    for block in blocks(page):
        if block.language == "python":
            compile(block.text, page.name, "exec")
            imported |= set(re.findall(r"import .*\b(op|np)$", block.text, re.MULTILINE))
            assert set(re.findall(r"\b(op|np)\.", block.text)) <= imported, block.text
        elif block.language == "yaml":
            list(YAML(typ="safe").load_all(block.text))


def test_every_public_name_is_in_the_reference():
    """`optiplan.__all__` and the directives of the pages are the same names, each once."""
    text = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "reference").glob("python*.md"))
    documented = re.findall(r"^::: optiplan\.(?:\w+\.)*(\w+)$", text, re.MULTILINE)
    assert sorted(documented) == sorted(set(op.__all__) - {"__version__"})
    headed = re.findall(r"^::: ([\w.]+)\n +options: {heading: optiplan\.(\w+), toc_label: (\w+)}$", text, re.MULTILINE)
    assert headed
    assert all(name.split(".")[-1] == heading == label for name, heading, label in headed)
    assert "optiplan.__version__" in text


def test_pages_of_the_rooms_name_modules_that_are_there():
    for page in (DOCS / "reference" / "rooms").glob("*.md"):
        for name in re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.MULTILINE):
            assert ROOT.joinpath(*name.split(".")).with_suffix(".py").exists(), f"{page.name}: {name}"


@pytest.mark.parametrize(
    "page",
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_links_lead_somewhere(page):
    made = {
        "contributing.md",
        "benchmarks.md",
        "peers.md",
        "changelog.md",
        "examples.md",
        "command-line.md",
        "control-files.md",
        "planners.md",
        "problems.md",
    }
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
        name = Path(target).name
        by_the_site = (
            name in made or name.startswith("benchmarks-") or target.startswith(("../live/", "../seeds/"))
        )  # pages that play, made with the site
        if "://" not in target and not (DOCS in page.parents and by_the_site):
            assert (page.parent / target).exists(), target


def test_the_table_of_the_readme_is_measured():
    """Its rows stand word for word in the page of the benchmarks."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    table = text[text.index("| planner |") :].split("\n\n")[0]
    rows = [line for line in table.splitlines() if line.startswith("| ")]
    measured = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(rows) >= 5
    assert set(rows) <= set(measured)


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 90
    assert re.findall(r"make (?:demo|test) ", text) == ["make demo ", "make test "]


def test_the_causes_in_the_readme_are_kinds_of_failures():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    table = text[text.index("| cause |") :].split("\n\n")[0]
    causes = {cause for line in table.splitlines() for cause in re.findall(r"`([a-z-]+)`", line.split("|")[1])}
    assert len(causes) >= 8
    assert causes <= set(get_args(get_type_hints(op.Failure)["kind"]))


def test_kinds_of_failures_are_explained():
    """Kinds that `Failure` names stand in the tutorial; `input` and `bug` are told of comparisons, not of a plan."""
    kinds = set(get_args(get_type_hints(op.Failure)["kind"])) or set(
        re.findall(r"`([a-z-]+)`", (op.Failure.__doc__ or "").split("detail:")[0])
    )
    told = (DOCS / "tutorial" / "when-it-fails.md").read_text(encoding="utf-8")
    assert "no-path" in kinds
    assert {kind for kind in kinds if f"`{kind}`" not in told} <= {"cancelled", "input", "bug"}


def test_the_architecture_names_every_room_at_its_level():
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    for level, rooms in enumerate(ROOMS, 1):
        row = next(line for line in text.splitlines() if line.startswith(f"| {level} | "))
        assert {f"`{room}/`" for room in rooms} <= set(re.findall(r"`\w+/`", row.split("|")[2]))
    assert all(f"`{name}" in text for name in GROUND)


def test_citation():
    cited = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    assert cited["version"] == op.__version__
    assert cited["license"] == "BSD-3-Clause"
