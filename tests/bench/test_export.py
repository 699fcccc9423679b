import csv
import json

import pytest

from optiplan.bench.export import TABLES, export, write_problems
from optiplan.bench.store import Store
from optiplan.errors import OptiPlanError
from optiplan.problem.load import load_problem


@pytest.fixture
def results(write_suite, run, tmp_path):
    run(write_suite(count=2, seeds=[0, 7]))
    with Store(tmp_path / "out") as store:
        yield store


def test_csv(results, tmp_path):
    written = export(results, tmp_path / "tables", "csv")
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
    assert (rows[0]["failure_kind"], rows[0]["executed"]) == ("", "")
    assert float(rows[0]["ratio"]) >= 1.0


def test_parquet_is_what_the_database_holds_and_duckdb_reads_it(results, tmp_path):
    duckdb = pytest.importorskip("duckdb")
    pytest.importorskip("pyarrow")
    files = {path.stem: path for path in export(results, tmp_path / "tables", "parquet")}
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
        export(results, tmp_path / "tables", "parquet")
    assert list((tmp_path / "tables").iterdir()) == []
