"""`optiplan bench report`, `show`, `compare`, on results of a suite that really ran."""

import json
import shutil
import sqlite3

import pytest

from tests.bench.conftest import one_figure_of_measures

__all__ = ["one_figure_of_measures"]
pytestmark = pytest.mark.usefixtures("one_figure_of_measures")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Where the results are kept for the second test that asks for them."""
    return tmp_path_factory.mktemp("kept") / "out"


@pytest.fixture
def folder(tmp_path, free, shut_in, optiplan, kept):
    suite = tmp_path / "mine.yaml"
    problems = [{"glob": path.name, "set": "s"} for path in (free, shut_in)]
    data = {"version": 1, "name": "mine", "problems": problems, "planners": ["quintic"], "budget": 2}
    suite.write_text(json.dumps(data))
    if not kept.exists():
        code, out, _ = optiplan("bench", suite, "--out", tmp_path / "out", "--workers", 1)
        assert (code, f"report: {tmp_path / 'out' / 'report.html'}" in out) == (0, True)
        shutil.copytree(tmp_path / "out", kept)
    else:
        shutil.copytree(kept, tmp_path / "out")
    return tmp_path / "out"


def test_report_show_and_compare(folder, tmp_path, optiplan, optiplan_json):
    assert "50.0 % verified" in (folder / "report.html").read_text()
    written = ("--out", tmp_path / "page.html", "--markdown", tmp_path / "md" / "t.md", "--figures", tmp_path / "f")
    written += ("--tables", tmp_path / "t", "--pages", 0)
    code, data = optiplan_json("bench", "report", folder, *written)
    assert code == 0
    assert {path.rsplit(".", 1)[1] for path in data["written"]} == {"html", "md", "png", "svg", "pdf", "csv", "tex"}
    assert (tmp_path / "t" / "planners.tex").read_text().startswith("\\begin{table}")
    assert (tmp_path / "t" / "problem-s-free.csv").read_text().startswith("planner,verified,")
    assert "| quintic" in (tmp_path / "md" / "t.md").read_text()
    (scene,) = (tmp_path / "report-scenes").iterdir()
    assert "the motion is not free" in scene.read_text()

    for name, words in (("free", '"badge":"verified"'), ("shut-in", "the motion is not free")):
        page = tmp_path / f"{name}.view.html"
        code, out, _ = optiplan("bench", "show", folder, f"s/{name}", "quintic", "--export", page)
        assert (code, words in page.read_text()) == (0, True)
    code, _, err = optiplan("bench", "show", folder, "s/free", "quintik")
    assert (code, "expected planner quintic; seed 0; repetition 0" in err) == (2, True)
    code, _, err = optiplan("bench", "show", folder, "s/fre", "quintic")
    assert (code, "choose from: s/free, s/shut-in" in err) == (2, True)
    with sqlite3.connect(folder / "results.sqlite") as db:
        db.execute("""UPDATE problems SET data = json_set(data, '$.robot', '/gone/robot.yaml') WHERE id = 's/free'""")
    code, _, err = optiplan("bench", "show", folder, "s/free", "quintic")
    assert (code, f"{folder}: s/free: robot: '/gone/robot.yaml', but there is no file" in err) == (2, True)

    code, data = optiplan_json("bench", "compare", folder, folder, "--gate")
    assert (code, data["common"], data["regressions"], data["notes"]) == (0, 2, [], [])
    code, out, _ = optiplan("bench", "compare", folder, folder)
    assert (code, "2 runs in common" in out) == (0, True)
    assert optiplan("bench", "report", tmp_path)[0] == optiplan("bench", "compare", folder, tmp_path)[0] == 2


def test_results_grow_and_are_shown_together(folder, tmp_path, optiplan, optiplan_json):
    """A planner is added, the addition is refused without --add; copies are merged; two folders make one page."""
    suite = tmp_path / "more.yaml"
    data = json.loads((tmp_path / "mine.yaml").read_text())
    suite.write_text(json.dumps({**data, "name": "more", "planners": ["scurve"]}))
    code, _, err = optiplan("bench", suite, "--out", folder, "--workers", 1)
    assert (code, "--add" in err) == (2, True)
    apart = tmp_path / "apart"
    assert optiplan("bench", suite, "--out", apart, "--workers", 1)[0] == 0
    assert optiplan("bench", "compare", folder, apart, "--gate")[0] == 1  # no run in common
    code, out = optiplan_json("bench", suite, "--out", folder, "--workers", 1, "--add")
    assert (code, out["found"], out["made"], list(out["planners"])) == (0, 0, 2, ["quintic", "scurve"])
    code, out, _ = optiplan("bench", "show", folder, "s/free", "all", "--export", tmp_path / "all.html")
    assert (code, (tmp_path / "all.html").read_text().count('"badge":"verified"')) == (0, 2)

    code, _, err = optiplan("bench", "merge", folder, apart, "--out", tmp_path / "merged")
    assert (code, "2 runs that" in err, "made another time" in err) == (2, True, True)
    assert optiplan("bench", "merge", folder, "--out", tmp_path / "merged")[0] == 2
    code, out = optiplan_json("bench", "merge", folder, folder, "--out", tmp_path / "merged")
    assert (code, out["runs"], out["planners"]) == (0, 4, 2)
    assert optiplan("bench", "merge", folder, apart, "--out", tmp_path / "merged")[0] == 2  # there are results already

    page = tmp_path / "both.html"
    assert optiplan("bench", "report", folder, apart, "--out", page, "--pages", 0)[0] == 0
    text = page.read_text()
    assert "mine + more" in text
    assert "scurve (out)" in text
    assert "scurve (apart)" in text
    assert f"optiplan bench show {apart} s/shut-in scurve 0 0" in text
