"""Runs and reports as a person reads them in a terminal."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from optiplan.pipeline import Run
from optiplan.planners.base import Failure
from optiplan.verify.report import Check, Report


def show_run(console: Console, run: Run) -> None:
    """The verdict of a run: its report or its failure, how good the motion is, what took how long."""
    title = f"{run.problem.name} · {run.problem.robot.name} · {run.planner} · seed {run.problem.seed}"
    console.print(title, style="bold", markup=False)
    if run.report is not None:
        show_report(console, run.report)
        console.print(_quality(run))
    if run.failure is not None:
        _show_failure(console, run.failure)
    console.print(_times(run), markup=False, style="dim")
    for note in run.problem.robot.notes if run.report is None else ():  # the report holds them as well
        console.print(f"note: {note}", style="yellow", markup=False, soft_wrap=True)


def show_report(console: Console, report: Report) -> None:
    """Every check with its worst value, its limit, when and where; then the one word that counts."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading, side in (("check", "left"), ("", "left"), ("worst", "right"), ("limit", "right"), ("", "left")):
        table.add_column(heading, justify="right" if side == "right" else "left", no_wrap=True)
    table.add_column("where", overflow="fold")
    table.add_column("how", no_wrap=True)
    for check in report.checks:
        verdict = "[green]pass[/]" if check.passed else "[bold red]FAIL[/]"
        scale, unit = (1e3, "mm") if check.unit == "m" else (1.0, check.unit)
        worst, limit = _number(check.worst, scale), _number(check.limit, scale)
        table.add_row(check.name, verdict, worst, limit, unit, escape(_where(check)), check.kind)
    console.print(table)
    for check in report.checks:
        if check.detail and (not check.passed or check.kind == "continuous"):
            console.print(f"{check.name}: {check.detail}", markup=False, style="" if check.passed else "red")
    for note in report.notes:
        console.print(f"note: {note}", markup=False, style="dim")
    counts = Counter(report.link_geometry.values())
    links = ", ".join(f"{count} as {kind.replace('_', ' ')}" for kind, count in sorted(counts.items()))
    beyond = max(report.over_cover.values(), default=0.0)
    cover = f"; they reach at most {beyond * 1e3:.2g} mm beyond their meshes" if beyond > 0.0 else ""
    console.print(f"links checked: {links}{cover}", markup=False, style="dim")
    console.print("[bold green]verified[/]" if report.verified else "[bold red]not verified[/]")


def _where(check: Check) -> str:
    moment = [] if check.time is None else [f"{check.time:.3f} s"]
    return " ".join([*moment, check.place])


def _number(value: float | None, scale: float) -> str:
    return "–" if value is None else f"{value * scale:.4g}"


def _quality(run: Run) -> str:
    ratio = "" if run.ratio is None else f" · ratio [bold]{run.ratio:.3f}[/]"
    return f"duration [bold]{run.duration:.3f} s[/] · lower bound {run.lower_bound:.3f} s{ratio}"


def _times(run: Run) -> str:
    parts = []
    for name, seconds in run.timings.items():
        inner = _list(run.stages) if name == "plan" else ""
        parts.append(f"{name} {seconds:.2f} s" + (f" ({inner})" if inner else ""))
    return " · ".join(parts)


def _list(stages: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {seconds:.2f}" for name, seconds in stages.items())


def _show_failure(console: Console, failure: Failure) -> None:
    console.print(f"[bold red]no plan[/] ({failure.kind}): {escape(failure.detail)}")
    for key, value in failure.witness.items():
        console.print(f"  {key}: {_short(value)}", markup=False, soft_wrap=True)


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_short(item)}" for key, item in value.items())
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_short, value)) + "]"
    return str(value)
