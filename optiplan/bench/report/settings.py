"""Settings of the runs: machine, versions, options, the suite, and the definition of the times."""

import html
import json
from collections.abc import Mapping
from typing import Any

from optiplan.bench.report.tables.cells import NOTHING, Cell, Head, ReportTable
from optiplan.bench.results.database import Store

MEANING = """
<p>A run is <b>planned</b> when a path was found, <b>timed</b> when it has times, <b>verified</b> when the verifier
proved it free of collisions and within all limits at all times, <b>executed</b> when computed torque followed it
on rigid-body dynamics without contact and with a tool error of at most 1 mm RMS (robots without inertias: not tried).
Percentages are of all runs, failures included; times and durations are of verified runs only.</p>
<p><b>Planning time</b> is wall time from the planner's call to its answer, path and times included; without loading,
warm-up and verification. Runs that shared the machine slowed each other down, see workers and load. The median of one
planner is over the problems that <em>it</em> solves, often the easier ones: compare two planners by the pairwise
tables, on what both solve, or by the performance profiles.</p>
<p><b>Processor time</b> is that of planning alone, with processes that the planner waited for.</p>
<p><b>Duration / bound</b>: no motion to an end configuration can be shorter than its bound by the limits of velocity,
acceleration and jerk. All runs of a problem share one bound, the least over the end configurations that verified runs
reached and those that the problem lists; obstacles may make 1 impossible. Intervals are bootstrap percentiles of whole
problems, 95 %, seed 0: of medians by 1000 resamples, of shares by 10,000. Pairwise tests take a problem's runs
together.</p>
"""


def settings(store: Store) -> str:
    """The last section, as HTML."""
    parts = store.meta("parts")
    given = {name: parts[name] for name in ("seeds", "repetitions", "budget", "limits", "metrics") if name in parts}
    given |= {"suite hash": store.meta("suite_hash"), "schema version": store.meta("schema_version")}
    text = html.escape(str(store.meta("suite")))
    return (
        f"{MEANING}<h3>Settings</h3>{_values(given)}<h3>Planners</h3>{_planners(store)}"
        f"<h3>Sessions</h3>{_sessions(store)}<h3>Versions</h3>{_versions(store)}"
        f"<details><summary>The suite</summary><pre>{text}</pre></details>"
    )


def _values(values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<dt>{html.escape(name)}</dt><dd>{html.escape(_words(value))}</dd>" for name, value in values.items()
    )
    return f"<dl>{rows}</dl>"


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        units = {"wall": " s", "memory": " MB"}
        return ", ".join(f"{key} {_words(item)}{units.get(key, '')}" for key, item in value.items()) or "defaults"
    if isinstance(value, list):
        return ", ".join(map(_words, value))
    return "all" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _planners(store: Store) -> str:
    found = store.query("SELECT label, name, options FROM planners ORDER BY position")
    cells = [(row["label"], row["name"], _words(json.loads(row["options"]))) for row in found]
    heads = [Head(text, words=True) for text in ("planner", "name", "options")]
    rows = [[Cell(html.escape(text), text) for text in row] for row in cells]
    return ReportTable("options", "Planners and their options", heads, rows).html()


def _sessions(store: Store) -> str:
    heads = [Head(text, words=True) for text in ("from", "to", "ended", "workers", "host", "processor", "system")]
    heads += [Head("cores"), Head("memory, MB"), Head("load", "of the machine at the start")]
    rows = []
    for row in store.query("SELECT started_at, ended_at, how, workers, machine FROM sessions ORDER BY session"):
        machine = json.loads(row["machine"])
        words = [
            row["started_at"][:19],
            (row["ended_at"] or "–")[:19],
            row["how"] or "killed or running",
            row["workers"],
        ]
        words += [str(machine.get(name, NOTHING)) for name in ("host", "cpu", "system")]
        numbers = [machine.get(name) for name in ("cores", "memory", "load")]
        cells = [
            Cell("–" if value is None else f"{value:g}" if value < 1e5 else f"{value:.0f}", value) for value in numbers
        ]
        rows.append([*(Cell(html.escape(text), text) for text in words), *cells])
    return ReportTable("sessions", "Sessions in which runs were made", heads, rows).html()


def _versions(store: Store) -> str:
    found = [json.loads(row[0]) for row in store.query("SELECT DISTINCT versions FROM sessions")]
    names = dict.fromkeys(name for one in found for name in one)
    return _values({name: ", ".join(dict.fromkeys(str(one.get(name, NOTHING)) for one in found)) for name in names})
