"""Robot files that once got a false verdict or an internal error; the inputs lie in tests/attacks."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from optiplan.problem.load import load_problem
from optiplan.verify.verify import verify
from tests.checks import named
from tests.verify.motions import quintic

ATTACKS = Path(__file__).parents[3] / "attacks"


def test_a_link_that_follows_the_planned_joint_is_where_it_is(optiplan, tmp_path):
    problem = load_problem(ATTACKS / "mimic/problem.yaml")
    motion = quintic(problem.robot.joint_names, np.array([0.8]), np.array([1.5]), 5.0)
    report = verify(problem, motion)
    assert not report.verified
    assert [check.name for check in report.checks if not check.passed] == ["collision"]
    collision = named(report, "collision")
    assert collision.place == "l2 – ball"
    code, out, err = optiplan("plan", ATTACKS / "mimic/problem.yaml", "--planner", "quintic", "--out", tmp_path / "run")
    assert code == 3
    assert "'l2' meets 'ball'" in out + err


@pytest.mark.parametrize(
    ("mass", "words"),
    [
        ('value="50,0"', "value='50,0'"),
        ('value="-1"', "value='-1'"),
        ('value="1e300"', "value='1e300'"),
        ('value="5_0"', "value='5_0'"),
        ('value="nan"', "value='nan'"),
        ('value="1 2"', "value='1 2'"),
        ("", "no value"),
    ],
)
def test_a_mass_that_a_reader_would_drop_is_bad_input(optiplan, tmp_path, mass, words):
    shutil.copytree(ATTACKS / "mass", tmp_path / "mass")
    urdf = tmp_path / "mass/comma.urdf"
    urdf.write_text("<!-- one line above -->\n" + urdf.read_text().replace('value="50,0"', mass))
    code, out, err = optiplan("plan", tmp_path / "mass/comma.yaml", "--out", tmp_path / "run")
    assert (code, out) == (2, "")
    assert f"{urdf}:2: b: <mass> with {words}; expected a mass from 0 to 1e9 kg" in err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('<mass value="50,0"/>', "", "an <inertial> without <mass>"),
        ('ixx="1"', "", "<inertia> with no ixx"),
        ('ixx="1"', 'ixx="-1"', "<inertia> with ixx='-1'"),
        ('<origin xyz="1 0 0"/>', '<origin xyz="1 0"/>', "<origin> with xyz='1 0'"),
    ],
)
def test_an_inertial_that_a_reader_would_drop_is_bad_input(optiplan, tmp_path, old, new, words):
    shutil.copytree(ATTACKS / "mass", tmp_path / "mass")
    urdf = tmp_path / "mass/comma.urdf"
    assert old in urdf.read_text()
    urdf.write_text(urdf.read_text().replace(old, new).replace("50,0", "50"))
    code, _, err = optiplan("plan", tmp_path / "mass/comma.yaml")
    assert code == 2
    assert f"{urdf}:1: b: {words}; expected" in err


def test_a_robot_without_masses_is_known_to_have_none(tmp_path):
    shutil.copytree(ATTACKS / "mass", tmp_path / "mass")
    assert load_problem(tmp_path / "mass/good.yaml").robot.has_inertia
    urdf = tmp_path / "mass/good.urdf"
    before, _, rest = urdf.read_text().partition("<inertial>")
    urdf.write_text(before + rest.partition("</inertial>")[2])
    assert not load_problem(tmp_path / "mass/good.yaml").robot.has_inertia


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("col_big", "b: <origin> with xyz='1e308 0 0'"),
        ("joint_universe", "universe: a joint called 'universe'"),
        ("lim_big", "j: <limit> with upper='1e300'"),
        ("org_e18", "j: <origin> with xyz='1e18 0 0'"),
    ],
)
def test_absurd_numbers_and_names_are_bad_input(optiplan, name, words):
    code, out, err = optiplan("plan", ATTACKS / f"rc1/urdf_{name}.yaml")
    assert (code, out) == (2, "")
    assert f"{ATTACKS}/rc1/r_{name}/a.urdf:1: {words}" in err
    assert "Traceback" not in err


def test_elements_nested_without_end_are_bad_input(optiplan, tmp_path):
    shutil.copytree(ATTACKS / "rc1/r_org_e18", tmp_path / "deep")
    (tmp_path / "deep/a.urdf").write_text(f'<robot name="x">{"<a>" * 5000}{"</a>" * 5000}</robot>')
    code, _, err = optiplan("robots", "show", tmp_path / "deep/robot.yaml")
    assert code == 2
    assert "elements nested more than 64 deep" in err
