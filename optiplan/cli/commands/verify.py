"""`optiplan verify`: verify a trajectory of any origin."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.completion import problem_names
from optiplan.cli.options import AsJson, Full
from optiplan.cli.output import Exit, print_json, results, stdout_is_ours
from optiplan.problem.examples import find_problem


def verify(
    problem: Annotated[
        str,
        typer.Argument(
            metavar="PROBLEM", help="a problem file, or the name of an example", autocompletion=problem_names
        ),
    ],
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="a run folder, a trajectory.json, or samples as JSON or CSV")
    ],
    as_json: AsJson = False,
    full: Full = False,
) -> int:
    """Verify a stored trajectory against a problem, from nothing but these two.

    The trajectory may come from another program: `joint_names` and `pieces` are the motion, and samples `t`, `q`, `v`,
    `a` beside them must be of it. Without pieces the samples are interpolated, and the report says how. A run folder
    must have been made from this very problem.

    [bold]Examples[/]

      optiplan verify 02_shelf runs/shelf

      optiplan verify cell.yaml elsewhere/trajectory.json --json

      optiplan verify cell.yaml samples.csv --full

    Exit code: 0 verified · 2 bad input · 4 not verified.
    """
    from optiplan.cli.printing.report import show_report
    from optiplan.problem.load import load_problem
    from optiplan.runs.run_folder import load_run
    from optiplan.runs.stored_runs import judged

    path = find_problem(problem)
    with stdout_is_ours():
        loaded = load_problem(path)
        stored = load_run(run, loaded.robot.joint_names)
        report = None if stored.trajectory is None else judged(loaded, stored)
    code = Exit.VERIFIED if report is not None and report.verified else Exit.NOT_VERIFIED
    if as_json:
        found = None if report is None else report.to_dict()
        failure = stored.record.get("failure") if stored.trajectory is None else None
        same = stored.record.get("hash") == loaded.hash if stored.record else None
        verdict = {"verified": code == 0, "same_problem": same, "report": found, "failure": failure}
        print_json({**verdict, "interpolation": stored.interpolation or None, "exit_code": int(code)})
    elif report is None:
        reason = (stored.record.get("failure") or {}).get("detail", "no reason given")
        results().print(f"not verified: the run has no trajectory ({reason})", style="red", markup=False)
    else:
        show_report(results(), report, full, f"{loaded.name} · {loaded.robot.name} · {run}")
    return code
