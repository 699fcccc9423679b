"""`optiplan check`: report every issue of problem files at once."""

from typing import Annotated

import typer
from rich.markup import escape

from optiplan.cli.completion import problem_names
from optiplan.cli.options import AsJson
from optiplan.cli.output import Exit, print_error, print_json, results, stdout_is_ours
from optiplan.cli.progress import ProgressLine
from optiplan.errors import Issue


def check(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE…", help="problem files, or names of examples", autocompletion=problem_names),
    ],
    as_json: AsJson = False,
) -> int:
    """Find everything that is wrong with problem files: each issue with its file, line, and what would be valid.

    Checks keys, units and sizes, that robots and meshes exist, limits, that the start touches nothing, and that the
    planner's options go with start and goal.

    [bold]Example[/]

      optiplan check problems/*.yaml

    Exit code: 0 all can be planned · 2 something is wrong.
    """
    from optiplan.api.checking import check as issues_of

    found: dict[str, list[Issue]] = {}
    with stdout_is_ours(), ProgressLine() as progress:
        for file in files:
            progress(f"checking {file}", len(found) / len(files))
            found[file] = issues_of(file)
    bad = any(found.values())
    if as_json:
        rows = [{"file": file, "issues": [vars(issue) for issue in issues]} for file, issues in found.items()]
        print_json({"ok": not bad, "files": rows, "exit_code": int(Exit.BAD_INPUT if bad else 0)})
        return Exit.BAD_INPUT if bad else 0
    for file, issues in found.items():
        if not issues:
            results().print(f"{escape(file)}: [green]ok[/]", soft_wrap=True)
        for issue in issues:
            print_error(str(issue))
    return Exit.BAD_INPUT if bad else 0
