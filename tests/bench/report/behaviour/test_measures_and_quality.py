"""Every stored number, quality against time, the tables' files, against what is worked out by hand."""

import base64
import csv
import io
import math
import re
import zlib

import numpy as np
import pytest

from optiplan.bench.report.analysis import analyse, analyse_results
from optiplan.bench.report.page import all_tables, write_page
from optiplan.bench.report.quality import _median, best_known
from optiplan.bench.report.tables.cells import Cell, Head, ReportTable
from optiplan.bench.report.tables.formats import as_csv, as_latex, escaped, write_tables
from optiplan.bench.report.tables.measure_tables import digits, measure_table, problem_table, quality_table
from optiplan.bench.results.database import Store
from optiplan.bench.results.measures import load_results

LATE = ("budget", "no path within 5.0 s")


@pytest.fixture
def store(results):
    """Two sets; planner `two` improves its answer on the way, and finds a path on s/b that is lost in timing."""
    runs = {}
    durations = {"s/a": (2.0, 1.0), "s/b": (2.0, None), "s/c": (3.0, 3.0), "t/d": (4.0, 2.0), "t/e": (1.0, 1.5)}
    for name, (one, two) in durations.items():
        runs[name, "one", 0] = (0.2, one)
        runs[name, "two", 0] = LATE if two is None else (2.0, two)
    with Store(results(runs), write=True) as store:
        db = store._db
        db.execute("UPDATE runs SET metrics = json_object('tool_path', duration / 2, 'odd number', 7, 'note', 'x')")
        db.execute("UPDATE runs SET metrics = json_set(metrics, '$.clearance', 0.002) WHERE planner = 'one'")
        db.execute("UPDATE runs SET verify_time = 0.1, memory = 300 WHERE verified")
        answers = "json_array(json_array(0.05, 2 * duration), json_array(2.0, duration))"
        db.execute(f"UPDATE runs SET improvements = {answers} WHERE planner = 'two' AND verified")
        db.execute("UPDATE runs SET planned = 1, timed = 1 WHERE planner = 'two' AND problem = 's/b'")
        yield store


def test_every_stored_number_is_a_measure(store):
    results = load_results(store)
    names = {one.name: one for one in results.measures}
    assert list(names) == [
        *("plan_time", "verify_time", "duration", "ratio", "memory", "tool_path", "clearance", "odd number"),
    ]
    runs = results.runs
    of_one = names["clearance"].values[runs.planner == 0]
    np.testing.assert_allclose(of_one, 2.0)  # mm
    assert names["clearance"].title == "clearance, proved, mm"
    analysis = analyse(store)
    place = [one.name for one in analysis.measures].index("tool_path")
    one, two = analysis.spreads[place]
    assert (one.median.value, two.median.value) == (1.0, 0.875)
    assert two.runs == 4  # what is not verified has no measure
    assert one.lower == pytest.approx(tuple(np.percentile([0.5, 1.0, 1.0, 1.5, 2.0], (5, 25))))


def test_a_set_is_what_its_problems_are(store):
    results = load_results(store)
    part = results.of_set("t")
    assert part.runs.problems == ("t/d", "t/e")
    assert part.runs.planners == results.runs.planners
    assert len(part.answers.run) == 2 + 4
    analysis = analyse_results(part)
    assert [one.runs for one in analysis.planners] == [2, 2]
    assert analysis.planners[1].success.value == 1.0
    np.testing.assert_array_equal(best_known(part.runs, part.answers), [2.0, 1.0])


def test_geometric_success_and_success_after_timing_are_told_apart(store):
    one, two = analyse(store).planners
    assert (one.path_found.value, one.has_times.value, one.success.value) == (1.0, 1.0, 1.0)
    assert (two.path_found.value, two.has_times.value, two.success.value) == (1.0, 1.0, 0.8)
    assert not math.isnan(two.path_found.low)  # of five problems
    table = next(table for table in all_tables(analyse(store)) if table.name == "planners")
    row = dict(zip([head.text for head in table.heads], table.rows[1], strict=True))
    assert row["lost in timing"].key == pytest.approx(0.2)


def test_quality_is_of_all_runs_by_the_best_known(store):
    """By 0.1 s `one` has nothing, `two` twice its end; a run without an answer counts as infinite."""
    one, two = analyse(store).quality.planners
    assert one.answered == (0.0, 1.0, 1.0, 1.0)  # proved at 0.3 s
    assert two.answered == (0.8, 0.8, 0.8, 0.8)
    assert math.isinf(one.ratio[0].value)
    # best known: a 1, b 2, c 3, d 2, e 1; of two: 2, -, 2, 2, 3 at first, 1, -, 1, 1, 1.5 in the end
    assert (two.ratio[0].value, two.ratio[3].value) == (2.0, 1.0)
    assert two.ratio[1].value == 2.0  # its second answers come at 2 s
    assert one.ratio[3].value == 1.0  # 2, 1, 1, 2, 1
    times, ratio = analyse(store).quality.curves[1]
    assert (times[0], times[-1]) == (0.05, 2.0)
    assert math.isinf(ratio[0])
    assert ratio[-1] == 1.0
    table = quality_table(analyse(store))
    assert [head.text for head in table.heads] == ["planner", "by 0.1 s", "by 1 s", "by 10 s", "in the end"]
    assert table.rows[0][1].text == "– 0.0 % answered"


def test_an_interval_that_reaches_runs_without_an_answer_has_no_upper_end():
    """Percentiles lie between resamples, so an end may take a fraction of what stands for no answer."""
    ratio = np.where(np.arange(27) < 18, np.linspace(1.0, 1.2, 27), np.inf)
    value, low, high = _median(ratio, np.arange(27))
    assert (value, low < value, high) == (pytest.approx(1.1), True, math.inf)


def test_tables_of_measures_and_problems(store):
    analysis = analyse(store)
    heads = [head.text for head in measure_table(analysis).heads]
    assert heads[2:] == [one.title for one in analysis.measures]
    table = problem_table(analysis, analysis.runs.problems.index("s/b"))
    assert table.name == "problem-s-b"
    one, two = (dict(zip([head.text for head in table.heads], row, strict=True)) for row in table.rows)
    assert (one["verified"].text, two["verified"].text) == ("1 of 1", "0 of 1")
    assert (one["duration, s"].key, two["duration, s"].text) == (2.0, "–")


def test_csv_has_full_precision_and_intervals(store):
    table = measure_table(analyse(store))
    rows = list(csv.DictReader(io.StringIO(as_csv(table))))
    assert [row["planner"] for row in rows] == ["one", "two"]
    row = rows[0]
    assert float(row["path of the tool, m"]) == 1.0
    assert float(row["path of the tool, m low"]) <= 1.0 <= float(row["path of the tool, m high"])
    assert rows[1]["clearance, proved, mm"] == ""


def test_latex_can_be_set(tmp_path):
    cells = [Cell("<b>a_b</b> &amp; 50 %", "a"), Cell("1.5 <small>[1, 2]</small>", 1.5, interval=(1.0, 2.0))]
    table = ReportTable("some", "What: 100 % of #1", [Head("na{me", words=True), Head("duration, s")], [cells])
    text = as_latex(table)
    assert r"\begin{tabular}{lr}" in text
    assert r"a\_b \& 50 \% & 1.5 [1, 2] \\" in text
    assert r"\caption{What: 100 \% of \#1}" in text
    assert r"na\{me & duration, s \\" in text
    assert text.count("{") - text.count(r"\{") == text.count("}") - text.count(r"\}")
    assert escaped("3 × 2³ < ~") == r"3 $\times$ 2$^3$ $<$ \textasciitilde{}"
    assert [path.name for path in write_tables([table], tmp_path)] == ["some.csv", "some.tex"]


def unpacked(text):
    """The page with what its script unpacks when it is asked for."""
    return re.sub(r'data-packed="([^"]*)">', lambda m: f">{zlib.decompress(base64.b64decode(m[1])).decode()}", text)


def test_every_table_of_the_page_has_its_files(store):
    text = unpacked(write_page(store, analyse(store), pages=0).read_text())
    for table in all_tables(analyse(store)):
        assert f'download="{table.name}.csv"' in text
        assert f'download="{table.name}.tex"' in text
    assert 'data-view="t"' in text


def test_digits():
    values = (0.0, 0.00012, 1.23456, 12.3456, 123.456, 1234.56, math.nan, math.inf)
    assert [digits(value) for value in values] == ["0.000", "0.00012", "1.235", "12.35", "123.5", "1235", "–", "∞"]
