"""Print runs and reports."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from optiplan.planners.base import Failure
from optiplan.runs.run import SMALLEST_BOUND, Run
from optiplan.verify.report import Check, Report

BOUNDS = {
    "problem": "lower bound",
    "end": "bound of this end configuration",
    "stops": "bound of the places where it stops",
}
"""What a lower bound is about, by `Run.lower_bound_of`."""

_REASONS = 6
"""So many reasons to stop are printed; a tour of 60 targets has a reason for each."""


def show_run(console: Console, run: Run, full: bool = False) -> None:
    """Print a run: verdict, quality of the motion, scope of the verdict, and timings."""
    title = f"{run.problem.name} · {run.problem.robot.name} · {run.planner} · seed {run.problem.seed}"
    if run.report is not None:
        show_report(console, run.report, full, title, _quality(run))
    if run.proved_bound is not None:
        holds = run.duration if run.verified else None
        console.print(run.proved_bound.words(holds), markup=False)
        if run.proved_bound.left_out:
            console.print(f"not counted: {', '.join(run.proved_bound.left_out)}", markup=False, style="dim")
    if cost := _cost(run):
        console.print(cost, markup=False)
    if run.failure is not None:
        _show_failure(console, run.failure, title)
    if full and (words := _base(run)):
        console.print(words, markup=False)
    for line in (*_wish(run.info.get("wish")), *_stops(run.info.get("stops", ()), full)):
        console.print(line, markup=False, style="dim")
    console.print(_times(run), markup=False, style="dim")
    for note in _notes(run):
        console.print(f"note: {note}", style="yellow", markup=False, soft_wrap=True)


def _notes(run: Run) -> list[str]:
    """What somebody should know who uses the motion."""
    notes = []
    if run.trajectory is not None and (what := run.info.get("fallback")):
        notes.append(f"no optimised motion was found; this is the {what}, timed")
    if fault := run.info.get("fault"):
        notes.append(f"the planner failed ({fault['error']}); this is the best motion proved before. Please report it")
    return notes + list(run.problem.robot.notes if run.report is None else ())  # a report holds the robot's as well


def show_report(console: Console, report: Report, full: bool = False, title: str = "", quality: str = "") -> None:
    """Print a report: verdict, failed checks and scope.

    Args:
        console: the console.
        report: the verdict.
        full: every check with its worst value, not only those that failed, and the geometry of every link.
        title: text beside the verdict.
        quality: quality of the motion, below the verdict.
    """
    verdict = "[bold green]verified[/]" if report.verified else "[bold red]not verified[/]"
    console.print(verdict + (f" · [bold]{escape(title)}[/]" if title else ""))
    if quality:
        console.print(quality)
    shown = report.checks if full else report.failures
    if shown:
        console.print(_table(shown))
    for check in report.checks:
        if check.detail and (not check.passed or (full and check.kind == "continuous") or check.name == "collision"):
            console.print(f"{check.name}: {check.detail}", markup=False, style="" if check.passed else "red")
    for statement in report.scope:
        console.print(statement, markup=False, style="dim")
    if full:
        links = ", ".join(f"{link} {kind.replace('_', ' ')}" for link, kind in report.link_geometry.items())
        console.print(f"link by link: {links}", markup=False, style="dim")
    for note in report.notes:
        console.print(f"note: {note}", markup=False, style="dim")
    passed = len(report.checks) - len(report.failures)
    if not full and passed:
        checks = "check" if passed == 1 else "checks"
        console.print(f"{passed} {checks} passed (all of them: --full)", markup=False, style="dim")


def _table(checks: Sequence[Check]) -> Table:
    """Checks with their worst values and limits, within 80 columns."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading, side in (("check", "left"), ("", "left"), ("worst", "right"), ("limit", "right"), ("", "left")):
        table.add_column(heading, justify="right" if side == "right" else "left", no_wrap=True)
    table.add_column("where", overflow="fold")
    table.add_column("how", no_wrap=True)
    for check in checks:
        verdict = "[green]pass[/]" if check.passed else "[bold red]FAIL[/]"
        small = check.unit == "m" and max(abs(check.worst or 0.0), abs(check.limit or 0.0)) < 1.0
        scale, unit = (1e3, "mm") if small else (1.0, check.unit)
        table.add_row(escape(check.name), verdict, *_numbers(check, scale), unit, escape(_where(check)), check.kind)
    return table


def _where(check: Check) -> str:
    moment = [] if check.time is None else [f"{check.time:.3f} s"]
    return " ".join([*moment, check.place])


def _numbers(check: Check, scale: float) -> list[str]:
    """Return worst value and limit, with as many digits as show that one is beyond the other, if it is."""
    values = [None if value is None else value * scale for value in (check.worst, check.limit)]
    for digits in range(4, 17):
        texts = ["–" if value is None else f"{value:.{digits}g}" for value in values]
        if check.passed or texts[0] != texts[1]:
            break
    return texts


def _quality(run: Run) -> str:
    """Describe the duration beside its bound, and the scope of the bound."""
    words = f"duration [bold]{run.duration:.3f} s[/]"
    if run.lower_bound is None:
        return words
    if run.lower_bound < SMALLEST_BOUND:
        return f"{words} · no lower bound: it ends where it began"
    whose = BOUNDS[run.lower_bound_of]
    ratio = "" if run.ratio is None else f"[bold]{run.ratio:.3f}[/] × the "
    return f"{words} · {ratio}{whose}, {run.lower_bound:.3f} s"


def _wish(wish: Mapping[str, Any] | None) -> list[str]:
    """Say what became of the clearance that a problem wishes where it requires none; nothing where nobody looked."""
    if wish is None:
        return []
    words, longer = f"the wished clearance of {1e3 * wish['clearance']:g} mm", wish["longer"]
    if wish["kept"]:
        return [f"{words} is kept" + (f", for {longer:.1%} more" if longer > 0.0 else "")]
    why = "no motion was found with" if longer is None else f"{longer:.1%} more would keep"
    return [f"{why} {words}; `clearance: {wish['clearance']:g}` requires it"]


def _cost(run: Run) -> str:
    """Describe what each part of the objective comes to; nothing where only the duration counts."""
    parts = {} if run.metrics is None else run.metrics.objective
    if parts.keys() <= {"time"}:
        return ""
    words = [f"{name} {part['cost']:.4g} ({part['value']:.4g} {part['unit']})" for name, part in parts.items()]
    return f"cost {sum(part['cost'] for part in parts.values()):.4g} s = {' + '.join(words)}"


def _base(run: Run) -> str:
    """Describe what the motion asks of the ground under the base; nothing where masses are unknown."""
    load = None if run.metrics is None else run.metrics.base_load
    if load is None:
        return ""
    words = f"base: up to {load.force:.4g} N and {load.moment:.4g} N·m"
    if load.zero_moment_point is None:
        return f"{words}; the ground would have to pull"
    (x, X), (y, Y) = load.zero_moment_point
    return f"{words}; zero-moment point at x {x:.3f} to {X:.3f} m, y {y:.3f} to {Y:.3f} m"


def _stops(stops: Sequence[Mapping[str, Any]], full: bool) -> list[str]:
    """Say where a task stops and why: how often for the most frequent reasons, or each stop."""
    if full:
        return [f"stops at {stop['t']:.3f} s, after step {stop['after']}: {stop['why']}" for stop in stops]
    counts = Counter(stop["why"] for stop in stops)
    shown = counts.most_common(_REASONS)
    words = [why if count == 1 else f"{why} ({count} times)" for why, count in shown]
    if rest := len(stops) - sum(count for _, count in shown):
        words.append(f"{rest} others (--full)")
    often = "once" if len(stops) == 1 else f"{len(stops)} times"
    return [f"stops {often} on the way: {'; '.join(words)}"] if stops else []


def _times(run: Run) -> str:
    parts = []
    for name, seconds in run.timings.items():
        inner = _list(run.stages) if name == "plan" else ""
        parts.append(f"{name} {seconds:.2f} s" + (f" ({inner})" if inner else ""))
    return " · ".join(parts)


def _list(stages: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {seconds:.2f}" for name, seconds in stages.items())


def _show_failure(console: Console, failure: Failure, title: str) -> None:
    console.print(f"[bold red]no plan[/] · [bold]{escape(title)}[/]")
    console.print(f"{failure.kind}: {failure.detail}", markup=False, style="red")
    for key, value in failure.witness.items():
        if key == "motion":  # polynomials: for the viewer
            continue
        console.print(f"  {key}: {_short(value)}", markup=False, soft_wrap=True)


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_short(item)}" for key, item in value.items())
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_short, value)) + "]"
    return str(value)
