"""`optiplan run`: plan a motion, or take a stored one, and execute it on a driver."""

import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optiplan.cli.commands.plan import BUDGET, above_zero, positive, positive_or_none
from optiplan.cli.completion import planner_names, problem_names
from optiplan.cli.options import AsJson, refuse
from optiplan.cli.output import Exit, end_with, handling, print_error, print_json, results, stdout_is_ours
from optiplan.cli.progress import ProgressLine
from optiplan.errors import InputError

if TYPE_CHECKING:
    from optiplan.execution.drivers.base import Driver
    from optiplan.execution.loop.execution import Execution
    from optiplan.runs.run import Run

FILE = "a problem file, the name of an example, or the folder of a run"
DRIVER = "what moves: sim (a simulated robot in real time), file, ros2_control or ur_rtde"
RATE = "set-points per second (default: the driver's)"
ENGINE = "of sim: mujoco, own or ideal (default: mujoco where it is installed)"
SECONDS = f"seconds of wall time for planning and proof (default: {BUDGET:g})"
PLANNER = "instead of the file's; see: planners"
TABLE = "of the driver file: the table, which is replaced (default: set_points.csv)"
DEVIATION = "rad or m: a measured joint farther from the path ends in a stop"
PATIENCE = "seconds: a set-point that comes as late as this ends in a stop"
DISTANCE = above_zero("a number above 0, rad or m")
VIEW = "begin, steer and stop it on a page, where obstacles can be dragged; Ctrl-C ends"


def run(
    file: Annotated[str, typer.Argument(metavar="FILE", help=FILE, autocompletion=problem_names)],
    driver: Annotated[str, typer.Option(metavar="NAME", help=DRIVER)] = "sim",
    rate: Annotated[float | None, typer.Option(metavar="HZ", help=RATE)] = None,
    override: Annotated[float, typer.Option(min=0.0, max=1.0, metavar="X", help="speed, 0 to 1")] = 1.0,
    engine: Annotated[str | None, typer.Option(metavar="NAME", help=ENGINE)] = None,
    host: Annotated[str | None, typer.Option(metavar="HOST", help="of ros2_control and ur_rtde")] = None,
    to: Annotated[Path | None, typer.Option("--to", metavar="FILE", help=TABLE)] = None,
    deviation: Annotated[float, typer.Option(callback=DISTANCE, metavar="D", help=DEVIATION)] = 0.05,
    view: Annotated[bool, typer.Option("--view", help=VIEW)] = False,
    patience: Annotated[float, typer.Option(callback=positive, metavar="S", help=PATIENCE)] = 0.01,
    planner: Annotated[str | None, typer.Option(metavar="NAME", help=PLANNER, autocompletion=planner_names)] = None,
    budget: Annotated[float | None, typer.Option(callback=positive_or_none, metavar="S", help=SECONDS)] = None,
    as_json: AsJson = False,
) -> int:
    """Execute a verified motion on a robot, a simulated one by default.

    The motion is planned and proved first, or taken from a run folder and proved again.
    Every set-point lies on the proved path. Ctrl-C stops the robot along that path, within its limits, and says so.
    So does everything that goes wrong on the way; the reason is printed.

    [bold]Examples[/]

      optiplan run 02_shelf                              planned, then run in MuJoCo in real time

      optiplan run runs/cell --rate 1000 --override 0.3  a stored run, slowly

      optiplan run 02_shelf --view                       on a page: speed, pause, stop, obstacles to drag

      optiplan run cell.yaml --driver file --to set_points.csv

      optiplan run cell.yaml --driver ur_rtde --host 192.168.0.10

    Exit code: 0 done, nothing touched · 2 bad input, or the robot cannot be reached · 3 no motion was found
    · 4 stopped on the way, touched something, or the motion is not verified · 130 stopped by Ctrl-C.
    """
    from optiplan.cli.printing.executed import show_execution

    if override == 0.0 and not view:
        raise typer.BadParameter("at 0 the robot stands for ever; expected more, or --view", param_hint="--override")
    with stdout_is_ours(), ProgressLine() as progress:
        motion = _motion(file, planner, budget, progress)
    if motion.trajectory is None:
        why = motion.failure.detail if motion.failure else "no reason given"
        return end_with(Exit.NO_PLAN, f"no motion to run: {why}", as_json)
    if not motion.verified:
        return end_with(Exit.NOT_VERIFIED, "the motion is not verified; nothing moved", as_json)
    given = {"engine": engine, "host": host, "path": to}
    options = {name: value for name, value in given.items() if value is not None}
    steering = {"override": override, "deviation": deviation, "patience": patience, "rate": rate}
    done, pressed = (_on_page if view else _executed)(motion, driver, options, steering)
    clean = done["phase"] == "done" and not done["report"].get("contacts")
    code = Exit.INTERRUPTED if pressed and not clean else Exit.VERIFIED if clean else Exit.NOT_VERIFIED
    if as_json:
        print_json({**done, "exit_code": int(code)})
    else:
        show_execution(results(), done)
    return code


def _executed(
    motion: "Run", driver: str, options: Mapping[str, Any], steering: Mapping[str, Any]
) -> tuple[dict[str, Any], bool]:
    """Execute a motion here; return what came of it, and whether Ctrl-C was pressed."""
    from optiplan.api.driving import execution_by
    from optiplan.execution.executor import Executor

    executor = Executor(motion, override=steering["override"], deviation=steering["deviation"])
    with stdout_is_ours():
        execution, made = execution_by(driver, executor, options, steering["rate"], steering["patience"])
        with ProgressLine() as progress, _stopping(execution.stop) as pressed:
            execution.start()
            while not execution.over:
                seen = execution.wait(0.1)
                progress(f"{seen['phase']} at {seen['speed']:.0%} of the planned speed", seen["progress"])
    return _result(motion, execution, made), bool(pressed)


def _on_page(
    motion: "Run", driver: str, options: Mapping[str, Any], steering: Mapping[str, Any]
) -> tuple[dict[str, Any], bool]:
    """Execute a motion from a page until Ctrl-C; return what came of it, and whether Ctrl-C was pressed."""
    from threading import Event

    from optiplan.cli.run_page import run_on_page

    ended, address = Event(), "open {} in a browser and press Resume (Ctrl-C ends)"
    with _stopping(lambda reason: ended.set()) as pressed:
        done = run_on_page(motion, driver, options, steering, lambda url: print_error(address.format(url)), ended)
    return done, bool(pressed)


def _motion(file: str, planner: str | None, budget: float | None, progress: ProgressLine) -> "Run":
    """Return the run of a folder, or plan one; issues with the planner's options carry the file's lines."""
    from optiplan.api.checking import choose, placed
    from optiplan.api.loading import load_run
    from optiplan.api.planning import plan
    from optiplan.problem.examples import find_problem
    from optiplan.problem.load import load_problem

    path = Path(file)
    if (path / "run.json").is_file() or path.name == "run.json":
        refuse({"--planner": planner, "--budget": budget}, "goes with a problem, not with the folder of a run")
        return load_run(path)
    path = find_problem(file)
    problem = load_problem(path)
    chosen, options = choose(path, problem, planner)
    try:
        return plan(problem, chosen, options or None, budget=budget or BUDGET, progress=progress)
    except InputError as error:
        raise placed(path, error) if options else error from None


@contextmanager
def _stopping(stop: Callable[[str], None]) -> Iterator[list[int]]:
    """Let Ctrl-C, and the end that a service asks for, stop along the path; a second one ends the program at once.

    Yields the signals that came.
    """
    pressed: list[int] = []

    def handle(number: int, _: object) -> None:
        pressed.append(number)
        signal.signal(number, signal.SIG_DFL)
        stop("Ctrl-C" if number == signal.SIGINT else "the program was asked to end")

    with handling((signal.SIGINT, signal.SIGTERM), handle):
        yield pressed


def _result(motion: "Run", execution: "Execution", driver: "Driver") -> dict[str, Any]:
    """Return what came of an execution, for JSON."""
    found = execution.snapshot()
    return {
        "name": motion.problem.name,
        "robot": motion.problem.robot.name,
        "hash": motion.problem.hash,
        **found,
        "lateness": execution.lateness(),
        "tried_on_hardware": execution.capabilities.tried_on_hardware,
        "report": getattr(driver, "report", {}),
    }
