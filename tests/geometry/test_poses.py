from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optiplan.arrays import unit_vector
from optiplan.geometry.dual_quaternion import DualQuaternion, screw_between
from optiplan.geometry.poses import pose_from_data, pose_to_data

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
        unit_vector(values)


def test_two_rotations_are_refused():
    with pytest.raises(ValueError, match="both rpy and quaternion"):
        pose_from_data({"rpy": [0, 0, 0], "quaternion": [0, 0, 0, 1]})


def random_pose(rng: np.random.Generator, rotation: float = 3.0) -> pin.SE3:
    """Turned by up to `rotation` rad about any axis."""
    axis = rng.normal(size=3)
    angle = rng.uniform(0.0, rotation)
    return pin.SE3(pin.exp3(angle * axis / np.linalg.norm(axis)), rng.uniform(-1.0, 1.0, 3))


def as_array(q: DualQuaternion) -> np.ndarray:
    return np.concatenate([q.real, q.dual])


def off_unit(q: DualQuaternion) -> float:
    """The larger of | |real| - 1 | and |real · dual|."""
    return max(abs(np.linalg.norm(q.real) - 1.0), abs(q.real @ q.dual))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_dual_quaternions_stand_for_poses_both_ways_and_multiply_like_them(rng):
    for _ in range(50):
        X_AB, X_BC = random_pose(rng), random_pose(rng)
        q_AB, q_BC = map(DualQuaternion.from_pose, (X_AB, X_BC))
        assert q_AB.real[0] >= 0.0
        assert off_unit(q_AB) < 1e-15
        assert np.allclose(q_AB.pose().homogeneous, X_AB.homogeneous, atol=1e-14)
        assert np.allclose(DualQuaternion(-q_AB.real, -q_AB.dual).pose().homogeneous, X_AB.homogeneous, atol=1e-14)
        assert np.allclose((q_AB * q_BC).pose().homogeneous, (X_AB * X_BC).homogeneous, atol=1e-14)


def test_real_and_dual_part_are_half_the_angle_and_half_the_position_times_it():
    X = pin.SE3(turn(2, 0.8), np.array([1.0, 2.0, 3.0]))
    q = DualQuaternion.from_pose(X)
    c, s = np.cos(0.4), np.sin(0.4)
    assert np.allclose(q.real, [c, 0, 0, s], atol=1e-15)
    x, y, z = X.translation  # ½ (0, p) (c, 0, 0, s)
    assert np.allclose(q.dual, 0.5 * np.array([-z * s, x * c + y * s, y * c - x * s, z * c]), atol=1e-15)


def test_the_conjugate_is_the_inverse_and_of_a_product_the_product_in_the_other_order(rng):
    X = random_pose(rng)
    q = DualQuaternion.from_pose(X)
    assert np.allclose(as_array(q * q.conjugate), [1, 0, 0, 0, 0, 0, 0, 0], atol=1e-15)
    assert np.allclose(q.conjugate.pose().homogeneous, X.inverse().homogeneous, atol=1e-14)
    a, b = (DualQuaternion(*rng.normal(size=(2, 4))) for _ in range(2))
    assert np.allclose(as_array((a * b).conjugate), as_array(b.conjugate * a.conjugate), atol=1e-14)


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), st.sampled_from([0.0, 1e-200, 1e-12, 1e-6, 1e-3, 1.0, 1.7]))
def test_exp_and_log_are_those_of_poses(twist, size):
    twist = np.array(twist) * np.repeat([1.0, size], 3)
    q = DualQuaternion.exp(twist)
    assert off_unit(q) < 1e-15
    assert np.allclose(q.pose().homogeneous, pin.exp6(twist).homogeneous, atol=1e-14)
    assert np.allclose(q.log(), twist, atol=1e-14)
    assert np.allclose(DualQuaternion(-q.real, -q.dual).log(), twist, atol=1e-14)


def test_nothing_jumps_where_the_series_ends_or_the_rotation_vanishes():
    axis, b = np.array([0.6, 0.0, 0.8]), np.array([0.3, -0.5, 0.7])
    for angle in (0.0, 1e-8, 2.0):  # half of 2 is where the series ends
        near = [as_array(DualQuaternion.exp(np.concatenate([b, (angle + e) * axis]))) for e in (-1e-9, 1e-9)]
        assert np.abs(near[1] - near[0]).max() < 3e-9
    logs = [DualQuaternion.from_pose(pin.exp6(np.concatenate([b, (2.0 + e) * axis]))).log() for e in (-1e-9, 1e-9)]
    assert np.abs(logs[1] - logs[0]).max() < 3e-9


def test_pure_translation_and_pure_rotation_are_exact():
    line = DualQuaternion.exp(np.array([0.3, -0.2, 0.1, 0, 0, 0]))
    assert np.array_equal(as_array(line), [1, 0, 0, 0, 0, 0.15, -0.1, 0.05])
    assert np.array_equal(line.power(0.5).pose().translation, [0.15, -0.1, 0.05])
    assert np.array_equal(line.log()[3:], np.zeros(3))
    spin = DualQuaternion.exp(np.array([0, 0, 0, 0, 0, 1.2]))
    assert np.array_equal(spin.dual, np.zeros(4))
    assert np.array_equal(spin.power(0.5).pose().translation, np.zeros(3))


@pytest.mark.parametrize("noise", [0.0, 1e-15, -1e-15, 1e-10, -1e-10])
@pytest.mark.parametrize("axis", [[1.0, 0, 0], [-1.0, 0, 0], [0, -0.6, 0.8], [0, 0, -1.0], [-0.6, 0.8, 0]])
def test_at_half_a_turn_rounding_does_not_choose_the_way_round(axis, noise):
    axis = np.array(axis)
    log = DualQuaternion.from_pose(pin.SE3(pin.exp3((np.pi + noise) * axis), np.array([0.1, 0.2, 0.3]))).log()
    assert np.linalg.norm(log[3:]) == pytest.approx(np.pi, abs=1e-9)
    assert log[3:][np.abs(log[3:]) > 1e-6][0] > 0.0
    assert np.allclose(pin.exp6(log).translation, [0.1, 0.2, 0.3], atol=1e-9)


@given(angle, st.floats(-2, 2), st.floats(-2, 2))
def test_powers_add_up(turned, s, t):
    q = DualQuaternion.exp(np.array([0.3, -0.2, 0.5, 0.0, 0.8 * turned, 0.6 * turned]))
    both, sum_ = q.power(s) * q.power(t), q.power(s + t)
    assert np.allclose(both.pose().homogeneous, sum_.pose().homogeneous, atol=1e-12)


def screw_pairs():
    rng = np.random.default_rng(9)
    pairs = [(random_pose(rng), random_pose(rng)) for _ in range(40)]
    X = random_pose(rng)
    pairs += [(X, pin.SE3(X.rotation, X.translation + rng.normal(size=3))) for _ in range(5)]  # pure translation
    for _ in range(5):  # pure rotation about an axis through some point
        c, R = rng.normal(size=3), random_pose(rng).rotation
        pairs.append((X, pin.SE3(R, c - R @ c) * X))
    return pairs


@pytest.mark.parametrize(("X_0", "X_1"), screw_pairs())
def test_interpolation_is_one_screw_of_constant_pitch_axis_and_moment(X_0, X_1):
    """Seen from the world, dX/dτ X⁻¹ is the same twist (v, w) = (|w| m + h w, w) all along: nothing else is a screw."""
    tau = np.linspace(0.0, 1.0, 21)
    poses = [screw_between(X_0, X_1, t) for t in tau]
    assert np.allclose(poses[0].homogeneous, X_0.homogeneous, atol=1e-13)
    assert np.allclose(poses[-1].homogeneous, X_1.homogeneous, atol=1e-13)
    twists = np.array([pin.log6(b * a.inverse()).vector * 20.0 for a, b in pairwise(poses)])
    v, w = twists[:, :3], twists[:, 3:]
    turning = np.linalg.norm(w, axis=1)
    assert np.allclose(turning, np.linalg.norm(pin.log3(X_0.rotation.T @ X_1.rotation)), atol=1e-11)
    if turning[0] < 1e-9:
        assert np.allclose(v, X_1.translation - X_0.translation, atol=1e-11)
        return
    axis = w / turning[:, None]
    pitch = (v * w).sum(axis=1) / turning**2  # m/rad
    moment = np.cross(axis, np.cross(v, axis)) / turning[:, None]  # of the axis about the origin, m
    for constant in (axis, pitch, moment):
        assert np.abs(constant - constant[0]).max() < 1e-9
    assert np.allclose(v, turning[:, None] * moment + pitch[:, None] * w, atol=1e-11)
    assert np.allclose((axis * moment).sum(axis=1), 0.0, atol=1e-11)
