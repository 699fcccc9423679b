"""`simulate` and `execute`: closed loops from Python."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

from optiplan.arrays import is_finite
from optiplan.errors import described, progress_argument, wrong_argument
from optiplan.runs.run import Run
from optiplan.simulation.execution import Engine, ExecutionOptions
from optiplan.simulation.execution import execute as follow
from optiplan.simulation.files.read import find_control
from optiplan.simulation.log import Log
from optiplan.simulation.plants.base import Payload
from optiplan.simulation.plants.imperfections import Imperfections
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
    delay: float = 0.0,
    payload: float = 0.0,
    frequency: float = 10.0,
) -> Log:
    """Follow the motion of a run by computed torque on rigid-body dynamics.

    Args:
        run: with a trajectory.
        engine: `own`, or `mujoco` (extra `[sim]`).
        delay: s from measurement to torque; a multiple of the plant's step of 0.25 ms.
        payload: kg at the tool that the controller does not know of.
        frequency: Hz, of the controller's error dynamics.

    Returns:
        The log: `tracking` (errors of joints and tool), `contacts`, arrays over time.

    Raises:
        InputError: a run without a motion, a robot whose joints move no inertia, an argument that cannot be.
        OptiPlanError: MuJoCo is not installed.

    Example:
        >>> import optiplan as op
        >>> log = op.execute(op.plan(op.load_problem("01_reach")))
        >>> log.touched, log.tracking.tool_rms < 1e-3
        (False, True)
    """
    if not isinstance(run, Run) or run.trajectory is None:
        found = "a run without a motion" if isinstance(run, Run) else described(run)
        raise wrong_argument("execute", "run", found, "a run of op.plan(…) with a trajectory")
    if engine not in get_args(Engine):
        raise wrong_argument("execute", "engine", described(engine), f"one of: {', '.join(get_args(Engine))}")
    for name, value, least in (("delay", delay, 0.0), ("payload", payload, 0.0), ("frequency", frequency, 1e-3)):
        if not is_finite(value) or value < least:
            raise wrong_argument("execute", name, described(value), f"a finite number >= {least:g}")
    options = ExecutionOptions(
        engine="mujoco" if engine == "mujoco" else "own",
        frequency=frequency,
        payload=Payload(payload, 0.0) if payload else None,
        imperfections=Imperfections(delay=delay),
    )
    return follow(run.problem, run.trajectory, options)
