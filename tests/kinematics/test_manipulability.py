"""Measures of the Jacobian, their gradients and ellipsoids, and singularities by name."""

import itertools

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import UnknownChoiceError
from optiplan.kinematics.manipulability import (
    ToolKinematics,
    ellipsoids,
    manipulability_measures,
    measure_gradients,
    scaled,
    yoshikawa,
)
from optiplan.kinematics.singularities import NAMES, singularity_model
from optiplan.robot.robot import load_robot
from tests.robot.robots import chain, joint, write_robot

ARMS = ("ur5", "puma560", "panda", "srra")


@pytest.fixture(scope="module", params=ARMS)
def arm(request):
    return load_robot(request.param)


@pytest.fixture(scope="module")
def sliding(tmp_path_factory):
    """Revolute, prismatic, revolute, and a frame that the last joint does not carry."""
    folder = tmp_path_factory.mktemp("sliding")
    parts = chain(joint("j1", "a", "b"), joint("j2", "b", "c", "prismatic"), joint("j3", "c", "d"))
    return load_robot(str(write_robot(folder, parts, "tool_frame: c\n")))


def random_q(robot, count=20, seed=1):
    return np.random.default_rng(seed).uniform(-2.5, 2.5, (count, robot.n))


def pinocchio_jacobian(robot, q):
    frame = robot.model.getFrameId(robot.tool_frame)
    return pin.computeFrameJacobian(robot.model, robot.model.createData(), q, frame, pin.LOCAL_WORLD_ALIGNED)


def test_pose_and_jacobian_are_pinocchios(arm):
    Q, data = random_q(arm), arm.model.createData()
    X, J = ToolKinematics(arm).evaluate(Q)
    for q, X_k, J_k in zip(Q, X, J, strict=True):
        pin.framesForwardKinematics(arm.model, data, q)
        assert np.abs(data.oMf[arm.model.getFrameId(arm.tool_frame)].homogeneous - X_k).max() < 1e-12
        assert np.abs(pinocchio_jacobian(arm, q) - J_k).max() < 1e-12


def test_jacobian_of_a_sliding_joint_and_of_one_that_does_not_move_the_frame(sliding):
    Q = random_q(sliding)
    J = ToolKinematics(sliding).evaluate(Q)[1]
    assert max(np.abs(pinocchio_jacobian(sliding, q) - J_k).max() for q, J_k in zip(Q, J, strict=True)) < 1e-12
    assert np.all(J[:, :, 2] == 0.0)
    assert np.all(J[:, 3:, 1] == 0.0)


def test_a_frame_that_no_joint_moves(sliding):
    X, J = ToolKinematics(sliding, "a").evaluate(random_q(sliding))
    assert np.array_equal(X, np.broadcast_to(np.eye(4), X.shape))
    assert not J.any()


def test_axes_need_not_be_coordinate_axes(tmp_path):
    axes = ("0.36 -0.48 0.8", "0 -1 0", "0 0 -1")
    along_z = [joint(f"j{k}", *pair) for k, pair in enumerate(itertools.pairwise("abcd"))]
    parts = [part.replace('"0 0 1"', f'"{axis}"') for part, axis in zip(along_z, axes, strict=True)]
    robot = load_robot(str(write_robot(tmp_path, chain(*parts), "tool_frame: d\n")))
    Q = random_q(robot)
    J = ToolKinematics(robot).evaluate(Q)[1]
    assert max(np.abs(pinocchio_jacobian(robot, q) - J_k).max() for q, J_k in zip(Q, J, strict=True)) < 1e-12


def test_unknown_frame_lists_the_known(sliding):
    with pytest.raises(UnknownChoiceError, match="choose from: a, b, c"):
        ToolKinematics(sliding, "nowhere")


@pytest.mark.parametrize("which", [*ARMS, "sliding"])
def test_hessian_is_the_difference_of_jacobians(which, sliding):
    robot = sliding if which == "sliding" else load_robot(which)
    tool, Q, h = ToolKinematics(robot), random_q(robot), 1e-6
    H = tool.hessians(Q)
    for j in range(robot.n):
        step = h * np.eye(robot.n)[j]
        difference = (tool.evaluate(Q + step)[1] - tool.evaluate(Q - step)[1]) / (2.0 * h)
        assert np.abs(difference - H[..., j]).max() < 1e-8


@pytest.mark.parametrize("part", ["full", "translation", "rotation"])
def test_measures_are_what_their_formulas_say(arm, part):
    J = scaled(ToolKinematics(arm).evaluate(random_q(arm))[1], part, length=0.5)
    assert J.shape[1] == (6 if part == "full" else 3)
    found = manipulability_measures(J)
    assert np.abs(found.yoshikawa - np.sqrt(np.linalg.det(J @ J.transpose(0, 2, 1)))).max() < 1e-9
    assert np.abs(found.asada * np.linalg.cond(J) - 1.0).max() < 1e-9
    assert np.abs(found.smallest**2 - np.linalg.eigvalsh(J @ J.transpose(0, 2, 1))[:, 0]).max() < 1e-12


@pytest.mark.parametrize("shape", [(6, 7), (6, 6), (3, 2)])
def test_the_product_of_singular_values_without_them(shape):
    J = np.random.default_rng(3).normal(size=(50, *shape))
    J[0, :, -1] = J[0, :, -2] = J[0, :, 0]
    assert yoshikawa(J) == pytest.approx(manipulability_measures(J).yoshikawa, rel=1e-9, abs=1e-14)


def test_length_divides_the_rows_of_the_velocity():
    J = np.arange(12.0).reshape(1, 6, 2)
    assert np.array_equal(scaled(J, length=2.0), np.concatenate([J[:, :3] / 2.0, J[:, 3:]], axis=1))


@pytest.mark.parametrize("part", ["full", "translation", "rotation"])
def test_gradients_are_differences_of_the_measures(arm, part):
    tool, Q, h = ToolKinematics(arm), random_q(arm), 1e-6

    def found(at):
        return vars(manipulability_measures(scaled(tool.evaluate(at)[1], part)))

    H = tool.hessians(Q).transpose(0, 3, 1, 2)  # the derivative's index first, so that rows are where `scaled` has them
    H = scaled(H, part).transpose(0, 2, 3, 1)
    gradients = vars(measure_gradients(scaled(tool.evaluate(Q)[1], part), H))
    # Away from kinks: where two singular values meet, one-sided derivatives differ.
    s = np.linalg.svd(scaled(tool.evaluate(Q)[1], part), compute_uv=False)
    smooth = np.minimum(-np.diff(s, axis=1).max(axis=1), s[:, -1]) > 1e-3
    assert smooth.sum() >= 8
    for j in range(arm.n):
        step = h * np.eye(arm.n)[j]
        for name, gradient in gradients.items():
            difference = (found(Q + step)[name] - found(Q - step)[name]) / (2.0 * h)
            assert np.abs(difference - gradient[:, j])[smooth].max() < 1e-6, name


def test_gradient_of_an_arm_with_fewer_joints_than_rows():
    arm = load_robot("planar2r")
    tool, Q = ToolKinematics(arm), np.array([[0.3, 1.1], [0.4, -0.7]])
    J, H = tool.evaluate(Q)[1][:, :3], tool.hessians(Q)[:, :3]
    assert manipulability_measures(J).yoshikawa == pytest.approx(
        np.sqrt(np.linalg.det(J.transpose(0, 2, 1) @ J)), abs=1e-12
    )
    slope = measure_gradients(J, H).yoshikawa
    a1, a2 = two_links(arm)
    assert slope[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert slope[:, 1] == pytest.approx(a1 * a2 * np.cos(Q[:, 1]) * np.sign(np.sin(Q[:, 1])), abs=1e-12)


def two_links(arm):
    """Lengths of the two links of planar2r, m, across its axes."""
    tool = ToolKinematics(arm)
    poses = tool.kinematics.poses(np.zeros((1, 2)))
    axes, points = (part[0] for part in tool.kinematics.axes(poses))
    ends = [*points, tool.evaluate(np.zeros((1, 2)))[0][0, :3, 3]]
    return tuple(float(np.linalg.norm(np.cross(axes[0], b - a))) for a, b in itertools.pairwise(ends))


def test_two_links_are_most_dexterous_at_right_angles():
    """m = a1 a2 |sin q2|, whatever q1 is: lecture.example5."""
    arm = load_robot("planar2r")
    a1, a2 = two_links(arm)
    q2 = np.linspace(-np.pi, np.pi, 721)
    for q1 in (0.0, 1.3):
        Q = np.stack([np.full_like(q2, q1), q2], axis=1)
        m = manipulability_measures(ToolKinematics(arm).evaluate(Q)[1][:, :3]).yoshikawa
        assert m == pytest.approx(a1 * a2 * np.abs(np.sin(q2)), abs=1e-12)
        for half in (q2 < 0.0, q2 > 0.0):
            assert abs(q2[half][np.argmax(m[half])]) == pytest.approx(np.pi / 2.0, abs=1e-12)


def test_gradient_at_a_singularity_is_finite():
    arm = load_robot("ur5")
    tool, Q = ToolKinematics(arm), np.zeros((1, 6))
    J = tool.evaluate(Q)[1]
    assert manipulability_measures(J).yoshikawa[0] < 1e-12
    for gradient in vars(measure_gradients(J, tool.hessians(Q))).values():
        assert np.isfinite(gradient).all()


def test_measures_of_a_tool_that_nothing_moves():
    found = manipulability_measures(np.zeros((1, 3, 2)))
    assert (found.yoshikawa[0], found.asada[0], found.smallest[0]) == (0.0, 0.0, 0.0)


def test_velocity_and_force_ellipsoids(arm):
    J = ToolKinematics(arm).evaluate(random_q(arm))[1][:, :3]
    found = ellipsoids(J)
    assert np.linalg.det(found.axes) == pytest.approx(1.0)
    shape = found.axes @ (found.velocity[:, :, None] ** 2 * found.axes.transpose(0, 2, 1))
    assert np.abs(shape - J @ J.transpose(0, 2, 1)).max() < 1e-12
    for k in range(3):  # a force on the ellipsoid needs joint torques of norm 1
        force = found.axes[:, :, k] * found.force[:, k : k + 1]
        assert np.linalg.norm(np.einsum("nij,ni->nj", J, force), axis=1) == pytest.approx(1.0)


def test_ellipsoids_are_flat_where_a_planar_arm_cannot_move():
    J = ToolKinematics(load_robot("planar2r")).evaluate(np.array([[0.3, 1.1]]))[1][:, :3]
    found = ellipsoids(J)
    assert found.velocity[0, 2] == 0.0
    assert np.isinf(found.force[0, 2])


KINDS = {"puma560": "spherical", "srra": "spherical", "ur5": "parallel", "ur3": "parallel"}


@pytest.mark.parametrize(("name", "kind"), KINDS.items())
def test_determinant_is_the_product_of_the_factors(name, kind):
    arm = load_robot(name)
    model, Q = singularity_model(arm), random_q(arm, 200)
    assert model.wrist == kind
    found = model.factors(Q)
    determinant = np.abs(np.linalg.det(ToolKinematics(arm).evaluate(Q)[1]))
    assert np.abs(np.abs(found.shoulder * found.elbow * found.wrist) - determinant).max() < 1e-12
    assert np.abs(found.sines[:, 1:]).max() <= 1.0 + 1e-12
    assert found.sines[:, 0] * found.length == pytest.approx(found.shoulder)


@pytest.mark.parametrize("name", KINDS)
def test_each_singularity_has_its_name(name):
    """Found by walking to where one factor changes its sign: there the Jacobian loses rank."""
    arm = load_robot(name)
    model, Q = singularity_model(arm), random_q(arm, 400, seed=3)
    Q = Q[[names == () for names in model.factors(Q).names(0.05)]]
    for k, expected in enumerate(NAMES):
        sign = model.factors(Q).sines[:, k] > 0.0
        a, b = Q[sign][0], Q[~sign][0]
        for _ in range(60):
            middle = 0.5 * (a + b)
            a, b = (middle, b) if model.factors(middle[None]).sines[0, k] > 0.0 else (a, middle)
        assert expected in model.factors(a[None]).names(1e-9)[0]
        assert manipulability_measures(ToolKinematics(arm).evaluate(a[None])[1]).smallest[0] < 1e-9


def test_a_straight_ur_is_singular_and_a_bent_one_is_not():
    arm = load_robot("ur5")
    model = singularity_model(arm)
    straight = model.factors(np.zeros((1, 6))).names()[0]
    assert {"elbow", "wrist"} <= set(straight)
    assert model.factors(np.array([[0.0, -1.5, 1.5, -1.5, -1.5, 0.0]])).names() == [()]


def test_other_arms_have_no_named_singularities(sliding):
    assert singularity_model(load_robot("panda")) is None
    assert singularity_model(sliding) is None
