"""The Delbot's platform: dimensions, mecanum wheels, and what the published URDF (optional test data) makes of them."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.kinematics.mecanum import WHEELS, Mecanum
from optiplan.robot.robot import Robot, load_robot
from tests.reference.entries import entry


@pytest.fixture(scope="module")
def delbot() -> Robot:
    return load_robot("delbot")


@pytest.fixture(scope="module")
def published(shared) -> Path:
    return shared / "robots" / "delbot_report"


@pytest.fixture(scope="module")
def model(published) -> pin.Model:
    return pin.buildModelFromUrdf(str(published / "urdf" / "vehicle_assembly.urdf"))


@pytest.fixture(scope="module")
def mecanum() -> Mecanum:
    size = entry("delbot.mecanum.missing")
    return Mecanum(size["wheel_radius"], size["half_wheelbase"], size["half_track_roller_centre"])


def bodies(robot: Robot, link: str) -> list[pin.GeometryObject]:
    return [body for i, body in enumerate(robot.geometry.geometryObjects) if robot.link_of(i) == link]


def heights(robot: Robot, link: str) -> tuple[float, float]:
    """Lowest and highest z, m, of the boxes of a link, in the frame of the chassis."""
    found = [b for b in bodies(robot, link) if hasattr(b.geometry, "halfSide")]
    ends = [(b.placement.translation[2] + sign * b.geometry.halfSide[2]) for b in found for sign in (-1.0, 1.0)]
    return min(ends), max(ends)


def test_delbot_dimensions(delbot):
    expected = entry("delbot.dimensions")
    body, *wheels = (part.geometry for part in bodies(delbot, "chassis"))
    floor, *walls = (part.geometry for part in bodies(delbot, "carrier"))
    expected.check(2.0 * body.halfSide[0], "body", "length")
    expected.check(2.0 * body.halfSide[1], "body", "width")
    expected.check(heights(delbot, "carrier")[1] - heights(delbot, "chassis")[0], "body", "height")
    expected.check(2.0 * floor.halfSide[1], "carrier", "length")
    expected.check(2.0 * floor.halfSide[0], "carrier", "width")
    assert len(walls) == 4
    for wall in walls:
        expected.check(2.0 * wall.halfSide[2], "carrier", "height")
    assert len(wheels) == 4
    for wheel in wheels:
        expected.check(2.0 * wheel.radius, "wheel_diameter")


def test_delbot_dimensions_of_the_meshes(published, model):
    """The published meshes are those of the report, but for the rollers: 11.96 mm x 29.0 mm instead of 10.56 x 28."""
    import trimesh

    expected = entry("delbot.dimensions")
    size = trimesh.load(published / "meshes" / "base_link.STL").extents
    body = expected["body"]
    assert np.allclose(sorted(size), sorted([0.792, body["width"], body["height"]]), atol=5e-4)
    roller = sorted(trimesh.load(published / "meshes" / "front_left_roller_1.STL").extents)
    assert np.allclose(roller, [0.01196, 0.01196, 0.0290], atol=5e-5)
    assert roller[0] - expected["roller_diameter"] > 1e-3
    assert roller[2] - expected["roller_length"] > 9e-4
    for wheel in WHEELS:
        rollers = [name for name in model.names if name.startswith(f"{wheel}_roller_joint")]
        expected.check(len(rollers), "rollers_per_wheel")
        expected.check(np.arccos(abs(ground_roller(model, wheel)[1] @ [0.0, 1.0, 0.0])), "roller_angle")


def ground_roller(model: pin.Model, wheel: str) -> tuple[np.ndarray, np.ndarray]:
    """Centre (3,), m, and axis (3,) in the base of roller 1, the wheel turned until it is at the bottom."""
    hub, joint = (model.getJointId(f"{wheel}_{name}") for name in ("wheel_joint", "roller_joint_1"))
    centre, axis = (
        model.jointPlacements[joint] * model.inertias[joint].lever,
        model.jointPlacements[joint].rotation[:, 2],
    )
    X_BH = model.jointPlacements[hub]
    down = X_BH.rotation.T @ [0.0, 0.0, -1.0]
    turned = pin.AngleAxis(np.arctan2(down[1], down[0]) - np.arctan2(centre[1], centre[0]), np.array([0.0, 0.0, 1.0]))
    R = turned.matrix()
    return X_BH * (R @ centre), X_BH.rotation @ R @ axis


def test_delbot_mecanum_missing(delbot, model):
    expected = entry("delbot.mecanum.missing")
    x = sorted({round(float(part.placement.translation[0]), 9) for part in bodies(delbot, "chassis")[1:]})
    for front, rear, radius in ((x[1], x[0], bodies(delbot, "chassis")[1].geometry.radius), hubs(model)):
        expected.check(front, "front_axle_x")
        expected.check(rear, "rear_axle_x")
        expected.check(0.5 * (front - rear), "half_wheelbase")
        expected.check(radius, "wheel_radius")
    placed = [model.jointPlacements[model.getJointId(f"{wheel}_wheel_joint")].translation for wheel in WHEELS]
    for hub, wheel in zip(placed, WHEELS, strict=True):
        expected.check(abs(hub[1]), "half_track_hub")
        expected.check(abs(ground_roller(model, wheel)[0][1]), "half_track_roller_centre")
    assert 0.5 * (expected["front_axle_x"] + expected["rear_axle_x"]) == pytest.approx(0.0042, abs=5e-5)


def hubs(model: pin.Model) -> tuple[float, float, float]:
    front, rear = (
        model.jointPlacements[model.getJointId(f"{end}_left_wheel_joint")].translation for end in ("front", "rear")
    )
    return front[0], rear[0], front[2]  # the wheels stand on z = 0


def test_delbot_mecanum_inverse(mecanum):
    expected = entry("delbot.mecanum.inverse")
    assert list(WHEELS) == expected["order"]
    expected.check(mecanum.matrix, "matrix")
    expected.check(mecanum.matrix * mecanum.radius, "matrix_times_r")
    expected.check(mecanum.wheel_rates(np.eye(3)).T, "matrix")
    assert np.linalg.matrix_rank(mecanum.matrix) == expected["rank"]
    twists = np.random.default_rng(10).uniform(-1.0, 1.0, (50, 3))
    assert np.abs(mecanum.base_twist(mecanum.wheel_rates(twists)) - twists).max() <= expected.tolerance


def test_delbot_mecanum_urdf_rank(model, mecanum):
    """All four wheels of the URDF have rollers of the same hand: x - y and the turn are all that they can drive."""
    expected = entry("delbot.mecanum.urdf_rank")
    size, rows = entry("delbot.mecanum.missing"), []
    for wheel in WHEELS:
        axis = ground_roller(model, wheel)[1][:2]
        axis = axis * np.sign(axis[1])
        expected.check(axis, "ground_roller_axis_all_wheels")
        x, y = ground_roller(model, wheel)[0][:2]
        rows.append(
            [axis[0], axis[1], axis[1] * x - axis[0] * y]
        )  # axis . velocity of the base there = that of the rim
    assert np.linalg.matrix_rank(rows, tol=1e-3) == expected["rank"]
    alternating = np.array(mecanum.matrix) * size["wheel_radius"]
    assert np.linalg.matrix_rank(alternating, tol=1e-3) == 3


def test_delbot_urdf_states(published, model, tmp_path):
    expected = entry("delbot.urdf.states")
    joints = expected["joint_order"]
    lines = [f"urdf: {published / 'urdf' / 'vehicle_assembly.urdf'}", f"group: [{', '.join(joints)}]"]
    states = [f"  {name}: {expected[name]}" for name in ("hand_pickup", "pose_drop")]
    head = ["version: 1", "name: delbot_report", "collision: none"]  # joints alone are looked at
    text = "\n".join([*head, *lines, "configurations:", *states])
    (tmp_path / "robot.yaml").write_text(text)
    robot = load_robot(str(tmp_path / "robot.yaml"))
    assert list(robot.joint_names) == joints
    for name in ("hand_pickup", "pose_drop"):
        expected.check(robot.configurations[name], name)
        assert (np.abs(robot.configurations[name]) <= robot.limits.upper).all()
    for end in (-robot.limits.lower, robot.limits.upper):
        assert np.abs(end[:5] - expected["arm_limits"]).max() <= expected.tolerance
        expected.check(end[5], "ee_limit")
    for j in range(6):
        expected.check(robot.limits.velocity[j], "velocity")
        expected.check(robot.limits.torque[j], "effort")
    for name in ("hand_open", "hand_close"):
        assert np.abs(expected[name]).max() <= 0.2  # the fingers' stroke in the URDF
    expected.check(sum(inertia.mass for inertia in model.inertias), "total_mass")
