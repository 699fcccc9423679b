def test_good_files_are_ok(optiplan, free):
    assert optiplan("check", free, "01_reach")[:2] == (0, f"{free}: ok\n01_reach: ok\n")


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
