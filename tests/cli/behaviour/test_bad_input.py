"""Bad input of every kind ends in exit code 2 and a line about the file, never in an internal error."""

import json

import pytest

HELD = "attached: [{name: h, shape: {half_space: {normal: [0, 0, 1]}}, link: forearm, touch: []}]"


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("name: free", 'name: "a\\e[31mb"', 2, "control characters"),
        ("[-1, 0.18, 1]", "[-1, 0.18, 1.0e300]", 6, "1000000"),
        ("{sphere: 0.1}", '{mesh: {file: "a\\0b"}}', 6, "control characters"),
        ("{sphere: 0.1}", "{mesh: {file: " + "a" * 4000 + "}}", 6, "too long"),
        ("{sphere: 0.1}", "{box: }", 6, "'box' without a value"),
        ("obstacles:", f"{HELD}, obstacles:", 6, "no robot can carry a half-space"),
        ("planner: quintic", "planner: quintix", 7, "did you mean 'quintic'"),
        ("planner: quintic", "planner: {name: trajopt, spams: 3}", 7, "did you mean 'spans'"),
        (
            "planner: quintic",
            "planner: {name: trajopt, spans: -3}",
            7,
            "planner.spans: -3; expected a number from 4 to 1000",
        ),
        (
            "planner: quintic",
            "planner: {name: trajopt, solver: foo}",
            7,
            "solver: 'foo'; expected auto or one of ",
        ),
        ("planner: quintic", "planner: {name: rrtconnect, reach: -1.0}", 7, "expected a number > 0"),
        ("planner: quintic", "planner: {name: quintic, 3: 4}", 7, "the key '3'"),
        ("planner: quintic", "planner: {nam: quintic}", 7, "unknown option 'nam' of planner 'trajopt'"),
        ("planner: quintic", "planner: {nam: quintic}", 7, "did you mean 'name'"),
        ("planner: quintic", "planner: [quintic]", 7, "the name of a planner, or {name: …} with its options"),
        ("planner: quintic", "planner:", 7, "the name of a planner, or {name: …} with its options"),
        ("planner: quintic", "planner: {name: quintic, duration: fast}", 7, "'fast'; expected a number"),
        ("planner: quintic", "limits: {velocity: 1.0e-320}", 7, "≥ 1e-06"),
        ("robot: planar2r", "robot: no/robot.yaml", 3, "there is no file"),
        ("robot: planar2r", "robot: " + "a" * 4000, 3, "unknown robot 'aaa"),
        ("name: far", "name: " + "b" * 300, 6, "at most 200 characters"),
    ],
)
def test_it_is_told_with_its_line_by_check_and_plan(optiplan, free, old, new, line, words):
    text = free.read_text()
    assert old in text
    free.write_text(text.replace(old, new))
    for command in ("check", "plan"):
        code, _, err = optiplan(command, free)
        assert code == 2
        assert f"{free}:{line}: " in err
        assert words in err


def test_a_mistyped_key_is_told_the_right_ones(optiplan, free):
    text = free.read_text()
    for key in ("path_constraint", "constraints"):
        free.write_text(f"{text}{key}: []\n")
        code, _, err = optiplan("check", free)
        assert (code, f"unknown key '{key}'" in err) == (2, True)
        assert "path_constraints" in err
    free.write_text(f"{text}path_constraints: []\n")
    assert optiplan("check", free)[0] == 0


def test_joints_that_cannot_be_locked_are_not_suggested(optiplan, free):
    free.write_text(free.read_text() + "locked: {elbo: 1}\n")
    code, _, err = optiplan("check", free)
    assert (code, "unknown joint 'elbo'" in err) == (2, True)
    assert "expected none, since there is none to choose" in err


def test_an_empty_planner_name_is_told_once(optiplan, free):
    free.write_text(free.read_text().replace("planner: quintic", "planner: {name: ''}"))
    code, _, err = optiplan("check", free)
    assert (code, err.count("\n")) == (2, 1)


def test_a_broken_mesh_is_told_in_one_line(optiplan, free):
    (free.parent / "m.stl").write_bytes(b"")
    free.write_text(free.read_text().replace("{sphere: 0.1}", "{mesh: {file: m.stl}}"))
    code, _, err = optiplan("check", free)
    assert (code, err.count("\n")) == (2, 1)
    assert "an empty file" in err


def test_a_motion_of_days_is_planned_and_written_in_seconds(optiplan, free, tmp_path):
    free.write_text(free.read_text() + "limits: {velocity: 1.0e-6}\n")
    for planner in ("quintic", "rrtconnect"):
        assert optiplan("plan", free, "--planner", planner, "--out", tmp_path / planner)[0] == 0
    assert len(json.loads((tmp_path / "quintic" / "trajectory.json").read_text())["t"]) <= 60_000


def test_out_that_cannot_work_is_told_before_planning(optiplan, free, tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nothing" / "there")
    (tmp_path / "full" / "run.json").mkdir(parents=True)
    for name, words in (("link", "a link to nothing"), ("full", "run.json is a folder")):
        code, out, err = optiplan("plan", free, "--out", tmp_path / name)
        assert (code, out) == (2, "")
        assert words in err


@pytest.mark.parametrize("edit", [{"report": 3}, {"failure": "x"}, {"planner": []}, {"report": {"checks": [1]}}])
def test_a_run_json_of_wrong_types_is_bad_input(optiplan, free, tmp_path, edit):
    assert optiplan("plan", free, "--out", tmp_path / "run")[0] == 0
    record = tmp_path / "run" / "run.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | edit))
    code, _, err = optiplan("view", tmp_path / "run", "--export", tmp_path / "page.html")
    assert code == 2
    assert str(record) in err


def test_a_run_json_without_its_verdict_is_shown_as_not_checked(optiplan, free, tmp_path):
    assert optiplan("plan", free, "--out", tmp_path / "run")[0] == 0
    record = tmp_path / "run" / "run.json"
    data = json.loads(record.read_text())
    record.write_text(json.dumps({key: data[key] for key in ("problem", "hash")}))
    assert optiplan("view", tmp_path / "run", "--export", tmp_path / "page.html")[0] == 0
    assert "not checked" in (tmp_path / "page.html").read_text()


def test_a_number_of_thousands_of_digits_is_bad_input(optiplan, free, tmp_path):
    (tmp_path / "t.json").write_text('{"pieces": ' + "9" * 5000 + "}")
    assert optiplan("verify", free, tmp_path / "t.json")[0] == 2


def test_json_before_the_subcommand_and_for_srdf(optiplan, optiplan_json, tmp_path):
    assert json.loads(optiplan("robots", "--json", "show", "planar2r")[1])["name"] == "planar2r"
    assert optiplan_json("robots", "srdf", "planar2r", tmp_path / "p.srdf")[1]["written"] == str(tmp_path / "p.srdf")
    code, _, err = optiplan("robots", "srdf", "planar2r", tmp_path)
    assert (code, err) == (2, f"{tmp_path}: file: is a directory; expected a file, not a folder\n")


def test_a_file_of_another_kind_is_told_in_one_line(optiplan, free, tmp_path):
    robot, suite = tmp_path / "robot.yaml", tmp_path / "suite.yaml"
    robot.write_text("version: 1\nname: mine\nurdf: a.urdf\n")
    suite.write_text("version: 1\nproblems: [{file: free.yaml}]\nplanners: [quintic]\n")
    for command, file, found, expected in (
        (("plan",), robot, "a robot file", "a problem file"),
        (("check",), suite, "a suite file", "a problem file"),
        (("robots", "show"), free, "a problem file", "a robot file"),
        (("bench",), free, "a problem file", "a suite file"),
    ):
        code, _, err = optiplan(*command, file)
        assert (code, err) == (2, f"{file}:1: file: {found}; expected {expected}\n")


def test_a_folder_where_a_file_is_written_is_told(optiplan, tmp_path):
    code, out, err = optiplan("robots", "export", "planar2r", tmp_path)
    assert (code, out) == (2, "")
    assert err == f"{tmp_path}: file: is a directory; expected a file, not a folder\n"


@pytest.mark.parametrize("floor", ["nan", "inf", "-inf"])
def test_a_floor_that_is_no_height_is_refused(optiplan, floor):
    code, out, err = optiplan("workspace", "planar2r", "--samples", "10", f"--floor={floor}")
    assert (code, out) == (2, "")
    assert "--floor" in err
    assert "a height in m" in err
