"""`optiplan robots`: the bundled robots, and what is known of any robot."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.commands.robots.init import init
from optiplan.cli.completion import robot_names
from optiplan.cli.options import AsJson
from optiplan.cli.output import plain_table, print_json, results, say, stdout_is_ours

app = typer.Typer(invoke_without_command=True)
app.command("init")(init)
Name = Annotated[
    str,
    typer.Argument(metavar="NAME", help="a bundled robot, or the path of a robot.yaml", autocompletion=robot_names),
]
Group = Annotated[str | None, typer.Option("--group", metavar="GROUP", help="one of the robot's groups of joints")]


@app.callback()
def robots(context: typer.Context, as_json: AsJson = False) -> int:
    """List the robots that come with OptiPlan, show one, write it for other programs, or make one from your URDF.

    A robot of your own: `robot: path/to/robot.yaml` in the problem file, with `version: 1`, `name:` and `urdf:` or
    `dh:` in it.

    [bold]Examples[/]

      optiplan robots

      optiplan robots show panda

      optiplan robots init my_arm.urdf
    """
    from optiplan.config.document import read_yaml, validate
    from optiplan.resources import robots_dir
    from optiplan.robot.robot import robot_names
    from optiplan.robot.spec import RobotSpec

    if context.invoked_subcommand is not None:
        context.obj = as_json  # `robots --json show` means the same as `robots show --json`
        return 0
    specs = {name: validate(RobotSpec, read_yaml(robots_dir() / name / "robot.yaml")) for name in robot_names()}
    if as_json:
        print_json({"robots": {name: spec.model_dump(mode="json", exclude_none=True) for name, spec in specs.items()}})
        return 0
    table = plain_table(("name", "groups", "tool frame", "configurations"))
    for name, spec in specs.items():
        table.add_row(
            name,
            ", ".join(spec.groups),
            spec.tool_frame or "last link",
            ", ".join((*spec.configurations, *spec.configurations_deg)),
        )
    results().print(table, markup=False)
    return 0


@app.command("show")
def show(context: typer.Context, name: Name, group: Group = None, as_json: AsJson = False) -> int:
    """Show joints, limits, the Denavit–Hartenberg table, frames, configurations and checked pairs of a robot.

    [bold]Examples[/]

      optiplan robots show srra

      optiplan robots show delbot --group arm

      optiplan robots show my/robot.yaml --json
    """
    from optiplan.cli.printing.robot_table import describe, show_robot
    from optiplan.robot.robot import load_robot

    with stdout_is_ours():
        robot = load_robot(name, group=group)
    data = describe(robot)
    if as_json or context.obj:
        print_json(data)
    else:
        show_robot(results(), data)
    return 0


@app.command("srdf")
def srdf(
    context: typer.Context,
    name: Name,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="the SRDF file to write")],
    as_json: AsJson = False,
) -> int:
    """Write the pairs of links that need no check as an SRDF file, for other programs or for `srdf:` of a robot.yaml.

    [bold]Example[/]

      optiplan robots srdf my/robot.yaml my/robot.srdf
    """
    from optiplan.files import write_text
    from optiplan.robot.robot import load_robot
    from optiplan.robot.self_collision.pairs import srdf_words
    from optiplan.robot.urdf.srdf import srdf_text

    with stdout_is_ours():
        robot = load_robot(name)
    write_text(out, srdf_text(robot.name, srdf_words(robot.allowed)))
    if as_json or context.obj:
        print_json({"written": str(out), "pairs": len(robot.allowed)})
        return 0
    say(f"pairs that need no check, written to {out}: {len(robot.allowed)}")
    return 0


@app.command("export")
def export(
    name: Name,
    out: Annotated[Path | None, typer.Argument(metavar="[OUT]", help="the file to write; without it, stdout")] = None,
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="urdf")] = "urdf",
) -> int:
    """Write a robot as a URDF, that of a Denavit–Hartenberg table included, with the limits it is planned with.

    [bold]Example[/]

      optiplan robots export srra --to urdf srra.urdf
    """
    from optiplan.errors import UnknownChoiceError
    from optiplan.files import write_text
    from optiplan.robot.robot import load_robot
    from optiplan.robot.urdf.export import export_urdf

    if to != "urdf":
        raise UnknownChoiceError("format", to, ["urdf"])
    with stdout_is_ours():
        robot = load_robot(name)
    text = export_urdf(robot)
    if out is None:
        results().out(text, end="", highlight=False)
    else:
        write_text(out, text)
        say(f"{robot.name} written to {out}")
    return 0
