from pathlib import Path

import pytest

from optiplan.errors import InputError
from optiplan.problem.examples import find_problem


@pytest.mark.parametrize("name", ["01_reach", "01_reach.yaml", "problems/01_reach.yaml"])
def test_examples_are_found_from_any_folder(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_problem(name).name == "01_reach.yaml"


def test_a_file_goes_before_an_example(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("01_reach").write_text("mine")
    assert find_problem("01_reach").read_text() == "mine"


def test_unknown_names_the_examples_and_the_nearest():
    with pytest.raises(InputError) as caught:
        find_problem("01_raech")
    assert "no such file" in str(caught.value)
    assert "did you mean '01_reach'?" in str(caught.value)
    assert "02_shelf" in str(caught.value)
    with pytest.raises(InputError, match=r"no such file; .* or the name of an example, such as 01_reach$"):
        find_problem("cell.yaml")


@pytest.mark.parametrize("name", ["elsewhere/01_reach.yaml", "01_reach.json"])
def test_only_the_plain_name_means_an_example(name):
    with pytest.raises(InputError, match="no such file"):
        find_problem(name)


def test_folder_is_no_problem(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        find_problem(str(tmp_path))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("arm.urdf", "the description of a robot"),
        ("arm.urdf.xacro", "the description of a robot"),
        ("trajectory.json", "`optiplan view` shows it"),
    ],
)
def test_a_file_that_is_no_problem_by_its_name_is_told_so(tmp_path, name, words):
    (tmp_path / name).write_text("<robot/>")
    with pytest.raises(InputError, match="expected a problem file") as caught:
        find_problem(str(tmp_path / name))
    assert words in str(caught.value)


def test_the_folder_of_a_run_is_told_so(tmp_path):
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match="the folder of a run"):
        find_problem(str(tmp_path))


def test_a_device_is_no_problem():
    with pytest.raises(InputError, match="is no regular file"):
        find_problem("/dev/null")


def test_the_beginning_of_an_example_is_enough_for_a_hint():
    with pytest.raises(InputError, match=r"did you mean '28_circle_of_base_and_arm'\?"):
        find_problem("28")


def test_a_folder_is_not_taken_for_a_slip_of_the_pen(tmp_path):
    (tmp_path / "01_raech.yaml").mkdir()
    with pytest.raises(InputError, match="is a folder") as caught:
        find_problem(str(tmp_path / "01_raech.yaml"))
    assert "did you mean" not in str(caught.value)


def test_an_empty_name_is_not_the_folder_one_stands_in(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("run.json").write_text("{}")
    with pytest.raises(InputError, match="'': file: an empty name"):
        find_problem("")
