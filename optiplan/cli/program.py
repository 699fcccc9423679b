"""The commands of the program, and where they are."""

from importlib import import_module
from typing import Annotated

import typer

import optiplan
from optiplan.cli.output import results

HELP = """One YAML file in, one trajectory out that is [bold]proved[/] collision-free and within limits.

Try [cyan]optiplan plan 01_reach[/], then [cyan]optiplan plan 02_shelf --view[/]: both are bundled examples.
Every command takes --help.

Exit codes: 0 verified · 2 bad input · 3 no plan found within the budget · 4 found but not verified.
"""

COMMANDS = {
    "plan": "plan.plan",
    "verify": "verify.verify",
    "bound": "bound.bound",
    "view": "view.view",
    "export": "export.export",
    "plot": "plot.plot",
    "check": "check.check",
    "new": "new.new",
    "schema": "new.schema",
    "run": "run.run",
    "control": "control.control",
    "workspace": "workspace.workspace",
    "place": "studies.place.place",
    "assign": "studies.assign.assign",
    "design": "studies.design.design",
    "robots": "robots.app.app",
    "ik": "ik.ik",
    "kinematics": "kinematics.kinematics",
    "planners": "planners.planners",
    "import": "import_problems.app",
    "bench": "bench.app.app",
    "serve": "serve.serve",
    "worker": "serve.worker",
    "mcp": "mcp.mcp",
}
"""Module in `optiplan.cli.commands` and the function in it, or the `Typer` with commands of its own; as --help lists
them."""


def program(only: str | None = None) -> typer.Typer:
    """Return the program; with the name of a command, the program of that command alone, which is made sooner."""
    app = typer.Typer(
        name="optiplan",
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(help=HELP)(_before_commands)
    for name, place in COMMANDS.items():
        if only in COMMANDS and name != only:
            continue
        module, _, attribute = place.rpartition(".")
        command = getattr(import_module(f"optiplan.cli.commands.{module}"), attribute)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        else:
            app.command(name)(command)
    return app


def _version(wanted: bool) -> None:
    if wanted:
        results().print(f"optiplan {optiplan.__version__}")
        raise typer.Exit


def _before_commands(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Take the options that stand before the command."""
