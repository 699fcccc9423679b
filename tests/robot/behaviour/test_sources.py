import sys

import pytest

from optiplan.errors import InputError
from optiplan.robot import description_files
from optiplan.robot.robot import load_robot
from tests.robot.robots import TWO, write_robot

YAML = "version: 1\nname: r\nurdf: {{package: example-robot-data, robot: {}}}\n"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder of sys.path that holds the data package with one robot, `two_robot`."""
    folder = tmp_path / "site/cmeel.prefix/share/example-robot-data/robots/two_description/urdf"
    write_robot(folder, TWO)
    (folder / "robot.urdf").rename(folder / "two_robot.urdf")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "site")])


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize("name", ["two", "two_robot"])
def test_robots_of_the_package(tmp_path, name):
    (tmp_path / "robot.yaml").write_text(YAML.format(name))
    assert load_robot(str(tmp_path)).joint_names == ("j1", "j2")


@pytest.mark.usefixtures("package")
def test_a_robot_that_the_package_does_not_have(tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML.format("twoo"))
    with pytest.raises(InputError, match=r"robot.yaml:3: urdf.robot: unknown robot 'twoo'; expected one of: two,"):
        load_robot(str(tmp_path))


def test_without_the_package(tmp_path, monkeypatch):
    monkeypatch.setattr(description_files, "package_robots", dict)
    (tmp_path / "robot.yaml").write_text(YAML.format("panda"))
    with pytest.raises(InputError, match="pip install example-robot-data"):
        load_robot(str(tmp_path))


def test_another_package(tmp_path):
    (tmp_path / "robot.yaml").write_text("version: 1\nname: r\nurdf: {package: robots, robot: panda}\n")
    with pytest.raises(InputError, match=r"urdf\.package: 'robots'; expected 'example-robot-data'"):
        load_robot(str(tmp_path))


def test_the_real_package_where_it_is_installed(tmp_path):
    if not description_files.package_robots():
        pytest.skip("example-robot-data is not installed")
    (tmp_path / "robot.yaml").write_text(YAML.format("ur5") + "collision: none\n")
    assert load_robot(str(tmp_path)).n == 6
