import json

import pytest

from tests.bench.conftest import one_figure_of_measures

__all__ = ["one_figure_of_measures"]
pytestmark = pytest.mark.usefixtures("one_figure_of_measures")


@pytest.fixture
def suite(tmp_path, free):
    path = tmp_path / "mine.yaml"
    data = {"version": 1, "name": "mine", "problems": [{"glob": free.name, "set": "s"}], "planners": ["quintic"]}
    path.write_text(json.dumps(data | {"budget": 2}))
    return path


def test_run_again_and_export(suite, tmp_path, optiplan, optiplan_json):
    code, out, _ = optiplan("bench", suite, "--out", tmp_path / "out", "--workers", 1)
    assert (code, "1 of 1 runs in" in out) == (0, True)
    assert "quintic" in out
    code, data = optiplan_json("bench", suite, "--out", tmp_path / "out")
    assert (code, data["made"], data["found"], data["complete"]) == (0, 0, 1, True)
    assert data["planners"]["quintic"]["verified"] == 1.0
    assert data["planners"]["quintic"]["ratio"] >= 1.0
    code, data = optiplan_json("bench", "export", tmp_path / "out", "--format", "csv", "--to", tmp_path / "tables")
    assert (code, len(data["written"])) == (0, 4)
    assert (tmp_path / "tables" / "runs.csv").read_text().count("\n") == 2


def test_the_folder_is_called_like_the_suite(suite, tmp_path, optiplan, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert optiplan("bench", suite.name, "--workers", 1)[0] == 0
    assert (tmp_path / "runs" / "bench" / "mine" / "results.sqlite").is_file()


def test_bad_input(suite, tmp_path, optiplan):
    code, _, err = optiplan("bench", tmp_path / "no.yaml")
    assert (code, "No such file" in err) == (2, True)
    assert optiplan("bench", "export", tmp_path)[0] == 2
    assert optiplan("bench", suite, "--workers", 0)[0] == 2
    code, _, err = optiplan("bench", "export", tmp_path, "--format", "xml")
    assert (code, "choose from: all, csv, ompl, parquet, problems, robometrics" in err) == (2, True)
    suite.write_text(suite.read_text().replace("quintic", "quintik"))
    code, _, err = optiplan("bench", suite, "--out", tmp_path / "out")
    assert (code, f"{suite}:1: planners[0]" in err, (tmp_path / "out").exists()) == (2, True, False)


def test_help_tells_both_forms(optiplan):
    code, out, _ = optiplan("bench", "--help")
    assert code == 0
    assert "export" in out
    assert "optiplan bench SUITE" in out
