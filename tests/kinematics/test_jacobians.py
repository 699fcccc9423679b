"""Jacobians against differences, and against the number that a report prints, put right."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import UnknownChoiceError
from optiplan.kinematics.jacobians import analytic_jacobian
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.robot import load_robot

ROBOTS = ("srra", "puma560", "delbot", "panda")
STEP = 1e-6


def samples(robot, count=5):
    lower, upper = np.maximum(robot.limits.lower, -2.5), np.minimum(robot.limits.upper, 2.5)
    return np.random.default_rng(0).uniform(lower, upper, (count, robot.n))


def differences(function, q):
    """Central differences, a column a joint."""
    steps = STEP * np.eye(len(q))
    return np.array([(function(q + step) - function(q - step)) / (2 * STEP) for step in steps]).T


@pytest.mark.parametrize("name", ROBOTS)
def test_geometric_jacobian_is_the_velocity_of_the_frame(name):
    robot = load_robot(name)
    for frame in (robot.tool_frame, robot.model.frames[robot.model.nframes // 2].name):
        for q in samples(robot):
            X = frame_pose(robot, q, frame)

            def moved(p, frame=frame, X=X):
                Y = frame_pose(robot, p, frame)
                return np.concatenate([Y.translation, pin.log3(Y.rotation @ X.rotation.T)])

            J = geometric_jacobian(robot, q, frame)
            assert np.allclose(J, differences(moved, q), atol=1e-8)
            own = np.vstack([X.rotation.T @ J[:3], X.rotation.T @ J[3:]])
            assert np.allclose(geometric_jacobian(robot, q, frame, "frame"), own, atol=1e-12)


def test_geometric_jacobian_is_the_cross_product_of_the_docstring():
    """Reference delbot.jacobian.formula: columns [z x (p_e - p); z] of revolute joints, [z; 0] of prismatic ones."""
    robot = load_robot("delbot")
    for q in samples(robot):
        tip, columns = frame_pose(robot, q, "grasp").translation, []
        for name in robot.joint_names:
            X = frame_pose(robot, q, name)
            if name in ("base_x", "base_y"):
                columns.append([*np.eye(3)["xy".index(name[-1])], 0, 0, 0])
            else:
                z = X.rotation[:, 2]
                columns.append([*np.cross(z, tip - X.translation), *z])
        assert np.allclose(geometric_jacobian(robot, q, "grasp"), np.array(columns).T, atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_rpy_jacobian_is_the_rate_of_the_angles(name):
    robot = load_robot(name)

    def coordinates(q):
        X = frame_pose(robot, q, robot.tool_frame)
        return np.concatenate([X.translation, pin.rpy.matrixToRpy(X.rotation)])

    for q in samples(robot):
        assert np.allclose(
            analytic_jacobian(robot, q, robot.tool_frame), differences(coordinates, q), atol=1e-6, rtol=1e-6
        )


@pytest.mark.parametrize("name", ROBOTS)
def test_quaternion_jacobian_is_the_rate_of_the_quaternion(name):
    robot = load_robot(name)

    def coordinates(q):
        X = frame_pose(robot, q, robot.tool_frame)
        quaternion = pin.Quaternion(X.rotation).coeffs()
        return np.concatenate([X.translation, quaternion if quaternion[3] >= 0 else -quaternion])

    for q in samples(robot):
        J = analytic_jacobian(robot, q, robot.tool_frame, "quaternion")
        assert J.shape == (7, robot.n)
        assert np.allclose(J, differences(coordinates, q), atol=1e-8)


def test_angles_without_rates_are_refused():
    """At q = 0 the tool of SRRA points along x, that is pitch 90°."""
    robot = load_robot("srra")
    with pytest.raises(ValueError, match="take the quaternion"):
        analytic_jacobian(robot, np.zeros(6), "link_6")
    assert np.isfinite(analytic_jacobian(robot, np.zeros(6), "link_6", "quaternion")).all()


def test_unknown_frame_names_the_known():
    with pytest.raises(UnknownChoiceError, match="unknown frame 'link_9'; choose from: base_link"):
        geometric_jacobian(load_robot("srra"), np.zeros(6), "link_9")


def test_delbots_jacobian_at_home():
    """Reference delbot.jacobian.home, the corrected value, to its 1e-12; rank 5: the wrist is singular there."""
    expected = [
        [0.19425, 0.08535, 0.08535, 0.08535, -0.0819, 0],
        [-0.4569, 0, 0, 0, 0, 0],
        [0, -0.4569, -0.21325, 0, 0, 0],
        [0, 0, 0, 0, 0, 0],
        [0, -1, -1, -1, 0, -1],
        [1, 0, 0, 0, -1, 0],
    ]
    J = geometric_jacobian(load_robot("delbot", group="arm"), np.zeros(6), "wrist_3")
    assert np.allclose(J, expected, rtol=0, atol=1e-12)
    assert np.linalg.matrix_rank(J, tol=1e-9) == 5


def test_delbots_platform_gives_redundancy_but_no_way_out_of_that_singularity():
    """Reference delbot.dof: rank 5 at home with the platform too, 6 elsewhere."""
    robot = load_robot("delbot")
    assert np.linalg.matrix_rank(geometric_jacobian(robot, np.zeros(9), "wrist_3"), tol=1e-9) == 5
    q = np.array([0.1, 0.2, 0.3, 0.3, -0.8, 1.1, 0.4, 0.9, -0.5])
    assert np.linalg.matrix_rank(geometric_jacobian(robot, q, "wrist_3"), tol=1e-6) == 6


def test_of_one_joint_it_is_a_matrix_too(tmp_path):
    table = "dh: {convention: standard, unit: rad, radius: 0.05, rows: [{name: turn, joint: revolute, a: 0.3}]}"
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: one\n{table}\n")
    J = geometric_jacobian(load_robot(str(tmp_path / "robot.yaml")), np.array([0.5 * np.pi]), "turn")
    assert J == pytest.approx(np.array([[-0.3], [0.0], [0.0], [0.0], [0.0], [1.0]]), abs=1e-12)
