"""`optiplan plot` and `op.plot`."""

import pytest

import optiplan as op


def test_a_folder_gets_every_figure(optiplan_json, run, tmp_path):
    code, found = optiplan_json("plot", run, "--out", tmp_path / "figures", "--format", "svg,csv")
    assert code == 0
    names = ["joints.svg", "tool.svg", "path.svg", "curves.csv", "limits.csv"]
    assert found["written"] == [str(tmp_path / "figures" / name) for name in names]
    text = (tmp_path / "figures" / "joints.svg").read_text()
    assert "<text" in text  # letters stay letters
    assert "free: quintic" in text


def test_several_runs_go_into_one_file(optiplan, run, free, shut_in, tmp_path):
    assert optiplan("plan", free, "--planner", "scurve", "--out", tmp_path / "again")[0] == 0
    assert optiplan("plan", shut_in, "--planner", "quintic", "--out", tmp_path / "failed")[0] == 3
    path = tmp_path / "compared.svg"
    code, out, err = optiplan("plot", run, tmp_path / "again", tmp_path / "failed", "--figure", "tool", "--out", path)
    assert code == 0
    assert f"written: {path}" in out
    assert "failed has no trajectory" in " ".join(err.split())
    assert "quintic (run)" in path.read_text()
    assert "scurve (again)" in path.read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--out", "a.jpg"), "ends in .png, .svg, .pdf, .csv, or a folder"),
        (("--figure", "elbow"), "unknown figure 'elbow'"),
        (("--joints", "knee"), "unknown joint 'knee'"),
        (("--format", "gif"), "unknown format 'gif'"),
        (("--out", "a.svg", "--format", "png"), "a folder for several"),
        (("--frames", "-1"), "number ≥ 0"),
        (("--figure", "tool", "--share"), "goes with the figure joints"),
        (("--figure", "path", "--joints", "elbow"), "goes with the figure joints"),
        (("--figure", "joints", "--frames", "9"), "goes with the figure path"),
    ],
)
def test_wrong_wishes_are_named(optiplan, run, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    code, _, err = optiplan("plot", run, *arguments)
    assert code == 2
    assert words in " ".join(err.split())
    assert not (tmp_path / "figures").exists()
    assert not list(tmp_path.glob("a.*"))


def test_a_lecture_needs_no_run(optiplan_json, optiplan, run, tmp_path):
    code, found = optiplan_json(
        "plot", "--style", "textbook", "--figure", "laws,vias", "--out", tmp_path / "lessons.pdf"
    )
    assert code == 0
    assert found["written"] == [str(tmp_path / "lessons.pdf")]
    text = (tmp_path / "lessons.pdf").read_bytes()
    assert text.count(b"/Type /Page\n") + text.count(b"/Type /Page ") == 2
    for arguments, words in (
        (("--out", tmp_path / "a.svg"), "no run with a motion"),
        (("--style", "comic"), "unknown style 'comic'"),
        ((run, "--figure", "laws"), "unknown figure 'laws'"),
        (("--style", "textbook", "--out", tmp_path / "a.csv"), "a run, whose curves a CSV holds"),
        ((run, run, "--style", "textbook", "--figure", "laws"), "2 runs for 'laws'"),
    ):
        code, _, err = optiplan("plot", *arguments)
        assert code == 2
        assert words in " ".join(err.split())


def test_a_run_without_a_motion_is_no_figure(optiplan, shut_in, tmp_path):
    optiplan("plan", shut_in, "--planner", "quintic", "--out", tmp_path / "failed")
    code, _, err = optiplan("plot", tmp_path / "failed")
    assert code == 2
    assert "no run with a motion" in err


def test_from_python(run, tmp_path):
    found = op.load_run(run)
    figure = op.plot(found, run, figure="path", frames=3, out=tmp_path / "path.pdf")
    assert figure.axes[0].name == "3d"
    assert (tmp_path / "path.pdf").read_bytes().startswith(b"%PDF")
    for wrong, words in (
        ({"figure": "elbow"}, "op.plot: figure.*joints, tool, path"),
        ({"joints": ["knee"]}, "op.plot: joints.*'knee'"),
        ({"joints": "elbow"}, "op.plot: joints"),
        ({"frames": 1.5}, "op.plot: frames"),
        ({"out": tmp_path / "a.jpg"}, r"a\.jpg.*\.png"),
    ):
        with pytest.raises(op.InputError, match=words):
            op.plot(found, **wrong)
    with pytest.raises(op.InputError, match=r"op\.plot: runs"):
        op.plot(3)
    with pytest.raises(op.InputError, match=r"op\.plot: runs"):
        op.plot()
    assert "moves by" in op.plot(found, figure="laws", style="textbook").get_suptitle()
    with pytest.raises(op.InputError, match=r"op\.plot: style.*paper, textbook"):
        op.plot(style="comic")
