"""`optiplan verify`: judge a trajectory again, whoever made it."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.completion import problem_names
from optiplan.cli.files import find_problem
from optiplan.cli.output import Exit, messages, print_json, results, stdout_is_ours


def verify(
    problem: Annotated[
        str,
        typer.Argument(
            metavar="PROBLEM", help="a problem file, or the name of an example", autocompletion=problem_names
        ),
    ],
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a run folder, or a trajectory.json")],
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")] = False,
) -> int:
    """Verify a stored trajectory against a problem, from nothing but these two.

    The trajectory may come from another program: `joint_names` and `pieces` are all that is read.

    [bold]Examples[/]

      optiplan verify 02_shelf runs/shelf

      optiplan verify cell.yaml elsewhere/trajectory.json --json

    Exit code: 0 verified · 2 bad input · 4 not verified.
    """
    from optiplan.cli.report import show_report
    from optiplan.problem.load import load_problem
    from optiplan.store import load_run
    from optiplan.verify.report import jsonable
    from optiplan.verify.verify import verify as judge

    path = find_problem(problem)
    stored = load_run(run)
    with stdout_is_ours():
        loaded = load_problem(path)
        report = None if stored.trajectory is None else judge(loaded, stored.trajectory)
    same = None if "hash" not in stored.record else stored.record["hash"] == loaded.hash
    if same is False:
        messages().print(
            f"note: the run was made from another problem ('{stored.record.get('name')}', another hash); "
            f"its motion is judged against {path}",
            style="yellow",
        )
    code = Exit.VERIFIED if report is not None and report.verified else Exit.NOT_VERIFIED
    if as_json:
        judged = None if report is None else report.to_dict()
        failure = stored.record.get("failure") if stored.trajectory is None else None
        verdict = {"verified": code == 0, "same_problem": same, "report": judged, "failure": failure}
        print_json(jsonable({**verdict, "exit_code": int(code)}))
    elif report is None:
        reason = (stored.record.get("failure") or {}).get("detail", "no reason given")
        results().print(f"not verified: the run has no trajectory ({reason})", style="red", markup=False)
    else:
        show_report(results(), report)
    return code
