"""`simulate` and `execute`: closed loops from Python."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

from optiplan.arrays import is_finite, is_listed, number_argument
from optiplan.errors import choice_argument, described, flag_argument, progress_argument, wrong_argument
from optiplan.runs.run import Run
from optiplan.simulation.execution import Engine, ExecutionOptions
from optiplan.simulation.execution import execute as follow
from optiplan.simulation.files.read import find_control
from optiplan.simulation.log import Log
from optiplan.simulation.plants.base import Payload
from optiplan.simulation.plants.imperfections import MOST_DELAY, Imperfections
from optiplan.simulation.plants.task_plant import FrictionGrip
from optiplan.simulation.references.executed import ExecutedReference, Speeds
from optiplan.simulation.simulation import Simulation, run_control


def simulate(source: Path | str | Mapping[str, Any], progress: Callable[[float], None] | None = None) -> Simulation:
    """Run a closed loop: what `optiplan control FILE` does.

    Args:
        source: a control file, the name of an example such as `delbot_circle`, or the keys of such a file; paths in a
            mapping are relative to the working directory.
        progress: called with the fraction done, 0 to 1.

    Returns:
        The simulation: `log` with arrays over time and errors, `clean`, `save`.

    Raises:
        InputError: everything that is wrong with the file.

    Example:
        >>> import optiplan as op
        >>> op.simulate("panda_shelf").clean
        True
    """
    progress_argument("simulate", progress, "a function of a fraction")
    if isinstance(source, Mapping):
        return run_control(source, progress)
    if not isinstance(source, str | Path):
        expected = "the path of a control file, the name of an example, or a mapping of the keys of a file"
        raise wrong_argument("simulate", "source", described(source), expected)
    return run_control(find_control(str(source)), progress)


def execute(
    run: Run,
    engine: str = "own",
    *,
    speeds: Speeds | None = None,
    grip: str | FrictionGrip = "weld",
    wheels: bool = False,
    delay: float = 0.0,
    payload: float = 0.0,
    frequency: float = 10.0,
) -> Log:
    """Follow the motion of a run by computed torque on rigid-body dynamics; a task with its objects.

    Args:
        run: with a trajectory.
        engine: `own`, or `mujoco` (extra `[sim]`), where objects are free bodies.
        speeds: pairs of a time, s, and the speed wanted from then on, 0 to 1 of the planned one; or a function that is
            called with the `Executor` before every tick of 1 ms, and may change its speed, pause it and reverse it.
            The set-points and torques are then those of the executor. None: as planned.
        grip: `weld`, or by friction in MuJoCo: `friction`, or an `op.FrictionGrip` with its figures.
        wheels: whether a mecanum base drives on wheels with rollers, in MuJoCo; else its joints have drives.
        delay: s from measurement to torque; a multiple of the plant's step of 0.25 ms.
        payload: kg at the tool that the controller does not know of.
        frequency: Hz, of the controller's error dynamics.

    Returns:
        The log: `tracking` (errors of joints and tool), `contacts`, `objects`, `wheels`, `report`, arrays over time.

    Raises:
        InputError: a run without a motion, a robot whose joints move no inertia, a run that the executor refuses,
            fingers that would press with more than their drives give, an argument that cannot be.
        OptiPlanError: MuJoCo is not installed.

    Example:
        >>> import optiplan as op
        >>> run = op.plan(op.load_problem("01_reach"))
        >>> log = op.execute(run, speeds=[(0.0, 1.0), (0.2, 0.3), (0.6, 0.8)])
        >>> log.touched, log.tracking.tool_rms < 1e-3
        (False, True)
    """
    if not isinstance(run, Run) or run.trajectory is None:
        found = "a run without a motion" if isinstance(run, Run) else described(run)
        raise wrong_argument("execute", "run", found, "a run of op.plan(…) with a trajectory")
    choice_argument("execute", "engine", engine, get_args(Engine))
    for name, value, least in (("delay", delay, 0.0), ("payload", payload, 0.0), ("frequency", frequency, 1e-3)):
        number_argument("execute", name, value, f"a finite number >= {least:g}", least)
    steps = delay / ExecutionOptions.step
    if delay > MOST_DELAY or abs(steps - round(steps)) > 1e-6:
        expected = f"a multiple of the plant's step of {ExecutionOptions.step:g} s, up to {MOST_DELAY:g} s"
        raise wrong_argument("execute", "delay", described(delay), expected)
    flag_argument("execute", "wheels", wheels)
    if wheels and engine != "mujoco":
        raise wrong_argument(
            "execute", "wheels", f"{wheels!r} with the engine '{engine}'", "the engine mujoco, or False"
        )
    options = ExecutionOptions(
        engine="mujoco" if engine == "mujoco" else "own",
        frequency=frequency,
        payload=Payload(float(payload), 0.0) if payload else None,
        imperfections=Imperfections(delay=delay),
        grip=_grip(grip),
        wheels=bool(wheels),
    )
    reference = None if speeds is None else ExecutedReference(run, _speeds(speeds), options.dt)
    return follow(run.problem, run.trajectory, options, reference=reference)


def _grip(grip: str | FrictionGrip) -> FrictionGrip | None:
    """Return a grip by friction; None for welds."""
    if not isinstance(grip, FrictionGrip) and not (isinstance(grip, str) and grip in ("weld", "friction")):
        raise wrong_argument("execute", "grip", described(grip), "weld, friction, or an op.FrictionGrip")
    if isinstance(grip, FrictionGrip):
        return grip
    return None if grip == "weld" else FrictionGrip()


def _speeds(speeds: Speeds) -> Speeds:
    """Return speeds that are pairs of numbers, or a function."""
    if callable(speeds):
        return speeds
    expected = "pairs of a time >= 0, s, and a speed from 0 to 1, or a function of an executor"
    if not is_listed(speeds):
        raise wrong_argument("execute", "speeds", described(speeds), expected)
    pairs = list(speeds)
    for k, pair in enumerate(pairs):
        values = [] if isinstance(pair, str) or not isinstance(pair, Iterable) else list(pair)
        good = len(values) == 2 and all(is_finite(value) for value in values)
        if not good or values[0] < 0.0 or not 0.0 <= values[1] <= 1.0:
            raise wrong_argument("execute", f"speeds[{k}]", described(pair), expected)
    return pairs
