"""Print what came of an execution: the verdict first, then the errors and the timing."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table


def show_execution(console: Console, done: Mapping[str, Any]) -> None:
    """Print the result of `optiplan run`."""
    style, words = _verdict(done)
    console.print(words, style=style, markup=False, soft_wrap=True)
    tried = "" if done["tried_on_hardware"] or done["driver"] in ("sim", "file") else " · not tried on hardware"
    line = f"{done['name']} · {done['robot']} · driver {done['driver']} at {done['rate']:g} Hz{tried}"
    console.print(line, style="dim", markup=False)
    table, report = Table(box=None, show_header=False, pad_edge=False), done["report"]
    if "error_rms" in report:
        error = f"{1e3 * report['error_rms']:.3g} mrad (mm) RMS, {1e3 * report['error_max']:.3g} at most"
        table.add_row("tracking error", error)
    elif done["deviation"] is not None:
        table.add_row("tracking error", f"{1e3 * done['deviation']:.3g} mrad (mm) at most")
    if "contacts" in report:
        pairs = [f"'{a}' and '{b}'" for a, b in report["contacts"]]
        table.add_row("contacts", "; ".join(pairs) or "none")
    late = done["lateness"]
    table.add_row(
        "set-points",
        f"late by {1e3 * late['rms']:.3g} ms RMS, {1e3 * late['p99']:.3g} ms at 99 %, {1e3 * late['max']:.3g} ms at "
        f"most; {done['missed']} not sent, since the ones before them took their time",
    )
    if report.get("slipped"):
        table.add_row("simulation", f"{report['slipped']:.3g} s slower than real time")
    console.print(table, markup=False)
    if "file" in report:
        console.print(f"written: {report['file']}", markup=False, soft_wrap=True)


def _verdict(done: Mapping[str, Any]) -> tuple[str, str]:
    where = f"{done['place']:.3f} s of {done['duration']:.3f} s of the path"
    if done["phase"] != "done":
        return "red", f"stopped at {where}: {done['reason']}"
    if done["report"].get("contacts"):
        return "red", f"something was touched; at the end after {done['t']:.3f} s"
    return "green", f"done in {done['t']:.3f} s; planned {done['duration']:.3f} s"
