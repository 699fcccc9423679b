"""Pages of the site that are made of something else: the changelog, the benchmarks, commands, planners, examples.

MkDocs calls `on_files` before it reads the pages (`hooks:` in mkdocs.yml). What is made here cannot become stale: the
commands are those of the program, the planners those of the registry, the examples the files themselves.
"""

import ast
import re
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any

import typer
from markdown.extensions.toc import slugify
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from optiplan.cli.program import program
from optiplan.planners.registry import FAMILIES, PLANNERS

ROOT = Path(__file__).parent.parent
FIGURES = ROOT / "benchmarks" / "figures"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that no file of docs/ holds."""
    pages = {
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(),
        "contributing.md": moved((ROOT / "CONTRIBUTING.md").read_text()),
        **benchmarks(moved((ROOT / "benchmarks" / "README.md").read_text())),
        "peers.md": moved((ROOT / "benchmarks" / "peers" / "README.md").read_text()),
        "reference/command-line.md": command_line(),
        "reference/planners.md": planners(),
        "reference/problems.md": problems(),
        "reference/control-files.md": control_files(),
        "examples.md": examples(),
    }
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    for figure in sorted(FIGURES.glob("*.svg")):
        files.append(File.generated(config, f"figures/{figure.name}", abs_src_path=str(figure)))
    return files


BENCHMARKS = {
    "problems": (
        "Problems and planners",
        ("MotionBenchMaker", "Every planner", "Shipped examples", "Robots that nobody prepared"),
    ),
    "execution": ("Execution", ("Planned, then executed", "Execution", "Action chunks", "Three kilograms")),
    "control": ("Control and kinematics", ("The controller", "Solvers of", "Inverse kinematics", "The symbolic twin")),
    "others": ("Beside others", ("Beside others", "A report of", "Peers in one run")),
    "planning": ("Budgets, replanning, ends", ("",)),
}
"""Pages of the benchmarks: a title, and how the headings of their sections begin; the last one takes what is left."""


def benchmarks(text: str) -> dict[str, str]:
    """The benchmarks as pages by their path: the first has what comes before all sections."""
    first, *sections = re.split(r"(?m)^(?=## )", text)
    where: dict[str, str] = {}
    content = {
        name: [f"# {title}\n\nEvery table names its command and its commit.\n\n"]
        for name, (title, _) in BENCHMARKS.items()
    }
    for section in sections:
        heading = section.partition("\n")[0].removeprefix("## ")
        name = next(name for name, (_, begins) in BENCHMARKS.items() if heading.startswith(begins))
        content[name].append(section)
        for title in re.findall(r"(?m)^##+ (.*)$", section):
            where[slugify(title, "-")] = f"benchmarks-{name}.md"
    listed = "".join(f"- [{title}](benchmarks-{name}.md)\n" for name, (title, _) in BENCHMARKS.items())
    pages = {"benchmarks.md": first.replace("\n| script |", f"\n{listed}\n| script |", 1)}
    pages |= {f"benchmarks-{name}.md": "".join(parts) for name, parts in content.items()}
    return {
        page: re.sub(r"\]\((?:benchmarks\.md)?#([\w-]+)\)", lambda link: f"]({where[link[1]]}#{link[1]})", text)
        for page, text in pages.items()
    }


def moved(text: str) -> str:
    """The text with links between files of the repository as links between pages."""
    pages = {
        r"(?:\.\./)*docs/(?=[\w/-]+\.(?:md|png))": "",
        r"(?:\.\./)?(?:benchmarks/)?peers/README\.md": "peers.md",
        r"(?:\.\./|benchmarks/)README\.md": "benchmarks.md",
        r"CONTRIBUTING\.md": "contributing.md",
        r"CHANGELOG\.md": "changelog.md",
    }
    for path, page in pages.items():
        text = re.sub(rf"\]\({path}", f"]({page}", text)
    return text


def command_line() -> str:
    """Every command with its arguments and options, as the program itself describes them."""
    text = [
        "# Command line",
        "",
        "With `--json` a command prints one JSON object on stdout and nothing else; messages go "
        "to stderr. What a command returns: [exit codes](exit-codes.md).",
        "",
    ]
    for words, command in commands(typer.main.get_command(program()), ()):
        text += [f"## optiplan {' '.join(words)}", "", *described(command.help or ""), *parameters(command), ""]
    return "\n".join(text)


def described(text: str) -> list[str]:
    """The paragraphs of a command's help; commands in it as one block of code."""
    lines: list[str] = []
    for paragraph in re.split(r"\n\s*\n", plain(text)):
        is_code = paragraph.lstrip().startswith("optiplan ")
        if is_code and lines[-2:] == ["```", ""]:
            lines[-2:] = [paragraph.strip(), "```", ""]
        else:
            lines += ["```sh", paragraph.strip(), "```", ""] if is_code else [" ".join(paragraph.split()), ""]
    return lines


def commands(group: Any, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The words that call it, and the command, of every command below a group and of a group that is one itself."""
    for name, command in group.commands.items():
        below = getattr(command, "commands", None)
        if below is None or command.invoke_without_command:
            yield (*words, name), command
        if below is not None:
            yield from commands(command, (*words, name))


def parameters(command: Any) -> list[str]:
    """A table of arguments and options, the hidden ones left out."""
    rows = ["| argument or option | meaning | default |", "|---|---|---|"]
    for parameter in command.params:
        if getattr(parameter, "hidden", False) or parameter.name == "help":
            continue
        is_option = parameter.param_type_name == "option"
        flag = getattr(parameter, "is_flag", False)
        kind = parameter.metavar or parameter.name.upper()
        name = ", ".join(parameter.opts) if is_option else kind
        name += f" {kind if parameter.metavar else parameter.type.name.upper()}" if is_option and not flag else ""
        default = parameter.default
        shown = (
            "required"
            if parameter.required
            else ""
            if default in (None, False, ()) or callable(default)
            else f"`{default}`"
        )
        rows.append(f"| `{name.replace('|', chr(92) + '|')}` | {cell(plain(parameter.help or ''))} | {cell(shown)} |")
    return rows if len(rows) > 2 else []


def planners() -> str:
    """Every planner with its options, as the registry has them."""
    text = [
        "# Planners and their options",
        "",
        "In a problem file: `planner: NAME`, or `planner: {name: NAME, option: value}`. Every planner takes the same "
        "problem, chooses among the same goal configurations, has the same budget and faces the same verifier.",
        "",
    ]
    for family in FAMILIES:
        text += [f"## {family[0].upper()}{family[1:]}", ""]
        for name, entry in PLANNERS.items():
            if entry.family == family:
                text += [
                    f"### {name}",
                    "",
                    f"{entry.summary[0].upper()}{entry.summary[1:]}.",
                    "",
                    "| option | type | default | meaning |",
                    "|---|---|---|---|",
                ]
                text += [
                    f"| `{o.name}` | {cell(o.kind)} | `{o.default}` | {cell(o.meaning)} |" for o in entry.option_list()
                ]
                text.append("")
    return "\n".join(text)


def problems() -> str:
    """The shipped problems, each with what its first line says that it shows."""
    intro = "They come with the program: `optiplan plan 01_reach` finds them anywhere. Each is verified by the tests."
    return shipped("problems", "Example problems", intro)


def control_files() -> str:
    """The shipped control files, likewise."""
    intro = "They come with the program: `optiplan control panda_shelf` finds them anywhere. Each is run by the tests."
    return shipped("control", "Example control files", intro)


def shipped(folder: str, title: str, intro: str) -> str:
    """The YAML files of a folder, each with what its first line says that it shows."""
    text = [f"# {title}", "", intro, "", "| file | what it shows |", "|---|---|"]
    for path in sorted((ROOT / folder).glob("*.yaml")):
        lines = path.read_text().splitlines()
        comment = " ".join(line.lstrip("# ") for line in takewhile(lambda line: line.startswith("#"), lines))
        text.append(f"| [`{path.stem}`](#{path.stem}) | {cell(comment)} |")
    for path in sorted((ROOT / folder).glob("*.yaml")):
        text += ["", f"## {path.stem}", "", "```yaml", path.read_text().rstrip("\n"), "```"]
    return "\n".join(text) + "\n"


def examples() -> str:
    """The numbered scripts of `examples/`, the shortest first."""
    text = [
        "# Examples in Python",
        "",
        "The scripts of the folder `examples/`, where a notebook lies beside them; each is run by the tests.",
        "",
    ]
    for path in sorted((ROOT / "examples").glob("[0-9]*.py")):
        code = path.read_text()
        summary = (ast.get_docstring(ast.parse(code)) or "").partition("\n")[0]
        text += [f"## {path.stem}", "", summary, "", "```python", code.rstrip("\n"), "```", ""]
    return "\n".join(text)


def plain(text: str) -> str:
    """Help without the marks of rich."""
    return re.sub(r"\[/?(?:bold|cyan|dim|[/])?\]", "", text)


def cell(text: str) -> str:
    """A text that a cell of a table can hold."""
    return text.replace("|", "\\|")
