import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optiplan.geometry import pose_from_data, pose_to_data, unit

coordinate = st.floats(-10, 10)
angle = st.floats(-3.2, 3.2)


def turn(axis: int, value: float) -> np.ndarray:
    c, s = np.cos(value), np.sin(value)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


@given(angle, angle, angle)
def test_rpy_turns_about_fixed_axes(roll, pitch, yaw):
    X = pose_from_data({"rpy": [roll, pitch, yaw]})
    assert np.allclose(X.rotation, turn(2, yaw) @ turn(1, pitch) @ turn(0, roll), atol=1e-12)
    assert not X.translation.any()


def test_quaternion_is_xyzw():
    half = np.sqrt(0.5)
    X = pose_from_data({"position": [1, 2, 3], "quaternion": [half, 0, 0, half]})
    assert np.allclose(X.rotation, turn(0, np.pi / 2), atol=1e-12)
    assert X.translation.tolist() == [1.0, 2.0, 3.0]


def test_nothing_is_the_identity():
    assert pose_from_data({}) == pin.SE3.Identity()


@given(st.tuples(coordinate, coordinate, coordinate), st.tuples(angle, angle, angle))
def test_round_trip(position, rpy):
    X = pose_from_data({"position": position, "rpy": rpy})
    data = pose_to_data(X)
    assert data["quaternion"][3] >= 0.0
    assert pose_from_data(data).isApprox(X, 1e-12)


def test_nearly_unit_is_normalised():
    X = pose_from_data({"quaternion": [0, 0, 0.7075, 0.7071]})
    assert np.allclose(X.rotation.T @ X.rotation, np.eye(3), atol=1e-14)


@pytest.mark.parametrize(
    ("values", "length"),
    [([0, 0, 0, 2], "2"), ([0, 0, 0, 0], "0"), ([1, np.nan], "nan"), ([1e200, 1e200], "1.41421e\\+200")],
)
def test_length_must_be_one(values, length):
    with pytest.raises(ValueError, match=f"found length {length}; expected unit length"):
        unit(values)


def test_two_rotations_are_refused():
    with pytest.raises(ValueError, match="both rpy and quaternion"):
        pose_from_data({"rpy": [0, 0, 0], "quaternion": [0, 0, 0, 1]})
