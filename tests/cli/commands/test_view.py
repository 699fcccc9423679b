import json
import re
import shutil
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

import optiplan as op
from optiplan.cli import viewing
from optiplan.cli.commands.view import ADDRESS


def test_export_writes_one_page(optiplan, run, tmp_path):
    page = tmp_path / "pages" / "view.html"
    code, out, _ = optiplan("view", run, "--export", page)
    assert code == 0
    assert str(page) in out
    assert "<html" in page.read_text()
    assert "quintic" in page.read_text()


def test_runs_of_one_problem_go_side_by_side(optiplan, run, tmp_path):
    shutil.copytree(run, tmp_path / "again")
    problem, shown = viewing.open_runs([run, tmp_path / "again"])
    assert problem.name == "free"
    assert [one.label for one in shown] == ["quintic (run)", "quintic (again)"]
    shutil.copytree(run, tmp_path / "old" / "run")
    _, shown = viewing.open_runs([run, tmp_path / "old" / "run"])
    assert [one.label for one in shown] == [f"quintic (run) ({tmp_path.name}/run)", "quintic (run) (old/run)"]


def test_every_key_of_the_pages_address_is_known_and_documented():
    scripts = resources.files("optiplan.viewer") / "web"
    text = "".join(path.read_text("utf-8") for path in Path(str(scripts)).rglob("*.js"))
    assert set(re.findall(r"wish\.(?:has|get|list)\(\"(\w+)\"\)", text)) == set(ADDRESS)
    written = re.findall(r"parts\.push\([^;]*\);", text)
    assert set(re.findall(r"[`\"](\w+)(?:=|\")", "".join(written))) <= set(ADDRESS)
    table = (Path(__file__).parents[3] / "docs" / "how-to" / "browser.md").read_text("utf-8")
    assert all(re.search(rf"`{key}[=&`]|&{key}`", table) for key in ADDRESS)


def test_runs_of_different_problems_of_one_robot_go_together(optiplan, run, free, tmp_path):
    free.write_text(free.read_text().replace("name: free", "name: other"))
    assert optiplan("plan", free, "--out", tmp_path / "other")[0] == 0
    page = tmp_path / "both.html"
    assert optiplan("view", run, tmp_path / "other", "--export", page)[0] == 0
    text = page.read_text()
    assert '"several":true' in text
    assert "free" in text
    assert "other" in text


def test_runs_of_different_robots_are_refused(optiplan, run, free, tmp_path):
    record = json.loads((run / "run.json").read_text())
    other = op.load_problem("01_reach")
    record |= {"problem": dict(other.source), "hash": other.hash}
    shutil.copytree(run, tmp_path / "panda")
    (tmp_path / "panda" / "run.json").write_text(json.dumps(record, default=str))
    code, _, err = optiplan("view", run, tmp_path / "panda")
    assert code == 2
    assert "a run of the robot 'panda'" in err


def test_a_run_whose_robot_is_gone_is_named(optiplan, run):
    file = run / "run.json"
    record = json.loads(file.read_text())
    file.write_text(json.dumps(record | {"problem": record["problem"] | {"robot": "/gone/robot.yaml"}}))
    for command in (("view", run, "--export", "page.html"), ("export", run, "--to", "csv")):
        code, _, err = optiplan(*command)
        assert code == 2
        assert err.startswith(f"{file}: robot: '/gone/robot.yaml', but there is no file /gone/robot.yaml")


def test_a_lone_trajectory_cannot_be_shown(optiplan, run, tmp_path):
    shutil.copy(run / "trajectory.json", tmp_path / "mine.json")
    code, _, err = optiplan("view", tmp_path / "mine.json")
    assert code == 2
    assert "expected a run folder" in err


@pytest.mark.parametrize("command", ["plan", "view"])
def test_serving_prints_the_address(optiplan, run, free, monkeypatch, command):
    def serve(problem, runs, port, on_ready):
        assert [one.label for one in runs] == ["quintic"]
        on_ready(f"http://127.0.0.1:{port}/")

    monkeypatch.setattr(viewing, "serve_runs", serve)
    monkeypatch.setattr(viewing.signal, "signal", lambda *_: None)
    code, out, _ = optiplan("plan", free, "--view") if command == "plan" else optiplan("view", run)
    assert code == 0
    assert "open http://127.0.0.1:7000/ in a browser" in out
    if command == "plan":
        _, out, err = optiplan("plan", free, "--view", "--json")
        assert json.loads(out)["exit_code"] == 0
        assert "open http://127.0.0.1:7000/ in a browser" in err


def test_scripts_draw_where_it_is_said(optiplan, run, monkeypatch, tmp_path):
    monkeypatch.setattr(viewing.signal, "signal", lambda *_: None)
    monkeypatch.setattr(viewing, "serve_until_interrupted", lambda server, on_ready: on_ready())
    code, out, _ = optiplan("view", run, "--port", "0", "--meshcat-port", "0")
    assert code == 0
    assert 'meshcat.Visualizer("tcp://127.0.0.1:' in out
    code, _, err = optiplan("view", run, "--meshcat-port", "0", "--export", tmp_path / "page.html")
    assert code == 2
    assert "no --export, --png and --gif beside it" in err
    with op.view(run, block=False, port=0, meshcat_port=0) as shown:
        assert shown.meshcat_url.startswith("tcp://127.0.0.1:")
        assert "&quot;drawn&quot;:{&quot;messages&quot;:[]" in shown._repr_html_()
    with op.view(run, block=False, port=0) as shown:
        assert shown.meshcat_url is None
    with pytest.raises(op.InputError, match="meshcat_port"):
        op.view(run, block=False, meshcat_port=70000)


def test_a_trajectory_changed_since_does_not_wear_the_old_verdict(run):
    assert viewing.open_runs([run])[1][0].report["verified"]
    motion = json.loads((run / "trajectory.json").read_text())
    motion["pieces"]["breakpoints"] = [0.5 * t for t in motion["pieces"]["breakpoints"]]
    (run / "trajectory.json").write_text(json.dumps(motion))
    assert not viewing.open_runs([run])[1][0].report["verified"]


def test_export_to_a_folder_says_what_to_give(optiplan, run, tmp_path):
    code, out, err = optiplan("view", run, "--export", tmp_path)
    assert (code, out) == (2, "")
    assert err == f"{tmp_path}: export: is a folder; expected a file to write, such as page.html\n"


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--png", "page.jpg", ".png"),
        ("--gif", "film.avi", ".gif or .webp or .mp4"),
        ("--export", "page.mcpa", ".html or .htm or .mcap or .rrd"),
        ("--size", "big", "such as 1280x800"),
        ("--at", "0.3", "such as t=0.4"),
    ],
)
def test_files_that_cannot_be_written_are_refused(optiplan, run, tmp_path, option, value, expected):
    code, _, err = optiplan("view", run, option, value if option in ("--size", "--at") else tmp_path / value)
    assert code == 2
    assert expected in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--at", "t=0.4"), "--at: goes with --png or --gif"),
        (("--size", "800x600", "--export", "page.html"), "--size: goes with --png or --gif"),
        (("--port", "7000", "--export", "page.html"), "--port: serves the page"),
    ],
)
def test_options_without_effect_are_refused(optiplan, run, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    code, _, err = optiplan("view", run, *arguments)
    assert code == 2
    assert words in " ".join(err.split())
    assert not (tmp_path / "page.html").exists()


def test_a_picture_and_a_film_are_written(optiplan, run, tmp_path):
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from PIL import Image

    from optiplan.viewer.pictures import BROWSERS

    if not any(map(shutil.which, BROWSERS)):
        pytest.skip("no browser on this machine")
    png, gif = tmp_path / "page.png", tmp_path / "film.gif"
    options = ("--png", png, "--gif", gif, "--at", "t=0.1&speed=4&theme=dark", "--size", "480x320")
    command = [sys.executable, "-c", "from optiplan.cli.main import main; main()", "view", str(run), *map(str, options)]
    assert subprocess.run(command, timeout=120).returncode == 0  # a process of its own: playwright's loop runs once
    with Image.open(png) as picture:
        assert picture.size == (480, 320)
        assert sum(picture.convert("RGB").getpixel((470, 10))) < 200  # in the dark
    with Image.open(gif) as film:
        assert film.size == (480, 320)
        assert film.n_frames > 2
