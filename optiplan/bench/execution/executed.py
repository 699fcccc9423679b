"""The last rung of the ladder: a verified motion is followed by computed torque on our rigid-body plant."""

from typing import Any

from optiplan.errors import InputError
from optiplan.runs.run import Run
from optiplan.simulation.execution import execute

FOLLOWED = 1e-3
"""m; a motion counts as executed when the tool keeps to it within this, RMS, and nothing touches."""

METRICS = ("tool_error_rms", "tool_error_peak", "joint_error_rms", "joint_error_peak", "executed_clearance")
"""Numbers of an execution: m, m, rad (m) by joint as the largest of all, the same, m (at most 0.05)."""


def executed(done: Run) -> tuple[bool | None, dict[str, float | None]]:
    """Whether a run's motion was followed, and `METRICS`; None and nothing where it was not tried.

    It is not tried without a verified motion, nor on a robot whose joints move no inertia. The plant is nominal: the
    model of the controller is right, there is no friction, noise or delay; `optiplan control` has those.
    """
    if not done.verified or done.trajectory is None:
        return None, {}
    try:
        log = execute(done.problem, done.trajectory)
    except InputError:  # no inertias
        return None, {}
    track, contacts = log.tracking, log.contacts
    numbers: dict[str, float | None] = {
        "tool_error_rms": track.tool_rms,
        "tool_error_peak": track.tool_peak,
        "joint_error_rms": float(track.rms.max()),
        "joint_error_peak": float(track.peak.max()),
        "executed_clearance": None if contacts is None else contacts.least,
    }
    return not log.touched and not log.stopped and track.tool_rms <= FOLLOWED, numbers


def only_wanted(numbers: dict[str, Any], wanted: tuple[str, ...] | None) -> dict[str, Any]:
    """The numbers that a suite asks for; None asks for all."""
    return {name: value for name, value in numbers.items() if wanted is None or name in wanted}
