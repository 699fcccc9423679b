"""`optiplan new` writes a problem that can be planned; `optiplan schema` writes what editors read."""

import io
import json
from pathlib import Path

import jsonschema
import pytest

from optiplan.cli.main import run as optiplan
from optiplan.config.document import parse_yaml
from optiplan.problem.load import load_problem
from optiplan.problem.schema.meanings import MEANINGS
from optiplan.problem.schema.problem import problem_schema


@pytest.mark.parametrize("robot", ["panda", "srra"])
def test_a_first_problem_is_planned(tmp_path, robot):
    file = tmp_path / "first.yaml"
    assert optiplan(["new", str(file), "--robot", robot, "--yes"]) == 0
    first = file.read_text().splitlines()[0]
    assert first == "# yaml-language-server: $schema=problem.schema.json"
    assert (tmp_path / "problem.schema.json").exists()
    assert optiplan(["plan", str(file), "--out", str(tmp_path / "run")]) == 0
    with_box = file.read_text().replace("# scene:    #", "scene:    #").replace("#   obstacles", "  obstacles")
    file.write_text(with_box.replace("#     - {name: box", "    - {name: box"))
    assert load_problem(file).scene.names == ("box",)


def test_an_arm_of_few_joints_goes_to_a_configuration(tmp_path, capsys):
    file = tmp_path / "first.yaml"
    assert optiplan(["new", str(file), "--robot", "planar2r", "--goal", "0.3,0.3,0"]) == 2
    assert "or none, for a configuration as the goal" in " ".join(capsys.readouterr().err.split())
    assert optiplan(["new", str(file), "--robot", "planar2r", "--yes"]) == 0
    (goal,) = load_problem(file).goal
    assert goal.q.tolist() == [1.0, 1.5]


@pytest.mark.parametrize("name", ["2026.yaml", "null.yaml", "cell: a.yaml"])
def test_any_name_of_a_file_can_be_that_of_the_problem(tmp_path, name):
    assert optiplan(["new", str(tmp_path / name), "--yes"]) == 0
    assert load_problem(tmp_path / name).name == name.removesuffix(".yaml")


def test_a_robot_by_its_path_is_found_from_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    urdf = Path(__file__).parents[3] / "examples" / "my_arm.urdf"
    Path("arm").mkdir()
    Path("arm/robot.yaml").write_text(
        f"version: 1\nname: arm\nurdf: {urdf}\nconfigurations: {{ready: [0.6, 0.8, 0.1]}}\n"
    )
    assert optiplan(["new", "cells/first.yaml", "--robot", "arm/robot.yaml", "--yes"]) == 0
    assert load_problem("cells/first.yaml").robot.name == "arm"


def test_answers_are_checked_and_nothing_is_overwritten(tmp_path, capsys):
    file = tmp_path / "first.yaml"
    assert optiplan(["new", str(file), "--goal", "1,2"]) == 2
    assert "X,Y,Z" in capsys.readouterr().err
    assert optiplan(["new", str(file), "--robot", "ur5", "--goal", "4,0.2,0.5"]) == 2
    err = " ".join(capsys.readouterr().err.split())
    assert err.startswith("new: --goal: '4,0.2,0.5': no configuration puts 'tool0' at this pose")
    assert optiplan(["new", str(file), "--robot", "pandas"]) == 2
    assert "panda" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    file.write_text("mine")
    assert optiplan(["new", str(file)]) == 2
    assert file.read_text() == "mine"


def test_input_that_ends_at_a_question_is_no_fault_of_ours(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    assert optiplan(["new", str(tmp_path / "first.yaml")]) == 2
    assert "no answer; expected one, or the options" in capsys.readouterr().err


def test_the_schema_explains_every_key_and_takes_the_examples(tmp_path, problems):
    path = tmp_path / "schema.json"
    assert optiplan(["schema", "--out", str(path)]) == 0
    schema = json.loads(path.read_text())
    known = {**schema["$defs"], "ProblemSpec": schema}
    said = {(name, key): one for name, stated in known.items() for key, one in stated.get("properties", {}).items()}
    assert [place for place, one in said.items() if not one.get("description")] == []
    keys = {key for _, key in said} | {f"{name}.{key}" for name, key in said}
    assert set(MEANINGS) <= keys  # none of a key that is gone
    check = jsonschema.Draft202012Validator(schema)
    for example in sorted(problems.glob("*.yaml")):
        data = json.loads(json.dumps(parse_yaml(example.read_text(), example).data))
        assert [error.message for error in check.iter_errors(data)] == [], example.name
    assert problem_schema() == schema
