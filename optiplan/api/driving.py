"""`driver`: drivers by name."""

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import signature
from typing import Any

from optiplan.errors import OptiPlanError, UnknownChoiceError, described, wrong_argument
from optiplan.execution.drivers.base import Driver
from optiplan.execution.executor import Executor
from optiplan.execution.loop.execution import Execution
from optiplan.runs.run import Run

DRIVERS = {
    "sim": "optiplan.simulation.real_time.sim_driver:SimDriver",
    "file": "optiplan.execution.drivers.csv_file:FileDriver",
    "ros2_control": "optiplan.execution.drivers.ros2_control:Ros2ControlDriver",
    "ur_rtde": "optiplan.execution.drivers.ur_rtde:UrRtdeDriver",
}
"""Class of each driver; its module and its client package are imported when it is named."""


def driver_options(name: str) -> tuple[str, ...]:
    """Return the names of a driver's options; importing its module may take a moment.

    Raises:
        UnknownChoiceError: no driver has that name.
    """
    return tuple(option for option in signature(_made_by(name)).parameters if option != "run")


def driver(name: str, run: Run, **options: Any) -> Driver:
    """Return a driver for the robot of a run, ready to execute it.

    Args:
        name: `sim`, `file`, `ros2_control` or `ur_rtde`.
        run: to be executed; a simulated robot stands where it begins.
        options: of the driver's class, by name.

    Raises:
        UnknownChoiceError: no driver has that name.
        InputError: an option that the driver does not have, or with a wrong value.
        OptiPlanError: its package is not installed, or the robot cannot be reached.

    Example:
        >>> import optiplan as op
        >>> run = op.plan(op.load_problem("01_reach"))
        >>> op.driver("sim", run, engine="own").capabilities().rate
        500.0
    """
    if not isinstance(run, Run) or run.trajectory is None:
        raise wrong_argument("driver", "run", described(run), "a run of op.plan(…) with a trajectory")
    known = driver_options(name)
    for option, value in options.items():
        if option not in known:
            raise wrong_argument("driver", option, described(value), f"an option of '{name}': {', '.join(known)}")
    return _made_by(name)(run, **options)


def execution_by(
    name: str, executor: Executor, options: Mapping[str, Any], rate: float | None, patience: float
) -> tuple[Execution, Driver]:
    """Return an execution that is not started, and its driver, which also gets a `rate`, Hz, where it has the option.

    Raises:
        UnknownChoiceError, InputError, OptiPlanError: as `driver`, or the driver does not fit.
    """
    own = {"rate": rate} if rate is not None and "rate" in driver_options(name) else {}
    made = driver(name, executor.run, **options, **own)
    try:
        return Execution(executor, made, rate=rate, patience=patience), made
    except OptiPlanError:
        made.stop("not started")
        raise


def _made_by(name: str) -> Callable[..., Driver]:
    if not isinstance(name, str) or name not in DRIVERS:
        raise UnknownChoiceError("driver", str(name), DRIVERS)
    module, _, attribute = DRIVERS[name].partition(":")
    make: Callable[..., Driver] = getattr(import_module(module), attribute)
    return make
