"""`optiplan new`: a first problem after a few questions; `optiplan schema`: the schema for editors."""

import json
import os
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from optiplan.cli.completion import robot_names
from optiplan.cli.options import numbers
from optiplan.cli.output import Exit, results
from optiplan.errors import InputError, Issue
from optiplan.files import write_text

SCHEMA = "problem.schema.json"
"""Name of the schema that is written beside a new problem."""


def schema(
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="write it there; to standard output without")] = None,
) -> int:
    """Print the JSON schema of a problem file: editors complete, explain and check YAML by it.

    A first line [cyan]# yaml-language-server: $schema=problem.schema.json[/] tells an editor which file has it.

    [bold]Example[/]

      optiplan schema --out problem.schema.json
    """
    from optiplan.problem.schema.problem import problem_schema

    text = json.dumps(problem_schema(), indent=1, ensure_ascii=False) + "\n"
    if out is None:
        sys.stdout.write(text)
    else:
        write_text(out, text)
    return 0


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.yaml", help="the problem to write")],
    robot: Annotated[
        str, typer.Option(metavar="NAME", help="a bundled robot, or a robot.yaml", autocompletion=robot_names)
    ] = "",
    goal: Annotated[str, typer.Option(metavar="X,Y,Z", help="where the tool should go, m")] = "",
    yes: Annotated[bool, typer.Option("--yes", help="ask nothing: take what is proposed")] = False,
) -> int:
    """Ask for a robot and a goal, and write a first problem, with the schema for editors beside it.

    The proposed goal is one that the robot reaches; one out of reach is refused. The tool keeps the orientation that it
    has at the start; where that leaves an arm no other point, the goal is a configuration.

    [bold]Examples[/]

      optiplan new first.yaml

      optiplan new first.yaml --robot ur5 --goal 0.4,0.2,0.5

    Exit code: 0 written · 2 the file exists, or an answer is wrong.
    """
    from optiplan.cli.first_problem import first_problem, proposed_goal, reached, start_of
    from optiplan.robot.robot import load_robot

    if file.exists():
        raise InputError([Issue(str(file), None, "file", "a file that exists", "a name that is not taken")])
    ask = not yes and sys.stdin.isatty()
    chosen = robot or (typer.prompt("Robot (optiplan robots lists them)", default="panda") if ask else "panda")
    loaded = load_robot(chosen)
    start = start_of(loaded)
    proposed = proposed_goal(loaded, start)
    offered = "" if proposed is None else ",".join(f"{x:g}" for x in proposed)
    said = goal or (
        typer.prompt("Where should the tool go? x,y,z in m", default=offered) if ask and offered else offered
    )
    point = _point(said) if said else None
    if point is not None and said != offered and (missed := reached(loaded, start, point)).nearest is not None:
        other = f"such as {offered}" if offered else "or none, for a configuration as the goal"
        expected = f"a point that the tool reaches as it is turned at the start, {other}"
        raise InputError([Issue("new", None, "--goal", f"'{said}': {missed.reason}", expected)])
    reference = str(loaded.reference.robot)  # a name, or the path of the robot.yaml, which stands relative to the file
    name = chosen if reference == chosen else os.path.relpath(reference, file.parent.resolve())
    text = first_problem(loaded, name, start, point, file.stem, SCHEMA)
    if not (beside := file.parent / SCHEMA).exists():
        schema(beside)
    write_text(file, text)
    name = escape(str(file))
    results().print(f"written: {name}; next: [cyan]optiplan plan {name} --view[/]", soft_wrap=True)
    return Exit.VERIFIED


def _point(said: str) -> list[float]:
    values = numbers(said)
    if len(values) != 3 or not all(abs(x) < 1e6 for x in values):
        raise InputError(
            [Issue("new", None, "--goal", f"'{said}'", "three numbers with commas between them: X,Y,Z, m")]
        )
    return values
