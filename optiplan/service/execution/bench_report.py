"""The report of a bench: the records of its runs as results of a suite, and the page that is made of those."""

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from optiplan.bench.execution.machine import machine
from optiplan.bench.execution.run_task import hash_and_pack
from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.failures import reasons
from optiplan.bench.report.matrix import ProblemRow, matrix_rows
from optiplan.bench.report.page import Links, render
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import BenchPlanner, BenchProblem, Outcome, Row, failure
from optiplan.bench.suite.suite import code_of, hash_of_parts
from optiplan.planners.base import Progress
from optiplan.runs.run import versions
from optiplan.trajectory.trajectory import Trajectory

SET = "bench"
ROOT = "../../.."
"""From the address of a report, `/api/benches/ID/report.html`, to that of the server, which may lie below a path."""
MOST = 8
"""Runs that are compared on one page."""


def bench_report(suite: Mapping[str, Any], runs: Sequence[Mapping[str, Any]], progress: Progress) -> str:
    """The page.

    Args:
        suite: `name`, `budget`, `seeds`, `problems` (name, hash), `planners` (label, name, options).
        runs: `key` (problem, planner, seed), `id`, and the texts of `run` (run.json) and `trajectory`, empty without.
        progress: told what is drawn.
    """
    records = [(one, json.loads(one["run"])) for one in runs]
    sources = {one["key"][0]: record["problem"] for one, record in records}
    problems = tuple(
        BenchProblem(one["name"], SET, None, one["hash"], sources[one["name"]], {})
        for one in suite["problems"]
        if one["name"] in sources
    )
    planners = tuple(BenchPlanner(one["label"], one["name"], one["options"] or {}) for one in suite["planners"])
    with tempfile.TemporaryDirectory() as folder:
        store = Store.create(Path(folder) / "results", _meta(suite, problems, planners))
        with store:
            store.fill(problems, planners)
            store.begin("the service", machine(), versions())
            for one, record in records:
                store.add(_outcome(one, record))
            store.end("complete")
        with Store(Path(folder) / "results") as stored:
            analysis = analyse(stored)
            rows = matrix_rows(stored, analysis, progress)
            ids = {tuple(one["key"]): one["id"] for one in runs}
            compared = {row.name: _compared(row, ids) for row in rows}
            links = Links(lambda run: f"{ROOT}/runs/{ids[run.problem, run.planner, run.seed]}", compared.get)
            return render(stored, analysis, reasons(stored), rows, links)


def _compared(row: ProblemRow, ids: Mapping[tuple[Any, ...], str]) -> str:
    """The address of the runs that stand for the planners on a problem, with their labels in the report."""
    shown = [(ids[problem, label, seed], label) for problem, label, seed, _ in row.keys()[:MOST]]
    return f"{ROOT}/compare?" + urlencode([pair for one in shown for pair in zip(("run", "label"), one, strict=True)])


def _meta(
    suite: Mapping[str, Any], problems: Sequence[BenchProblem], planners: Sequence[BenchPlanner]
) -> dict[str, Any]:
    parts = {
        "planners": {planner.label: [planner.name, dict(planner.options)] for planner in planners},
        "seeds": suite["seeds"],
        "repetitions": 1,
        "budget": suite["budget"],
        "limits": None,
        "metrics": None,
        "problems": {problem.id: [problem.hash, problem.set_name, None] for problem in problems},
    }
    text = json.dumps({key: suite[key] for key in ("name", "budget", "seeds", "planners")}, indent=1)
    meta = {"name": suite["name"], "suite": text, "suite_hash": hash_of_parts(parts), "parts": parts}
    return meta | {"code": code_of(planners)}


def _outcome(one: Mapping[str, Any], record: Mapping[str, Any]) -> Outcome:
    """The row of a run, of its record."""
    problem, label, seed = one["key"]
    motion = Trajectory.from_dict(json.loads(one["trajectory"])) if one["trajectory"] else None
    digest, blob = hash_and_pack(motion)
    timings, failed = record["timings"], record["failure"]
    row = {
        "planned": motion is not None or bool(record["info"].get("path_found")),
        "timed": motion is not None,
        "verified": record["verified"],
        "plan_time": timings.get("plan"),
        "verify_time": timings.get("verify"),
        "plan_cpu": timings.get("plan_cpu"),
        "duration": record["duration"],
        "lower_bound": record["lower_bound"],
        "metrics": record["metrics"] or {},
        "timings": timings,
        "info": record["info"],
        "improvements": record["improvements"],
        "cut_short": bool(record["info"].get("cut_short")),
        "trajectory": digest,
    }
    if failed is not None:
        row |= failure(failed["kind"], failed["detail"], failed["witness"])
    elif not record["verified"]:
        refused = [check for check in record["report"]["checks"] if not check["passed"]]
        row |= failure("not-verified", ", ".join(check["name"] for check in refused))
    return Outcome(Row(problem, label, seed, 0, SET, None, **row), blob)
