"""`optiplan bound`: how short a motion of a problem can be at best, proved."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.completion import problem_names
from optiplan.cli.options import AsJson
from optiplan.cli.output import Exit, print_json, results, stdout_is_ours
from optiplan.errors import InputError, Issue, errors_about
from optiplan.problem.examples import find_problem


def bound(
    file: Annotated[
        str,
        typer.Argument(metavar="FILE", help="a problem file, or the name of an example", autocompletion=problem_names),
    ],
    run: Annotated[
        Path | None, typer.Option(metavar="RUN", help="folder of a run of this problem: how near it is to the optimum")
    ] = None,
    budget: Annotated[float, typer.Option(metavar="SECONDS", help="wall time; the bound grows with it")] = 20.0,
    as_json: AsJson = False,
) -> int:
    """Prove how long any motion of a problem takes at least, obstacles included.

    Goals are values of joints. What a problem demands beside that and is not counted is named: with it motions can
    only be longer.

    [bold]Examples[/]

      optiplan bound 12_planar

      optiplan plan 12_planar --out runs/planar

      optiplan bound 12_planar --run runs/planar --budget 10

    Exit code: 0 proved · 2 bad input, or a problem without a known bound.
    """
    from optiplan.api.bounding import bound as bound_of_problem
    from optiplan.problem.load import load_problem
    from optiplan.runs.run_folder import load_run

    path = find_problem(file)
    with stdout_is_ours():
        problem = load_problem(path)
        motion = None if run is None else load_run(run, problem.robot.joint_names).trajectory
        if run is not None and motion is None:
            raise InputError([Issue(str(run), None, "run", "a run without a motion", "one with a motion, or no --run")])
        with errors_about("op.bound", str(path)):
            found = bound_of_problem(problem, budget, motion)
    duration = None if motion is None else motion.duration
    if as_json:
        gap = None if duration is None else found.gap(duration)
        print_json({**found.to_dict(), "duration": duration, "gap": gap, "exit_code": int(Exit.VERIFIED)})
        return Exit.VERIFIED
    results().print(found.words(duration), markup=False)
    console = results()
    if found.seconds > found.alone:
        names = ", ".join(found.joints)
        console.print(f"without obstacles {found.alone:.3f} s; with them over {names}", markup=False, style="dim")
    else:
        console.print("obstacles add nothing that could be proved in this time", markup=False, style="dim")
    if found.left_out:
        console.print(f"not counted: {', '.join(found.left_out)}", markup=False, style="dim")
    return Exit.VERIFIED
