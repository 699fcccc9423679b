import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.dual_quaternion import screw_between
from optiplan.planners.sclerp.interpolation import on_screw, spline, through
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion, Walker
from optiplan.planners.sclerp.screw_kinematics import Tool
from tests.planners import cases

FAR = np.array([0.4, -0.5, 0.3, -2.0, 0.2, 1.8, 1.0])


@pytest.fixture(scope="module")
def tool():
    robot = cases.robot("panda")
    return Tool(robot, robot.tool_frame)


@pytest.fixture
def walker(tool):
    return Walker(tool, ScrewMotion(tool.pose(cases.READY), tool.pose(FAR)), SclerpOptions())


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


def test_screw_is_the_interpolation_of_its_ends(walker):
    X_0, X_1 = walker.screw.X_W0, walker.screw.X_W1
    for s in (0.0, 0.3, 1.0):
        assert np.allclose(walker.screw.pose(s).homogeneous, screw_between(X_0, X_1, s).homogeneous, atol=1e-14)


def test_every_step_is_on_the_screw_and_none_is_longer_than_allowed(tool, walker):
    walk = walker.walk(cases.READY, 1000)
    assert walk.complete
    for s, q in zip(walk.s, walk.Q, strict=True):
        assert np.abs(pin.log6(walker.screw.pose(s).actInv(tool.pose(q))).vector).max() < 1e-9
    assert (np.abs(np.diff(walk.Q, axis=0)) <= walker.longest + 1e-12).all()
    velocity = tool.robot.limits.velocity
    assert walker.longest == pytest.approx(SclerpOptions().step * velocity / velocity.max())


def test_led_to_a_configuration_it_ends_there(tool, walker):
    led = Walker(tool, walker.screw, SclerpOptions(), FAR)
    assert led.walk(cases.READY, 1000).Q[-1] == pytest.approx(FAR, abs=1e-9)
    assert np.abs(walker.walk(cases.READY, 1000).Q[-1] - FAR).max() > 1e-3  # not led, it does not


def test_near_a_limit_a_step_takes_its_share_of_what_is_left(walker):
    q, ds = walker.high - 0.01, 0.02
    share = 1.0 - np.exp(-30.0 * ds)
    assert walker._soft_bounds(q, ds)[1] == pytest.approx(q + np.minimum(share * 0.009, walker.longest))


def test_steps_used_up_and_stopped(walker):
    assert not walker.walk(cases.READY, 3).complete
    assert len(walker.walk(cases.READY, 1000, stop=lambda: True).s) == 1


def test_smooth_path_is_on_the_screw_between_its_knots_too_and_near_the_walk(tool, walker):
    walk = walker.walk(cases.READY, 1000)
    path = on_screw(walker, walk)
    assert np.abs(path(walk.s) - walk.Q).max() < 0.02
    assert np.abs(path(walk.s[[0, -1]]) - walk.Q[[0, -1]]).max() < 1e-12
    assert max(np.abs(path.jumps(order)).max() for order in (0, 1)) < 1e-9
    assert np.abs(path.jumps(2)).max() < 1e-6
    off = [
        np.abs(pin.log6(walker.screw.pose(s).actInv(tool.pose(path(np.array([s]))[0]))).vector).max()
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
