"""Print what came of a closed loop: the verdict first, then errors, limits and timing."""

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from optiplan.robot.limits import thousandths
from optiplan.simulation.log import Log
from optiplan.simulation.simulation import Simulation


def show_simulation(console: Console, done: Simulation, out: Path | None) -> None:
    """Print a simulation; `out` is where its log lies."""
    if done.log is None:
        reason = "no reason given" if done.failure is None else done.failure.detail
        console.print(f"no motion to follow: {reason}", style="red", markup=False)
        return
    log, spec = done.log, done.control.spec
    style, words = _verdict(log)
    console.print(f"{words}, {log.t[-1]:.3f} s", style=style, markup=False)
    console.print(
        f"{done.control.name} · {done.control.robot.name} · {spec.reference.kind} · {spec.controller.kind} · "
        f"engine {spec.plant.engine}",
        style="dim",
        markup=False,
    )
    console.print(_facts(log), markup=False)
    console.print(_joints(log, done), markup=False)
    robot = done.control.robot
    for name, found in done.responses.items():
        unit = robot.unit("position", robot.joint_names.index(name))
        rise = "never" if found.rise is None else f"{found.rise:.3f} s"
        settling = "never" if found.settling is None else f"{found.settling:.3f} s"
        console.print(
            f"step of {name}: rise {rise}, overshoot {100.0 * found.overshoot:.1f} %, settled after {settling}, "
            f"steady error {found.steady_error:.3g} {unit}",
            markup=False,
        )
    if out is not None:
        console.print(f"written: {out} (optiplan view {out})", markup=False, soft_wrap=True)


def _verdict(log: Log) -> tuple[str, str]:
    if log.stopped:
        return "red", log.stopped
    if log.touched:
        assert log.contacts is not None
        pairs = [f"'{a}' and '{b}' at {time:.3f} s" for (a, b), time in log.contacts.touched.items()]
        return "red", f"contact: {'; '.join(pairs[:3])}" + (f"; {len(pairs) - 3} more" if len(pairs) > 3 else "")
    return "green", "ran to its end" if log.contacts is None else "ran to its end, nothing touched"


def _facts(log: Log) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    track, contacts = log.tracking, log.contacts
    table.add_row("tool error", f"{1e3 * track.tool_rms:.3g} mm RMS, {1e3 * track.tool_peak:.3g} mm at most")
    table.add_row("tool rotation", f"{1e3 * track.turn_rms:.3g} mrad RMS, {1e3 * track.turn_peak:.3g} mrad at most")
    if contacts is not None and contacts.least is not None:
        far = contacts.pair is None
        pair = "" if contacts.pair is None else f" ({contacts.pair[0]} and {contacts.pair[1]}, {contacts.time:.3f} s)"
        every = f", measured every {1e3 * contacts.interval:g} ms"
        table.add_row("clearance", f"{'more than ' if far else ''}{1e3 * contacts.least:.3g} mm{pair}{every}")
    if log.statuses:
        count = sum(log.statuses.values())
        table.add_row("controller", ", ".join(f"{name} {100 * k / count:.3g} %" for name, k in log.statuses.items()))
    if log.active:
        held = sorted(log.active.items(), key=lambda item: -item[1])[:5]
        table.add_row("limits met", ", ".join(f"{name} {100 * share:.3g} %" for name, share in held))
    for name, values in log.slack.items():
        table.add_row("given up", f"{name}: {float(np.max(values)):.3g} at most")
    step_ms = log.summary()["step_ms"]
    if step_ms is not None:
        table.add_row("controller step", ", ".join(f"{key} {value:.3g} ms" for key, value in step_ms.items()))
    return table


def _joints(log: Log, done: Simulation) -> Table:
    """Errors by joint in mrad (mm), and what was exceeded, where anything was."""
    track = log.tracking
    columns = {"RMS": 1e3 * track.rms, "at most": 1e3 * track.peak}
    if track.saturated.any():
        columns["at torque limit, %"] = 100.0 * track.saturated
    if track.beyond_position.any():
        columns["beyond position"] = 1e3 * track.beyond_position
    if track.beyond_velocity.any():
        columns["beyond speed, /s"] = 1e3 * track.beyond_velocity
    table = Table(f"joint, {thousandths(done.control.robot.revolute)}", *columns, box=None, pad_edge=False)
    for j, name in enumerate(log.joint_names):
        table.add_row(name, *(f"{values[j]:.3g}" for values in columns.values()))
    return table
