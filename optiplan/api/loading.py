"""`load_problem`, `load_robot`, `load_run`: problems, robots and runs from names, files and folders."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from optiplan.arrays import number_argument
from optiplan.errors import UnknownChoiceError, described, wrong_argument
from optiplan.problem import load
from optiplan.problem.examples import find_problem
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.robot import robot
from optiplan.robot.robot import Robot
from optiplan.runs.preparation import make_ready
from optiplan.runs.run import Run


def load_problem(source: Path | str | Mapping[str, Any], **overrides: Any) -> Problem:
    """A problem from a YAML file, the name of an example, or a mapping that says what a file would.

    Its planner is loaded as well, and its robot and scene are made ready, so that a plan begins with planning.

    Args:
        source: a path, the name of one of the examples such as `01_reach`, or the keys of a problem file; paths in a
            mapping are relative to the working directory.
        overrides: keys of a problem file that stand in for those of the source: `seed=3`, `planner="quintic"`.

    Raises:
        InputError: there is no such problem, or everything that is wrong with it, by file, line and field.

    Example:
        >>> import optiplan as op
        >>> op.load_problem("01_reach")
        Problem: reach, panda, to a configuration; empty
    """
    if isinstance(source, Mapping):
        problem = problem_from_dict({**source, **overrides})
    elif isinstance(source, str | Path):
        problem = load.load_problem(find_problem(str(source)), **overrides)
    else:
        expected = "the path of a problem file, the name of an example, or a mapping of the keys of a file"
        raise wrong_argument("load_problem", "source", described(source), expected)
    _make_ready(problem)
    return problem


def _make_ready(problem: Problem) -> None:
    """Load the problem's planner, and make what it would make first: not while somebody waits for a motion."""
    from optiplan.api import planning as _planning  # noqa: F401
    from optiplan.planners.registry import PLANNERS

    if problem.planner in PLANNERS:  # another one is loaded when it is called
        PLANNERS[problem.planner].load()
    make_ready(problem)


def load_robot(source: Path | str, *, group: str | None = None, locked: Mapping[str, float] | None = None) -> Robot:
    """A bundled robot by name, or one of your own by the path of its robot.yaml or URDF.

    Args:
        source: a name of `op.robots()` or a path.
        group: which group of the robot's joints to plan; None: that of the robot file.
        locked: where joints stand that are not planned, rad or m.

    Raises:
        InputError: there is no such robot or group, or a file of it cannot be used.

    Example:
        >>> import optiplan as op
        >>> op.load_robot("panda").n
        7
    """
    if not isinstance(source, str | Path):
        expected = "the name of a robot of op.robots(), or the path of a robot.yaml or URDF"
        raise wrong_argument("load_robot", "source", described(source), expected)
    if group is not None and not isinstance(group, str):
        raise wrong_argument("load_robot", "group", described(group), "the name of a group of its joints")
    if locked is not None and not isinstance(locked, Mapping):
        raise wrong_argument("load_robot", "locked", described(locked), "positions by joint, such as {'lift': 0.2}")
    for joint, q in (locked or {}).items():
        number_argument("load_robot", f"locked[{joint!r}]", q, "a finite number, rad or m")
    if Path(source).suffix.lower() == ".urdf":
        if group is not None:
            raise wrong_argument("load_robot", "group", f"'{group}'", "none, since a URDF alone has no groups")
        return Robot.from_urdf(source, locked=locked)
    try:
        return robot.load_robot(str(source), locked=locked, group=group)
    except UnknownChoiceError as error:
        argument = "group" if error.kind == "group" else "source" if error.kind == "robot" else "locked"
        raise error.of_argument("load_robot", argument) from None


def load_run(folder: Path | str) -> Run:
    """A run from the folder that `Run.save` or `optiplan plan --out` made.

    The motion is verified afresh: a file that was changed since does not wear the old verdict.

    Raises:
        InputError: there is no run, a file of it is broken, or its problem cannot be read any more.

    Example:
        >>> import optiplan as op
        >>> op.plan(op.load_problem("01_reach")).save("runs/reach")
        >>> op.load_run("runs/reach").verified
        True
    """
    from optiplan.runs.run_folder import load_run as read_run
    from optiplan.runs.stored_runs import run_of_record

    if not isinstance(folder, str | Path):
        raise wrong_argument("load_run", "folder", described(folder), "the folder of a run")
    stored = read_run(folder)
    if "problem" not in stored.record:
        found = f"{str(folder)!r}, a trajectory without its problem"
        raise wrong_argument("load_run", "folder", found, "the folder of a run (or op.verify(problem, path))")
    return run_of_record(stored.record, stored.trajectory, given=stored.given, file=stored.record_file)
