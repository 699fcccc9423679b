import sys

from optiplan.cli.progress import ProgressLine


def test_good_files_are_ok_whatever_their_names(optiplan, free):
    other = free.rename(free.with_name("[red]cell.yaml"))
    assert optiplan("check", other, "01_reach")[:2] == (0, f"{other}: ok\n01_reach: ok\n")


def test_every_issue_of_every_file_at_once(optiplan, optiplan_json, free, tmp_path):
    text = free.read_text()
    free.write_text(
        text.replace("robot: planar2r", "robot: planar3r").replace("quintic", "{name: 3}").replace("goal", "gaol")
    )
    code, out, err = optiplan("check", free, tmp_path / "nothing.yaml")
    assert (code, out) == (2, "")
    assert "planar2r" in err
    assert "did you mean 'goal'" in err
    assert "planner.name" in err
    assert "no such file" in err
    code, data = optiplan_json("check", free, tmp_path / "nothing.yaml")
    assert code == data["exit_code"] == 2
    assert data["ok"] is False
    assert [len(row["issues"]) >= count for row, count in zip(data["files"], (3, 1), strict=True)] == [True, True]


def test_json_of_good_files(optiplan_json, free):
    code, data = optiplan_json("check", free)
    assert code == 0
    assert data == {"ok": True, "files": [{"file": str(free), "issues": []}], "exit_code": 0}


def test_options_that_do_not_go_with_the_goal(optiplan, free):
    """A good trapezoid for another distance; an arc to where the tool is already; vias are left to the planner."""
    good = free.read_text()
    for planner, told in (
        ("{name: lspb, duration: 18, velocity: 0.02}", "planner.velocity: 0.02 rad/s for joint 'shoulder'"),
        ("{name: circle, radius: 0.1, plane: xz}", "planner.goal: a pose"),
    ):
        free.write_text(good.replace("planner: quintic", f"planner: {planner}"))
        code, _, err = optiplan("check", free)
        assert code == 2
        assert err.startswith(f"{free}:7: {told}")
    free.write_text(
        good.replace("planner: quintic", "via: [{joints: [0.6, 1.1]}]\nplanner: {name: lspb, velocity: -1.0}")
    )
    assert optiplan("check", free)[0] == 0


def test_many_files_are_told_on_the_way(optiplan, free, monkeypatch):
    told = []

    class Line(ProgressLine):
        def __call__(self, stage, fraction):
            told.append((stage, fraction))

    monkeypatch.setattr(sys.modules["optiplan.cli.commands.check"], "ProgressLine", Line)
    assert optiplan("check", free, "01_reach")[0] == 0
    assert told == [(f"checking {free}", 0.0), ("checking 01_reach", 0.5)]
