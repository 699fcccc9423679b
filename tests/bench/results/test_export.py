import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from optiplan.bench.results.database import Store
from optiplan.bench.results.export import TABLES, export_results, write_metrics, write_problems
from optiplan.bench.results.records import COLUMNS
from optiplan.bench.sources.generate import GENERATORS
from optiplan.bench.suite.schema import KINDS
from optiplan.errors import OptiPlanError
from optiplan.problem.load import load_problem

DOCS = Path(__file__).parents[3] / "docs" / "how-to" / "benchmarks.md"


@pytest.fixture
def results(results_of, tmp_path):
    results_of(count=2, seeds=[0, 7])
    with Store(tmp_path / "out") as store:
        yield store


def test_csv(results, tmp_path):
    written = export_results(results, tmp_path / "tables", "csv")
    assert [path.name for path in written] == [f"{table}.csv" for table in TABLES]
    with written[0].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["problem"], row["seed"], row["verified"]) for row in rows] == [
        ("plain/p0", "0", "1"),
        ("plain/p0", "7", "0"),
        ("plain/p1", "0", "1"),
        ("plain/p1", "7", "0"),
    ]
    assert json.loads(rows[1]["witness"]) == {"q": [0.5, 1.0]}
    assert (rows[0]["failure_kind"], rows[0]["executed"], rows[1]["executed"]) == ("", "1", "")
    assert float(rows[0]["ratio"]) >= 1.0


def test_parquet_is_what_the_database_holds_and_duckdb_reads_it(results, tmp_path):
    duckdb = pytest.importorskip("duckdb")
    pytest.importorskip("pyarrow")
    files = {path.stem: path for path in export_results(results, tmp_path / "tables", "parquet")}
    ask = duckdb.connect().execute
    sql = (
        f"SELECT planner, avg(verified::INT), count(*) FILTER (WHERE verified) FROM '{files['runs']}' GROUP BY planner"
    )
    assert ask(sql).fetchall() == [("bench_planners:Straight", 0.5, 2)]
    stored = [tuple(row) for row in results.query("SELECT * FROM rated ORDER BY problem, planner, seed, repetition")]
    assert ask(f"SELECT * FROM '{files['runs']}'").fetchall() == stored
    assert ask(f"SELECT id FROM '{files['problems']}' ORDER BY position").fetchall() == [("plain/p0",), ("plain/p1",)]
    sql = f"SELECT json_extract(machine, '$.cores')::INT FROM '{files['sessions']}'"
    assert ask(sql).fetchone()[0] >= 1


def test_the_query_of_the_documentation_runs(results, tmp_path):
    duckdb = pytest.importorskip("duckdb")
    pytest.importorskip("pyarrow")
    export_results(results, tmp_path / "tables", "parquet")
    (query,) = re.findall(r"```sql\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert "'results/quick/runs.parquet'" in query
    found = duckdb.connect().execute(query.replace("results/quick", str(tmp_path / "tables"))).fetchall()
    times = [row[0] for row in results.query("SELECT plan_time FROM runs WHERE verified")]
    assert found == [("bench_planners:Straight", 0.5, pytest.approx(np.percentile(times, 95)))]


def test_the_documentation_names_every_source_column_and_table():
    text = DOCS.read_text(encoding="utf-8")
    for name in (*KINDS, *COLUMNS, "problem_bound", *TABLES):
        assert f"`{name}`" in text, name
    for name in GENERATORS:
        assert f"`{name}`" in text, name


def test_problems_can_be_planned_again(results, tmp_path):
    written = write_problems(results, tmp_path / "again")
    assert [str(path.relative_to(tmp_path)) for path in written] == [
        "again/problems/plain/p0.yaml",
        "again/problems/plain/p1.yaml",
    ]
    assert [load_problem(path).hash for path in written] == [results.problem(f"plain/p{k}").hash for k in range(2)]


def test_without_pyarrow_parquet_says_what_is_missing(results, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(OptiPlanError, match=r"pip install 'optiplan\[results\]'"):
        export_results(results, tmp_path / "tables", "parquet")
    assert list((tmp_path / "tables").iterdir()) == []


def test_planners_of_like_names_have_files_of_their_own(write_results, tmp_path):
    folder = write_results(tmp_path / "out", {("s/a", label, 0): (1.0, 2.0) for label in ("a:b", "a_b")})
    with Store(folder) as store:
        assert [path.name for path in write_metrics(store, folder)] == ["a_b.json", "a_b_.json"]
