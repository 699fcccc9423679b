"""Angles in degrees: `rpy_deg` and `joints_deg`; what was meant in degrees is not taken as rad."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.geometry.poses import pose_from_data
from optiplan.robot.robot import load_robot

FILE = """version: 1
name: degrees
robot: {robot}
start: {start}
goal: {goal}
scene:
  obstacles:
    - {{name: box, shape: {{box: [0.1, 0.1, 0.1]}}, pose: {{position: [2, 0, 0], {rotation}}}}}
"""
START = "{joints: [0, -1.5, 1.5, -1.5, -1.5, 0]}"
GOAL = "{pose: {position: [0.4, 0.2, 0.4], rpy: [3.14, 0, 0]}}"


def load(tmp_path, robot="ur5", start=START, goal=GOAL, rotation="rpy: [0, 0, 0.5]"):
    file = tmp_path / "problem.yaml"
    file.write_text(FILE.format(robot=robot, start=start, goal=goal, rotation=rotation))
    return op.load_problem(file)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rotation": "rpy: [180, 0, 0]"},
        {"goal": "{pose: {position: [0.4, 0.2, 0.4], rpy: [0, 0, -90]}}"},
        {"goal": "{region: {position: [0.4, 0.2, 0.4], rpy: [0, 45, 0], about: {z: free}}}"},
    ],
)
def test_angles_beyond_a_turn_are_refused_with_a_hint(tmp_path, wrong):
    with pytest.raises(op.InputError, match=r"problem\.yaml:\d+: .*rpy.*within a turn.*for degrees: rpy_deg"):
        load(tmp_path, **wrong)


def test_a_whole_turn_as_people_print_it_is_none():
    for angle in (6.2832, -2.0 * np.pi):
        assert np.allclose(pose_from_data({"rpy": [angle, 0.0, 0.0]}).rotation, np.eye(3), atol=1e-4)
    with pytest.raises(ValueError, match=r"within a turn \(6.2832\)$"):  # who reads a key `rpy_deg` points to it
        pose_from_data({"rpy": [6.5, 0.0, 0.0]})


def test_degrees_are_the_same_problem_as_radians(tmp_path):
    goals = [f"{{pose: {{position: [0.4, 0.2, 0.4], {words}}}}}" for words in ("rpy_deg: [180, 0, 90]", "{}")]
    radians = f"rpy: [{np.pi!r}, 0, {np.pi / 2!r}]"
    a = load(tmp_path, start="{joints_deg: [0, -90, 90, -90, -90, 0]}", goal=goals[0], rotation="rpy_deg: [0, 0, 30]")
    joints = ", ".join(repr(float(np.deg2rad(x))) for x in (0, -90, 90, -90, -90, 0))
    goal = goals[1].replace("{}", radians)
    b = load(tmp_path, start=f"{{joints: [{joints}]}}", goal=goal, rotation=f"rpy: [0, 0, {float(np.deg2rad(30))!r}]")
    assert np.allclose(a.goal[0].X_WG.homogeneous, b.goal[0].X_WG.homogeneous, atol=0.0)
    assert np.allclose(a.scene.obstacles[0].X_WO.homogeneous, b.scene.obstacles[0].X_WO.homogeneous, atol=0.0)
    np.testing.assert_array_equal(a.start, b.start)


def test_sliding_joints_are_in_metres_among_degrees(tmp_path):
    robot = op.load_robot("srra")
    problem = op.load_problem("15_srra")
    values = np.where(robot.revolute, np.rad2deg(problem.start), problem.start)
    goal = f"{{joints_deg: {values.tolist()}}}"
    found = load(tmp_path, "srra", f"{{joints: {problem.start.tolist()}}}", goal).goal[0].q
    np.testing.assert_allclose(found, problem.start, atol=1e-12)


@pytest.mark.parametrize(
    ("start", "says"),
    [
        ("{joints: [0, -90, 90, -90, -90, 0]}", r"joints\[1\]: .*outside its limits.*for degrees: joints_deg"),
        ("{joints: [0], joints_deg: [0]}", "exactly one of: joints, joints_deg, configuration"),
        (
            "{joints_deg: [0, -900, 90, -90, -90, 0]}",
            r"joints_deg\[1\]: .* = -900 degrees, outside its limits; .* \[-360, 360\] degrees",
        ),
        ("{joints_deg: [0, true, 90, -90, -90, 0]}", r"joints_deg\[1\]"),
        ("{joints_deg: [0]}", "1 values; expected 6 values"),
    ],
)
def test_joints_in_degrees_are_checked(tmp_path, start, says):
    with pytest.raises(op.InputError, match=says):
        load(tmp_path, start=start)


@pytest.mark.parametrize(
    "rotation",
    [
        "rpy: [0, 0, 1], rpy_deg: [0, 0, 1]",
        "rpy_deg: [0, 1]",
        "rpy_deg: [0, true, 1]",
        "rpy_deg: x",
        "rpy_deg: [0, 0, 1], quaternion: [0, 0, 0, 1]",
    ],
)
def test_degrees_of_another_form_are_refused(tmp_path, rotation):
    with pytest.raises(op.InputError, match=r"problem\.yaml:8: scene\.obstacles\[0\]\.pose"):
        load(tmp_path, rotation=rotation)


@pytest.mark.parametrize(("angle", "says"), [(".nan", "NaN"), (".inf", "infinity")])
def test_degrees_that_are_no_numbers_are_told_once(tmp_path, angle, says):
    with pytest.raises(op.InputError) as caught:
        load(tmp_path, rotation=f"rpy_deg: [0, {angle}, 0]")
    assert [(issue.field, issue.found) for issue in caught.value.issues] == [
        ("scene.obstacles[0].pose.rpy_deg[1]", says)
    ]
    with pytest.raises(ValueError, match="in rpy_deg; expected three finite numbers"):
        pose_from_data({"rpy_deg": [0.0, float(angle[1:]), 0.0]})


def test_steps_of_tasks_and_vias_take_degrees(tmp_path):
    file = tmp_path / "task.yaml"
    file.write_text(
        "version: 1\nrobot: ur5\nstart: {joints_deg: [0, -90, 90, -90, -90, 0]}\ntask:\n"
        "  - move: {joints_deg: [30, -90, 90, -90, -90, 0], via: [{joints_deg: [10, -80, 90, -90, -90, 0]}]}\n"
    )
    (step,) = op.load_problem(file).task
    assert np.allclose(step.action.goal[0].q[0], np.deg2rad(30))
    assert np.allclose(step.action.vias[0].at.q[:2], np.deg2rad([10, -80]))


def test_python_takes_degrees():
    pose = op.Pose((0.4, 0.2, 0.4), rpy_deg=(180, 0, 90))
    assert pose == op.Pose((0.4, 0.2, 0.4), rpy=(np.pi, 0.0, np.pi / 2))
    assert "rpy_deg" not in repr(pose)
    region = op.Region((0.4, 0.2, 0.4), rpy_deg=(180, 0, 0), about={"z": "free"})
    assert np.allclose(region.rpy, (np.pi, 0, 0))
    for made in (
        op.Box("a", (1, 1, 1), rpy_deg=(0, 0, 90)),
        op.Cylinder("a", 1, 1, rpy_deg=(0, 0, 90)),
        op.Capsule("a", 1, 1, rpy_deg=(0, 0, 90)),
    ):
        assert np.allclose(made.X_WO.rotation, pin.rpy.rpyToMatrix(0.0, 0.0, np.pi / 2))
    with pytest.raises(op.InputError, match=r"op\.Box: rpy: .*180.*rpy_deg"):
        op.Box("a", (1, 1, 1), rpy=(180, 0, 0))
    with pytest.raises(op.InputError, match=r"op\.Pose: rpy"):
        op.Pose((0, 0, 1), rpy=(180, 0, 0))
    with pytest.raises(op.InputError, match=r"op\.Box: rpy: 800 in rpy_deg; expected .* \(360\)"):
        op.Box("a", (1, 1, 1), rpy_deg=(800, 0, 0))
    with pytest.raises(op.InputError, match=r"op\.Pose: rpy_deg\[0\]: 1000"):
        op.Pose((0, 0, 1), rpy_deg=(10**400, 0, 0))
    with pytest.raises(op.InputError, match="both rpy and rpy_deg"):
        op.Pose((0, 0, 1), rpy=(1, 0, 0), rpy_deg=(1, 0, 0))
    problem = op.Problem(
        "ur5", {"joints_deg": [0, -90, 90, -90, -90, 0]}, goal={"joints_deg": [9, -90, 90, -90, -90, 0]}
    )
    assert np.allclose(problem.start[1], -np.pi / 2)


@pytest.mark.parametrize(("unit", "fits"), [("deg", True), ("rad", False)])
def test_poses_of_dh_tables(tmp_path, unit, fits):
    row = "{joint: revolute, a: 0.5, limits: [-1, 1], geometry: [{box: [0.1, 0.1, 0.1], rpy: [180, 0, 0]}]}"
    file = tmp_path / "robot.yaml"
    file.write_text(f"version: 1\nname: arm\ndh: {{convention: standard, unit: {unit}, rows: [{row}]}}\n")
    if fits:
        assert op.load_robot(file).n == 1
    else:
        with pytest.raises(op.InputError, match="rpy_deg"):
            op.load_robot(file)
    file.write_text(file.read_text().replace("rpy: [180", "rpy_deg: [180"))
    assert op.load_robot(file).n == 1


def test_configurations_of_a_robot_file_may_be_in_degrees(arm):
    given = {"urdf": str(arm.with_name("arm.urdf")), "group": ["shoulder", "elbow"]}
    robot = load_robot({**given, "configurations": {"a": [0.5, 0]}, "configurations_deg": {"b": [90, -45]}})
    assert np.allclose(robot.configurations["b"], [np.pi / 2.0, -np.pi / 4.0])
    with pytest.raises(op.InputError, match="in `configurations` too"):
        load_robot({**given, "configurations": {"a": [0.5, 0]}, "configurations_deg": {"a": [90, -45]}})
