"""`op.init_robot`: the files of `optiplan robots init`, and what is refused."""

from pathlib import Path

import pytest

import optiplan as op

ARM = Path(__file__).parents[2] / "examples" / "my_arm.urdf"


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_bytes(ARM.read_bytes())
    return path


def test_it_writes_a_robot_that_loads(urdf, tmp_path):
    told = []
    robot = op.init_robot(
        urdf, tmp_path / "made", name="mine", limits={"acceleration": 3.0}, progress=lambda *a: told.append(a)
    )
    again = op.load_robot(tmp_path / "made" / "robot.yaml")
    assert (robot.name, robot.joint_names) == (again.name, again.joint_names)
    assert robot.name == "mine"
    assert (again.limits.acceleration == 3.0).all()
    assert (tmp_path / "made" / "robot.srdf").exists()
    assert told


def test_files_that_are_there_stay(urdf, tmp_path):
    op.init_robot(urdf)
    before = (tmp_path / "robot.yaml").read_bytes()
    with pytest.raises(op.InputError, match=r"already; expected replace_files=True to replace it, .*: `out`"):
        op.init_robot(urdf, limits={"acceleration": 3.0})
    assert (tmp_path / "robot.yaml").read_bytes() == before
    op.init_robot(urdf, limits={"acceleration": 3.0}, replace_files=True)
    assert (tmp_path / "robot.yaml").read_bytes() != before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"urdf": 3}, "op.init_robot: urdf: found the int 3"),
        ({"group": "j1"}, "op.init_robot: group: found the str 'j1'"),
        ({"locked": {"j1": "x"}}, "op.init_robot: locked['j1']: found the str 'x'"),
        ({"allow_pairs": "all"}, "op.init_robot: allow_pairs: found the str 'all'"),
        ({"limits": {"acceleration": "x"}}, "op.init_robot: limits['acceleration']: found the str 'x'"),
    ],
)
def test_errors_name_the_argument(urdf, arguments, words):
    with pytest.raises(op.InputError) as caught:
        op.init_robot(**{"urdf": urdf, **arguments})
    assert str(caught.value).startswith(words)
