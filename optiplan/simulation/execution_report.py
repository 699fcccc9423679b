"""What a log says of limits and contact, in the form of the verifier's report; sampled, and never *verified*."""

from dataclasses import asdict
from typing import Any

import numpy as np

from optiplan.arrays import finite_or_none
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.simulation.log import Log, ObjectLog, WheelLog
from optiplan.verify.report import Check, jsonable

_ROUNDING = 1e-6
"""rad or m, and per second: what the controller's own arithmetic may pass a limit by."""

OBJECT_ERROR = 2e-3
"""m; an object of a task that ends farther from the plan fails the report."""


def execution_report(log: Log, robot: Robot, limits: Limits) -> dict[str, Any]:
    """JSON-ready, with the keys of a report; `executed` says whether it ran to its end and nothing touched."""
    checks = [_tracking(log), *_limits(log, robot, limits)]
    if log.contacts is not None:
        checks.append(_contact(log))
    checks += [_object(name, found) for name, found in log.objects.items()]
    if log.slip_margin is not None:
        checks.append(_grip(log.slip_margin))
    if log.wheels is not None:
        checks.append(_wheels(log.wheels))
    scope = [f"executed in a closed loop at {1.0 / log.dt:g} Hz: what is said holds at the instants looked at"]
    if log.contacts is not None:
        scope.append(f"distances were measured every {1e3 * log.contacts.interval:g} ms")
    done = not log.stopped and not log.touched
    told = [asdict(check) for check in checks]
    return dict(jsonable({"verified": False, "executed": done, "checks": told, "scope": scope, "notes": []}))


def _tracking(log: Log) -> Check:
    track = log.tracking
    detail = f"tool error {1e3 * track.tool_rms:.3g} mm RMS, {1e3 * track.tool_peak:.3g} mm at most"
    if log.stopped:
        detail = log.stopped
    return Check("tracking", "sampled", not log.stopped, worst=track.tool_peak, unit="m", detail=detail)


def _limits(log: Log, robot: Robot, limits: Limits) -> list[Check]:
    track, speed = log.tracking, np.abs(log.v)
    below, above = limits.lower - log.q, log.q - limits.upper
    nearer, outside = np.where(below > above, limits.lower, limits.upper), np.maximum(below, above)
    half = 0.5 * (limits.upper - limits.lower)
    half, fastest = np.where(np.isfinite(half), half, 1.0), np.broadcast_to(limits.velocity, speed.shape)
    found = []
    for name, values, excess, scale, beyond, limit in (
        ("position", log.q, outside, half, track.beyond_position, nearer),
        ("velocity", speed, speed, fastest, track.beyond_velocity, fastest),
    ):
        j = int(np.argmax(beyond if beyond.any() else (excess / scale).max(axis=0)))
        k = int(np.argmax(excess[:, j]))
        joint, unit, worst = robot.joint_names[j], robot.unit(name, j), float(values[k, j])
        passed = bool(beyond[j] <= _ROUNDING)
        detail = "" if passed else f"{joint} goes {beyond[j]:.3g} beyond its limit"
        found.append(
            Check(name, "sampled", passed, worst, finite_or_none(limit[k, j]), unit, float(log.t[k]), joint, detail)
        )
    if log.input == "torque":
        j = int(np.argmax(track.saturated))
        share = float(track.saturated[j])
        detail = f"{robot.joint_names[j]} is at its torque limit {100.0 * share:.3g} % of the time" if share else ""
        found.append(Check("torque", "sampled", True, place=robot.joint_names[j] if share else "", detail=detail))
    return found


def _object(name: str, found: ObjectLog) -> Check:
    detail = f"ends {1e3 * found.error:.3g} mm and {np.rad2deg(found.turn):.3g}° from the plan"
    detail += f"; moved {1e3 * found.slip:.3g} mm in what held it"
    passed = found.error <= OBJECT_ERROR
    return Check("object", "sampled", passed, found.error, OBJECT_ERROR, "m", place=name, detail=detail)


def _grip(margin: float) -> Check:
    detail = f"grips have {100.0 * margin:.3g} % of their friction left at least"
    return Check("grip", "sampled", margin > 0.0, margin, 0.0, detail=detail)


def _wheels(wheels: WheelLog) -> Check:
    drift = f"{1e3 * wheels.drift:.3g} mm and {np.rad2deg(wheels.turn_drift):.3g}°"
    detail = f"their rates alone would have the base {drift} off after {wheels.travel:.3g} m"
    detail += f"; it goes up and down by {1e3 * wheels.lift:.3g} mm"
    return Check("wheels", "sampled", True, wheels.drift, unit="m", detail=detail)


def _contact(log: Log) -> Check:
    assert log.contacts is not None
    contacts = log.contacts
    pair = contacts.pair if contacts.pair is not None else next(iter(contacts.touched), None)
    place = "" if pair is None else f"{pair[0]}, {pair[1]}"
    detail = "; ".join(f"'{a}' and '{b}' touch at {time:.3f} s" for (a, b), time in contacts.touched.items())
    witness = {"pair": list(pair or ()), "met_clearance": contacts.least}
    passed = not contacts.touched
    return Check("collision", "sampled", passed, contacts.least, 0.0, "m", contacts.time, place, detail, witness)
