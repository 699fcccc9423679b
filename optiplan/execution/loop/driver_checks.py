"""What a driver says of itself and of its robot, checked: it may be anybody's."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array, Flags, is_finite
from optiplan.errors import OptiPlanError, described, named_reason, wrong_argument
from optiplan.execution.arguments import LONGEST_TICK, numbers
from optiplan.execution.drivers.base import Capabilities, Driver, DriverError
from optiplan.execution.measurement import Measurement

MOST_RATE = 2000.0
"""Hz: of set-points at most."""

IN_A_LEAD = 3.0
"""Set-points in a driver's lead at least: one that is renewed is there before the last one ends, also a tick late."""

NEAR = 0.02
"""rad or m: so far may a measured joint be from where the motion begins, and from where it ends."""

CALLS = ("capabilities", "state", "send", "stop")
"""Of every driver."""


def in_words(error: BaseException) -> str:
    """Return what an exception says, with its class unless it is one of ours."""
    return " ".join(str(error).split()) if isinstance(error, OptiPlanError) and str(error) else named_reason(error)


def checked_capabilities(driver: Driver, names: tuple[str, ...], rate: Any) -> Capabilities:
    """Return what a driver can do, at the rate that is wanted, Hz; None: its own.

    Args:
        driver: that may be anything.
        names: of the joints, in order.
        rate: of set-points.

    Raises:
        InputError: it is no driver, or one of other joints; the rate cannot be.
        DriverError: it raised.
    """
    missing = [call for call in CALLS if not callable(getattr(driver, call, None))]
    if missing:
        expected = f"an object with the calls {', '.join(CALLS)}"
        raise wrong_argument("Execution", "driver", f"{described(driver)} without '{missing[0]}'", expected)
    try:
        found = driver.capabilities()
    except OptiPlanError:
        raise
    except Exception as error:
        raise DriverError(f"the driver does not say what it can do: {in_words(error)}") from error
    if not isinstance(found, Capabilities):
        given = f"a driver that returns {described(found)} for its capabilities"
        raise wrong_argument("Execution", "driver", given, "one that returns an op.Capabilities")
    if tuple(found.joint_names) != names:
        other = f"a driver '{found.name}' of the joints {', '.join(found.joint_names)}"
        raise wrong_argument("Execution", "driver", other, f"one of the run's joints, in order: {', '.join(names)}")
    wanted = found.rate if rate is None else rate
    least = max(1.0 / LONGEST_TICK, IN_A_LEAD / found.lead if found.lead else 0.0)
    if not is_finite(wanted) or not least <= wanted * (1.0 + 1e-9) or wanted > MOST_RATE:
        given = f"the driver's own, {described(wanted)}" if rate is None else described(rate)
        lead = f", at least {IN_A_LEAD:g} set-points in the driver's lead of {found.lead:g} s" if found.lead else ""
        raise wrong_argument("Execution", "rate", given, f"{least:g} to {MOST_RATE:g} Hz{lead}")
    return replace(found, rate=float(wanted))


def measured_by(driver: Driver) -> Measurement | None:
    """Return the state that a driver has, or None.

    Raises:
        DriverError: it returned something else.
        Exception: whatever the driver raises.
    """
    found: Any = driver.state()
    if found is not None and not isinstance(found, Measurement):
        raise DriverError(f"state() returned {described(found)}; expected an op.Measurement, or None")
    return found


def whole_turns(measured: Array, wanted: Array, endless: Flags) -> Array:
    """Return by which whole turns (n,), rad, endless joints are measured farther than they are wanted."""
    off = np.nan_to_num((measured - wanted) / (2.0 * np.pi), posinf=0.0, neginf=0.0)
    return np.where(endless, 2.0 * np.pi * np.round(off), 0.0)


def astray(found: Measurement, wanted: Array, endless: Flags, names: Sequence[str], near: Array | float = NEAR) -> str:
    """Return which joint is measured farther than `near` from where it is wanted (n,), or nothing."""
    q = numbers(found.q)
    if q.shape != wanted.shape:
        return f"the driver's state has {q.size} joints; expected {len(wanted)}"
    q = q - whole_turns(q, wanted, endless)
    beyond = np.nan_to_num(np.abs(q - wanted) - near, nan=np.inf)
    if beyond[worst := int(beyond.argmax())] <= 0.0:
        return ""
    return f"{names[worst]} is at {q[worst]:.4f}, where {wanted[worst]:.4f} is expected"
