import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.dual_quaternion import screw_between
from optiplan.planners.sclerp.interpolation import on_screw, spline, through
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion, ScrewStepper
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from tests.planners import cases

FAR = np.array([0.4, -0.5, 0.3, -2.0, 0.2, 1.8, 1.0])


@pytest.fixture(scope="module")
def tool():
    robot = cases.robot("panda")
    return ScrewTool(robot, robot.tool_frame)


@pytest.fixture
def stepper(tool):
    return ScrewStepper(tool, ScrewMotion(tool.pose(cases.READY), tool.pose(FAR)), SclerpOptions())


def test_spatial_jacobian_is_the_derivative_of_the_pose(tool):
    X, J = tool.at(FAR)
    assert np.allclose(X.homogeneous, tool.pose(FAR).homogeneous)
    h = 1e-6
    for j in range(7):
        ahead, behind = (tool.pose(FAR + x * np.eye(7)[j]).homogeneous for x in (h, -h))
        twist = ((ahead - behind) / (2.0 * h)) @ np.linalg.inv(X.homogeneous)
        assert np.allclose(twist[:3, 3], J[:3, j], atol=1e-8)
        assert np.allclose(twist[:3, :3], pin.skew(J[3:, j]), atol=1e-8)
    z, p = np.array([0.0, 0, 1.0]), np.zeros(3)  # of the first joint: through the base, upwards
    assert np.allclose(J[:, 0], [*np.cross(p, z), *z], atol=1e-12)


def test_screw_is_the_interpolation_of_its_ends(stepper):
    X_0, X_1 = stepper.screw.X_W0, stepper.screw.X_W1
    for s in (0.0, 0.3, 1.0):
        assert np.allclose(stepper.screw.pose(s).homogeneous, screw_between(X_0, X_1, s).homogeneous, atol=1e-14)


def test_every_step_is_on_the_screw_and_none_is_longer_than_allowed(tool, stepper):
    stepped = stepper.step_along(cases.READY, 1000)
    assert stepped.complete
    for s, q in zip(stepped.s, stepped.Q, strict=True):
        assert np.abs(pin.log6(stepper.screw.pose(s).actInv(tool.pose(q))).vector).max() < 1e-9
    assert (np.abs(np.diff(stepped.Q, axis=0)) <= stepper.longest + 1e-12).all()
    velocity = tool.robot.limits.velocity
    assert stepper.longest == pytest.approx(SclerpOptions().step * velocity / velocity.max())


def test_led_to_a_configuration_it_ends_there(tool, stepper):
    led = ScrewStepper(tool, stepper.screw, SclerpOptions(), FAR)
    assert led.step_along(cases.READY, 1000).Q[-1] == pytest.approx(FAR, abs=1e-9)
    assert np.abs(stepper.step_along(cases.READY, 1000).Q[-1] - FAR).max() > 1e-3  # not led, it does not


def test_near_a_limit_a_step_takes_its_share_of_what_is_left(stepper):
    q, ds = stepper.high - 0.01, 0.02
    share = 1.0 - np.exp(-30.0 * ds)
    assert stepper._soft_bounds(q, ds)[1] == pytest.approx(q + np.minimum(share * 0.009, stepper.longest))


def test_steps_used_up_and_stopped(stepper):
    assert not stepper.step_along(cases.READY, 3).complete
    assert len(stepper.step_along(cases.READY, 1000, stop=lambda: True).s) == 1


def test_smooth_path_is_on_the_screw_between_its_knots_too_and_near_the_walk(tool, stepper):
    stepped = stepper.step_along(cases.READY, 1000)
    path = on_screw(stepper, stepped)
    assert np.abs(path(stepped.s) - stepped.Q).max() < 0.02
    assert np.abs(path(stepped.s[[0, -1]]) - stepped.Q[[0, -1]]).max() < 1e-12
    assert max(np.abs(path.jumps(order)).max() for order in (0, 1)) < 1e-9
    assert np.abs(path.jumps(2)).max() < 1e-6
    off = [
        np.abs(pin.log6(stepper.screw.pose(s).actInv(tool.pose(path(np.array([s]))[0]))).vector).max()
        for s in np.linspace(0.0, 1.0, 1500)
    ]
    assert max(off) < 1e-6


def test_path_through_the_steps_of_a_scheme():
    t = np.linspace(0.0, 1.0, 400)
    Q = np.column_stack([np.sin(t), t**2])
    path = through(("a", "b"), Q)
    assert path.start == pytest.approx(Q[0])
    assert path.end == pytest.approx(Q[-1])
    assert 50 < len(path.breakpoints) < 160  # 1.3 rad of way, a knot each hundredth
    samples = path(np.linspace(0.0, path.duration, 300))
    assert np.abs(samples[:, 1] - np.arcsin(samples[:, 0]) ** 2).max() < 1e-6
    assert not through(("a", "b"), Q[[0, 0]]).coefficients[:, 1:].any()
    assert not spline(("a", "b"), t, np.ones((400, 2))).coefficients[:, 1:].any()
