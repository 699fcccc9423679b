"""Numbers of a report against ones worked out by hand; the page's text; figures; the table for READMEs."""

import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.failures import EXAMPLES, alike, reasons
from optiplan.bench.report.figures import figures, inline_svg, measure_figures, write_figures
from optiplan.bench.report.headline import cards, facts, warnings
from optiplan.bench.report.page import write_page
from optiplan.bench.report.tables.cells import number, percent
from optiplan.bench.report.tables.formats import markdown
from optiplan.bench.results.database import Store
from optiplan.figure_style import COLOURS, line_of

TIGHT = ("budget", "no path within 5.0 s, 'arm' stuck", {"q": [0.1, 0.2], "points": [[0.1, 0.2, 0.3]]})
RUNS = {
    ("s/a", "one", 0): (1.0, 2.0),
    ("s/a", "two", 0): (2.0, 1.0),
    ("s/a", "<three>", 0): TIGHT,
    ("s/b", "one", 0): (3.0, 2.0),
    ("s/b", "two", 0): ("budget", "no path within 7 s, 'leg' stuck"),
    ("s/b", "<three>", 0): ("crashed (signal 11)", "the process ended"),
    ("t/c", "one", 0): (1.0, 3.0),
    ("t/c", "two", 0): (4.0, 3.0),
    ("t/c", "<three>", 0): TIGHT,
    ("t/d", "one", 0): TIGHT,
    ("t/d", "two", 0): TIGHT,
    ("t/d", "<three>", 0): TIGHT,
}


@pytest.fixture
def store(results):
    def labelled(problem):
        return replace(problem, difficulty="easy" if problem.id == "s/a" else None)

    with Store(results(RUNS, problem=labelled)) as store:
        yield store


def test_numbers_of_planners(store):
    one, two, three = analyse(store).planners
    assert [(p.runs, p.planned, p.timed, p.verified, p.executed) for p in (one, two, three)] == [
        (4, 3, 3, 3, None),
        (4, 2, 2, 2, None),
        (4, 0, 0, 0, None),
    ]
    assert two.success.value == 0.5
    assert math.isnan(two.success.low)  # of four problems
    assert one.plan_time.median.value == 1.0
    assert one.plan_time.percentiles == pytest.approx((1.0, 2.0, 2.8, 2.96))
    assert one.ratio.percentiles[0] == 4.0
    assert three.plan_time.runs == 0
    assert math.isnan(three.plan_time.percentiles[0])
    assert [p.quickest for p in (one, two, three)] == [0.75, 0.0, 0.0]  # of all tasks, also that nobody solved
    assert [p.shortest for p in (one, two, three)] == [0.5, 0.5, 0.0]


def test_a_run_that_a_controller_followed_is_told(store):
    store._db.execute("UPDATE runs SET executed = verified WHERE planner = 'two'")
    assert [p.executed for p in analyse(store).planners] == [None, 2, None]


def test_parts(store):
    analysis = analyse(store)
    assert [(part.name, part.problems) for part in analysis.sets] == [("s", 2), ("t", 2)]
    assert [share.value for share in analysis.sets[0].success] == [1.0, 0.5, 0.0]
    assert analysis.sets[1].plan_time[:2] == (1.0, 4.0)
    assert math.isnan(analysis.sets[1].ratio[2])
    assert [(part.name, part.problems) for part in analysis.difficulties] == [("easy", 1), ("no label", 3)]


def test_difficulties_are_in_the_order_that_people_expect(results):
    labels = iter(["odd", "hard", "easy", None, "medium"])
    runs = {(f"s/{k}", "one", 0): TIGHT for k in range(5)}
    with Store(results(runs, problem=lambda one: replace(one, difficulty=next(labels)))) as store:
        names = [part.name for part in analyse(store).difficulties]
    assert names == ["easy", "medium", "hard", "odd", "no label"]


def test_pairs_are_of_what_both_solve(store):
    pair = analyse(store).pairs[0]
    assert (pair.first, pair.second, pair.problems, pair.only_first, pair.only_second) == ("one", "two", 2, 1, 0)
    assert pair.plan_time.ratio.value == pytest.approx(math.exp(0.5 * (math.log(1 / 2) + math.log(1 / 4))))
    assert (pair.plan_time.wins, pair.plan_time.losses, pair.plan_time.sign) == (2, 0, 0.5)
    assert (pair.duration.wins, pair.duration.losses) == (0, 1)
    assert analyse(store).pairs[1].problems == 0


def test_runs_of_a_problem_are_one_pair(results):
    runs = {("s/a", label, seed): (time, 1.0) for label, time in (("one", 1.0), ("two", 2.0)) for seed in range(9)}
    with Store(results(runs)) as store:
        (pair,) = analyse(store).pairs
    assert (pair.problems, pair.plan_time.wins, pair.plan_time.sign) == (1, 1, 1.0)


def test_failures_are_grouped_by_what_they_say(store):
    found = reasons(store)
    assert [(one.kind, one.words, one.runs, one.problems) for one in found] == [
        ("budget", "no path within … s, … stuck", 6, 4),
        ("crashed (signal 11)", "the process ended", 1, 1),
    ]
    assert found[0].planners == {"<three>": 3, "two": 2, "one": 1}
    assert {run.planner for run in found[0].examples[:3]} == {"<three>", "one", "two"}
    assert [run.seen for run in found[1].examples] == [False]
    assert alike("at -1.5e-3 m of joint_1\nmore") == "at … m of joint_1"


def test_many_failures_are_listed_in_part(results):
    runs = {(f"s/{k}", "one", 0): ("budget", f"none in {k} s") for k in range(40)}
    with Store(results(runs)) as store:
        (reason,) = reasons(store)
        assert (reason.runs, len(reason.examples)) == (40, EXAMPLES)
        assert "12 of 40 runs" in write_page(store, analyse(store), pages=0).read_text()


def test_headline(store):
    analysis = analyse(store)
    assert facts(store, analysis) == "4 problems × 3 planners: 12 runs, 41.7 % verified"
    reliable, quick, short = cards(analysis)
    assert reliable[:2] == ("Most reliable", "one")
    assert reliable[2] == "verified 75.0 %: 3 of 4 runs"
    assert quick[1] == "one"
    assert short[1] == "one · two"
    (fault,) = warnings(store, analysis)
    assert fault.startswith("1 runs ended by a fault")


def test_what_is_missing_or_mixed_is_told(store):
    store._db.execute("DELETE FROM runs WHERE problem = 't/d' AND planner = 'one'")
    store._db.execute("UPDATE runs SET cut_short = 1 WHERE planner = 'two'")
    store._db.execute("INSERT INTO sessions SELECT 2, started_at, NULL, NULL, workers, '{}', versions FROM sessions")
    analysis = analyse(store)
    text = "\n".join(warnings(store, analysis))
    assert "1 of 12 runs are missing" in text
    assert "work in 4 runs" in text
    assert "several machines" in text
    assert analysis.common == 3


def test_motions_without_a_bound_are_not_ranked_by_it(store):
    store._db.execute("UPDATE runs SET lower_bound = 0")  # the robot need not move
    assert [card[0] for card in cards(analyse(store))] == ["Most reliable", "Quickest to plan, median"]
    assert "Shortest motions" not in write_page(store, analyse(store), pages=0).read_text()
    store._db.execute("UPDATE runs SET plan_time = NULL")  # nor by a time that nobody took
    assert [card[0] for card in cards(analyse(store))] == ["Most reliable"]
    assert "Quickest to plan" not in write_page(store, analyse(store), pages=0).read_text()


class Reader(HTMLParser):
    """What a page refers to, and whether its tags are closed."""

    def __init__(self):
        super().__init__()
        self.addresses, self.open, self.ids = [], [], []

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "link", "br", "path", "use", "input", "wbr"):
            self.open.append(tag)
        for name, value in attributes:
            if name in ("href", "src", "xlink:href"):
                self.addresses.append(value)
            if name == "id":
                self.ids.append(value)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if self.open and self.open[-1] == tag:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in ("path", "use", "input", "wbr"):
            assert self.open.pop() == tag


def test_page_is_whole_and_asks_for_nothing(store):
    page = write_page(store, analyse(store), pages=1)
    text = page.read_text()
    reader = Reader()
    reader.feed(text)
    assert reader.open == []
    assert len(reader.ids) == len(set(reader.ids))
    outside = [a for a in reader.addresses if not a.startswith(("#", "data:", "report-scenes/"))]
    assert outside == []
    assert not re.search(r"@import|url\((?!#)", text)
    scenes = [page.parent / a.split("#")[0] for a in reader.addresses if a.startswith("report-scenes/")]
    assert len(set(scenes)) == 2 + 1  # a failure of each reason, a page of one problem
    assert all("meshcat" in scene.read_text() for scene in scenes)


def test_names_are_escaped(store):
    text = write_page(store, analyse(store), pages=0).read_text()
    assert "&lt;three&gt;" in text
    assert "<three>" not in text
    assert "made &lt;up&gt;" in text
    assert "a: &lt;b&gt;" in text
    assert f"optiplan bench show {store.folder} t/d &#x27;&lt;three&gt;&#x27; 0 0" in text
    assert "not tried" in text


def test_results_without_runs_or_successes_have_a_page(results):
    with Store(results({("s/a", "one", 0): TIGHT})) as store:
        page = write_page(store, analyse(store), pages=0)
        assert "verified 0.0 %" in page.read_text()
        store._db.execute("DELETE FROM runs")
        analysis = analyse(store)
        assert "No runs yet" in write_page(store, analysis, pages=0).read_text()
        assert "| one" in markdown(analysis)


def test_figures_as_files_and_in_the_page(store, tmp_path, monkeypatch):
    analysis = analyse(store)
    written = write_figures(analysis, tmp_path / "figures")
    names = [figure.name for figure in figures(analysis)]
    names += [figure.name for figure in measure_figures(analysis)]
    kinds = ("png", "svg", "pdf")
    assert sorted(path.name for path in written) == sorted(f"{n}.{kind}" for n in names for kind in kinds)
    assert names[:2] == ["ladder", "success-over-time"]
    assert "quality-over-time" in names
    assert names[-1] == "measure-duration"
    first = (tmp_path / "figures" / "ladder.svg").read_bytes()
    found = figures(analysis)
    monkeypatch.setattr("optiplan.bench.report.figures.figures", lambda _: found[:1])
    monkeypatch.setattr("optiplan.bench.report.figures.measure_figures", lambda _: [])
    write_figures(analysis, tmp_path / "figures")
    assert (tmp_path / "figures" / "ladder.svg").read_bytes() == first
    svg = inline_svg(found[1], analysis)
    assert "currentColor" in svg
    assert "&lt;three&gt;" in svg
    assert not any(colour in svg for colour in COLOURS)
    assert "success-over-time-planner1" in svg


def test_lines_of_28_planners_differ():
    assert len({line_of(k) for k in range(28)}) == 28


def test_markdown_table(store):
    head, rule, one, _, three = markdown(analyse(store)).splitlines()[:5]
    assert [cell.strip() for cell in one.split("|")[1:6]] == ["one", "4", "75.0 %", "75.0 %", "75.0 %"]
    assert [cell.strip() for cell in three.split("|")[7:10]] == ["–", "–", "–"]
    assert len(head) == len(rule) == len(one)


def test_words_for_numbers():
    assert [percent(x) for x in (0.0, 0.0001, 0.5, 0.9999, 1.0, np.nan)] == [
        *("0.0 %", "0.1 %", "50.0 %", "99.9 %", "100.0 %", "–"),
    ]
    assert [number(x) for x in (None, np.nan, 12.34567)] == ["–", "–", "12.346"]
