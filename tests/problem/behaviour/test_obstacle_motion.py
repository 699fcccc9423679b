"""Obstacles that move, in files and in Python."""

import pytest

import optiplan as op
from optiplan.problem.load import load_problem

TEXT = """version: 1
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [-1.0, 0.3]}
scene:
  obstacles:
    - {name: cart, shape: {box: [0.1, 0.1, 0.1]}, pose: {position: [2.0, 0, 0]}, motion: MOTION}
"""


def loaded(tmp_path, motion, shape="box: [0.1, 0.1, 0.1]"):
    file = tmp_path / "moving.yaml"
    file.write_text(TEXT.replace("MOTION", motion).replace("box: [0.1, 0.1, 0.1]", shape))
    return load_problem(file)


def test_file_and_python_say_the_same(tmp_path):
    problem = loaded(tmp_path, "{polynomial: [[0, -0.5], [0], [0, 0, 1]], until: 2.0}")
    (cart,) = problem.scene.dynamic_obstacles
    assert cart.motion.until == 2.0
    box = op.Box("cart", size=(0.1, 0.1, 0.1), position=(2.0, 0, 0)).moving([[0, -0.5], [0], [0, 0, 1]], until=2.0)
    assert cart.motion.coefficients == pytest.approx(box.motion.coefficients)
    again = problem.with_scene([box])
    again.save(tmp_path / "again.yaml")
    assert load_problem(tmp_path / "again.yaml").hash == again.hash
    assert again.hash != problem.with_scene(problem.scene.standing).hash


@pytest.mark.parametrize(
    ("motion", "field", "words"),
    [
        ("{polynomial: [[0], [0]]}", "polynomial", "2 values"),
        ("{polynomial: [[0], [0], [.nan]]}", "polynomial[2][0]", "finite"),
        ("{polynomial: [[0], [0], []]}", "polynomial[2]", "0 values"),
        ("{polynomial: [[0], [0], [0]], until: 0}", "until", "> 0"),
        ("{velocity: [0, 0, 1]}", "velocity", "unknown key"),
    ],
)
def test_what_does_not_fit(tmp_path, motion, field, words):
    with pytest.raises(op.InputError) as caught:
        loaded(tmp_path, motion)
    assert field in str(caught.value)
    assert "moving.yaml:7" in str(caught.value)


def test_half_spaces_stay(tmp_path):
    with pytest.raises(op.InputError, match="half_space that moves"):
        loaded(tmp_path, "{polynomial: [[0], [0], [0]]}", "half_space: {normal: [0, 0, 1], offset: -3}")


@pytest.mark.parametrize("bad", [[[0], [0]], [[0], [0], ["x"]], 3, [[0], [0], [float("inf")]]])
def test_python_refuses_other_polynomials(bad):
    with pytest.raises(op.InputError, match=r"Obstacle\.moving"):
        op.Sphere("ball", 0.1).moving(bad)


def test_only_the_start_is_held_against_where_it_is_first(tmp_path):
    there = "{polynomial: [[0, 1], [0], [0]], until: 1.0}"
    at_start = TEXT.replace("[2.0, 0, 0]", "[0.3, 0.18, 0.9]").replace("MOTION", there)
    file = tmp_path / "start.yaml"
    file.write_text(at_start.replace("[0.1, 0.1, 0.1]", "[3.0, 3.0, 3.0]"))
    with pytest.raises(op.InputError, match="the start is in collision"):
        load_problem(file)
