"""Wheel rates and base twist of Delbot's platform, against the report's numbers and against the rollers themselves."""

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.kinematics.mecanum import WHEELS, Mecanum, wheel_matrix
from optiplan.robot.robot import load_robot

DELBOT = Mecanum(radius=0.03, half_wheelbase=0.291909, half_track=0.2726)
WHEEL_RATE = 40.0
"""rad/s: what robots/delbot/robot.yaml says of its wheels."""


def test_the_matrix_is_the_reports():
    """Reference delbot.mecanum.inverse, to its 1e-9."""
    assert WHEELS == ("front_left", "front_right", "rear_left", "rear_right")
    k = 0.5645089999999999
    expected = np.array([[1, -1, -k], [1, 1, k], [1, 1, -k], [1, -1, k]])
    assert np.allclose(DELBOT.matrix * 0.03, expected, rtol=0, atol=1e-9)
    assert DELBOT.matrix[0] == pytest.approx([33.33333333333334, -33.33333333333334, -18.81696666666667], abs=1e-9)
    assert np.linalg.matrix_rank(DELBOT.matrix) == 3


def test_rollers_do_not_slip_along_their_axes():
    """The formula of the docstring from first principles.

    Along the axis of the roller on the ground, the base above the contact moves as fast as the wheel rolls:
    u·(v + w x p) = u·(r rate, 0), with u at 45°, of alternating hand.
    """
    rng = np.random.default_rng(0)
    corners = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}
    for twist in rng.uniform(-1, 1, (20, 3)):
        rates = DELBOT.wheel_rates(twist)
        for rate, name in zip(rates, WHEELS, strict=True):
            ahead, left = corners[name]
            x, y = ahead * DELBOT.half_wheelbase, left * DELBOT.half_track
            u = np.array([1.0, -ahead * left]) / np.sqrt(2.0)
            velocity = twist[:2] + twist[2] * np.array([-y, x])
            assert u @ velocity == pytest.approx(u[0] * DELBOT.radius * rate, abs=1e-12)


def test_there_and_back():
    twists = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    assert np.allclose(DELBOT.base_twist(DELBOT.wheel_rates(twists)), twists, atol=1e-13)


def test_rates_that_slip_give_the_least_squares_twist():
    slip = np.array([1.0, 1.0, -1.0, -1.0])
    assert np.allclose(DELBOT.matrix.T @ slip, 0, atol=1e-12)
    rates = DELBOT.wheel_rates(np.array([0.1, 0.2, 0.3])) + 5 * slip
    assert np.allclose(DELBOT.base_twist(rates), [0.1, 0.2, 0.3], atol=1e-12)


@pytest.mark.parametrize("turning", [0.1, 1 / 3, 0.8])
def test_velocity_limits_hold_at_every_heading_and_are_reached(turning):
    limits = DELBOT.velocity_limits(WHEEL_RATE, turning)
    worst = 0.0
    for heading in np.linspace(0, 2 * np.pi, 721):
        c, s = np.cos(heading), np.sin(heading)
        for sx, sy, sw in np.ndindex(2, 2, 2):
            v = limits * (2 * np.array([sx, sy, sw]) - 1)
            seen = np.array([c * v[0] + s * v[1], -s * v[0] + c * v[1], v[2]])
            worst = max(worst, np.abs(DELBOT.wheel_rates(seen)).max())
    assert worst == pytest.approx(WHEEL_RATE, abs=1e-9)


def test_delbots_base_limits_are_those_of_its_wheels():
    robot = load_robot("delbot", group="base")
    limits = DELBOT.velocity_limits(WHEEL_RATE)
    assert (robot.limits.velocity <= limits + 1e-12).all()
    assert np.allclose(robot.limits.velocity, limits, rtol=1e-3)


def test_delbots_wheels_stand_where_the_matrix_has_them():
    """Reference delbot.mecanum.missing: axles at 0.296126 and -0.287692 m, radius 0.03 m."""
    geometry = load_robot("delbot").geometry.geometryObjects
    wheels = [item for item in geometry if getattr(item.geometry, "radius", 0) == 0.03]
    x = sorted(item.placement.translation[0] for item in wheels)
    assert x == pytest.approx([-0.287692, -0.287692, 0.296126, 0.296126], abs=1e-9)
    assert (x[3] - x[0]) / 2 == pytest.approx(DELBOT.half_wheelbase, abs=1e-5)


def test_a_robot_file_may_say_which_joints_stand_for_wheels(tmp_path):
    base = load_robot("delbot", group="base")
    q = np.array([1.0, -2.0, np.pi / 2])  # heading along y of the world
    assert wheel_matrix(base, q) @ [0.0, 0.3, 0.0] == pytest.approx(DELBOT.wheel_rates(np.array([0.3, 0.0, 0.0])))
    assert load_robot("delbot", group="arm").mecanum is None
    assert wheel_matrix(load_robot("ur5"), np.zeros(6)) is None
    text = (base.source.parent / "robot.yaml").read_text()
    (tmp_path / "robot.yaml").write_text(text.replace("[base_x, base_y, base_yaw], r", "[x, base_yaw, base_yaw], r"))
    with pytest.raises(InputError) as caught:
        load_robot(str(tmp_path / "robot.yaml"))
    sliding = "expected one of: base_x, base_y, finger_left, finger_right"
    told = "\n".join(map(str, caught.value.issues))
    assert f"mecanum.joints[0]: unknown joint 'x'; {sliding}" in told
    assert f"mecanum.joints[1]: the revolute joint 'base_yaw'; {sliding}" in told
