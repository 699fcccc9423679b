"""What C++ libraries say of an input, in words for its author."""

import coal
import numpy as np
import pytest

from optiplan.arrays import number_argument
from optiplan.errors import InputError, described, plain_reason
from optiplan.robot.robot import load_robot
from tests.robot.robots import BARE, joint, write_robot


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        (
            "From file: /project/src/shape/convex.cpp\nin function: static coal::ConvexBase* coal::f(const Vec3s*)\n"
            "at line: 186\nmessage: Too many neighbors.\n",
            "Too many neighbors.",
        ),
        ("/home/builder/include/pinocchio/src/model.hxx:930: The index is not valid.", "The index is not valid."),
        ("The mesh  robots/arm.stl\n cannot be read.", "The mesh robots/arm.stl cannot be read."),
        ("", "RuntimeError"),
    ],
)
def test_paths_and_lines_of_sources_are_left_out(text, plain):
    assert plain_reason(RuntimeError(text)) == plain


def test_what_coal_raises_has_no_path_of_its_sources():
    with pytest.raises(ValueError, match="Could not load") as caught:
        coal.MeshLoader().load("/nowhere/mesh.stl", np.ones(3))
    assert ".cpp" in str(caught.value)
    told = plain_reason(caught.value)
    assert "/nowhere/mesh.stl" in told
    for word in (".cpp", "in function", "From file", "at line"):
        assert word not in told


def test_a_mesh_that_cannot_be_read_is_told_without_cpp(tmp_path):
    (tmp_path / "bad.stl").write_text("this is no mesh")
    link = '<link name="b"><collision><geometry><mesh filename="bad.stl"/></geometry></collision></link>'
    with pytest.raises(InputError) as caught:
        load_robot(str(write_robot(tmp_path, [BARE.format("a"), link, joint("j", "a", "b")])))
    told = str(caught.value)
    assert "bad.stl" in told
    assert ".cpp" not in told
    assert "From file" not in told


class Silent:
    def __repr__(self):
        raise RuntimeError("no text")


def test_what_has_no_text_is_described_by_its_type():
    assert described(Silent()) == "the Silent"


def test_a_number_among_arguments_is_finite_and_in_its_range():
    assert number_argument("plan", "budget", np.int64(2), "1 to 2", 1.0, most=2.0) == 2.0
    assert number_argument("plan", "budget", 1e-9, "a number > 0", above=0.0) == 1e-9
    for value, ends in (
        (np.nan, {}),
        (True, {}),
        ("1", {}),
        (0.9, {"least": 1.0}),
        (0.0, {"above": 0.0}),
        (3, {"most": 2}),
    ):
        with pytest.raises(InputError, match=r"op\.plan: budget: found the .*; expected so much"):
            number_argument("plan", "budget", value, "so much", **ends)
