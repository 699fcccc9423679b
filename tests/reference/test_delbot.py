"""The report on the Delbot: its arm by the table, its Jacobian, the circle it draws, its reach, and its numbers."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.poses import pose_from_data
from optiplan.kinematics.manipulability import ToolKinematics, manipulability_measures
from optiplan.robot.dh.table import DhTable, forward, frames
from optiplan.robot.frames import geometric_jacobian
from optiplan.robot.robot import Robot, load_robot
from optiplan.workspace.sampling import Workspace, WorkspaceOptions, study_workspace
from tests.reference.entries import Entry, entry, matches
from tests.reference.poses import tool_pose

HOME = np.zeros(6)
PRINTED_FRAMES = (0, 1, 2, 4, 5, 6)  # whose axes figure 13 takes, instead of 0 to 5


@pytest.fixture(scope="module")
def arm() -> Robot:
    return load_robot("delbot", group="arm")


@pytest.fixture(scope="module")
def table(arm) -> DhTable:
    return arm.dh


@pytest.fixture(scope="module")
def printed_table(table) -> DhTable:
    """With the signs of alpha as the report prints them."""
    signs = entry("delbot.dh").printed["alpha_rows_3_4"]
    rows = [replace(row, alpha=signs[i - 3]) if i in (3, 4) else row for i, row in enumerate(table.rows)]
    return DhTable("standard", tuple(rows))


def columns(table: DhTable, q: np.ndarray, used: tuple[int, ...] = (0, 1, 2, 3, 4, 5)) -> np.ndarray:
    """[z x (p_e - p); z] of the frames used, in frame 0: (6, 6); those of joints 1 to 6 are 0 to 5."""
    X = frames(table, q)
    z, p = X[list(used), :3, 2], X[list(used), :3, 3]
    return np.vstack([np.cross(z, X[6, :3, 3] - p).T, z.T])


def test_delbot_dh(table):
    expected = entry("delbot.dh")
    assert table.convention == "standard"
    assert [row.joint for row in table.rows] == ["revolute"] * 6
    for key, field in (("theta_offset", "theta"), ("a", "a"), ("d", "d"), ("alpha", "alpha")):
        expected.check([getattr(row, field) for row in table.rows], key)
    assert np.allclose(np.negative(expected.printed["alpha_rows_3_4"]), expected["alpha"][3:5])


def test_delbot_T0eff_home(arm, table):
    expected = entry("delbot.T0eff.home")
    expected.check(forward(table, HOME))
    X_W0, X_W6 = (tool_pose(arm, HOME, name) for name in ("arm_base", table.rows[5].name))
    expected.check(np.linalg.inv(X_W0) @ X_W6)
    five = frames(table, HOME)[5]  # the report says that five factors are enough
    assert five[1, 3] == pytest.approx(-0.11235)


def test_delbot_base_to_arm(arm):
    """As printed, turned about x by pi; the URDF, and the robot here, let the arm stand upright above the deck."""
    expected = entry("delbot.base_to_arm")
    expected.check(pose_from_data({"position": [0.163, 0.0, 0.279], "rpy": [np.pi, 0.0, 0.0]}).homogeneous)
    mounted = np.linalg.inv(tool_pose(arm, HOME, "chassis")) @ tool_pose(arm, HOME, "arm_base")
    assert matches(mounted[:3, 3], np.array(expected.value)[:3, 3], expected.tolerance)
    assert matches(mounted[:3, :3], np.eye(3), expected.tolerance)
    assert np.linalg.norm(mounted[:3, 3] - [0.162792, 0.0, 0.2788]) < 5e-4


def test_delbot_Tbeff_home(table):
    expected = entry("delbot.Tbeff.home")
    expected.check(np.array(entry("delbot.base_to_arm").value) @ forward(table, HOME))
    assert expected[2][3] < 0.370  # below the deck: the printed mount puts the tool into the chassis


def test_delbot_points(table):
    expected = entry("delbot.points")
    ends = [forward(table, np.array(expected[key]))[:3, 3] for key in ("q_init", "q_final")]
    expected.check(ends[0], "p_init")
    expected.check(ends[1], "p_final")
    distance = np.linalg.norm(ends[1] - ends[0])
    expected.check(distance, "distance")
    assert abs(distance - 0.6069) > 4e-4  # as printed


def test_delbot_fk_home_with_printed_table(printed_table):
    expected = entry("delbot.fk_home_with_printed_table")
    X = forward(printed_table, HOME)
    expected.check(X[2, 3], "T0eff_z")
    expected.check((np.array(entry("delbot.base_to_arm").value) @ X)[2, 3], "Tbeff_z")
    end = forward(printed_table, np.array(entry("delbot.points")["q_final"]))[:3, 3]
    expected.check(end, "p_final")
    expected.check(np.linalg.norm(end - X[:3, 3]), "distance")
    assert abs(X[2, 3] - entry("delbot.T0eff.home")[2][3]) > 0.1


def arm_jacobian(arm: Robot, q: np.ndarray) -> np.ndarray:
    """Of the last frame of the table, along the axes of frame 0, from pinocchio."""
    R = tool_pose(arm, q, "arm_base")[:3, :3].T
    return np.kron(np.eye(2), R) @ geometric_jacobian(arm, q, arm.dh.rows[5].name)


def test_delbot_jacobian_home(arm, table):
    expected = entry("delbot.jacobian.home")
    J = arm_jacobian(arm, HOME)
    expected.check(J)
    assert np.linalg.matrix_rank(J, tol=1e-9) == 5
    printed = np.array(expected.printed)
    assert matches(columns(table, HOME, PRINTED_FRAMES), printed, 1e-12)
    assert np.abs(printed - expected.value)[:, 3:].max() > 0.9
    q = np.array([0.3, -0.8, 1.1, 0.4, 0.9, -0.5])
    wrong = columns(table, q, PRINTED_FRAMES)[:3] - columns(table, q)[:3]
    assert np.abs(wrong).max() == pytest.approx(0.158, abs=5e-4)


def test_delbot_jacobian_formula(arm, table):
    for q in np.random.default_rng(8).uniform(-np.pi, np.pi, (200, 6)):
        assert matches(columns(table, q), arm_jacobian(arm, q), entry("delbot.jacobian.formula").tolerance)


def draw(table: DhTable, jacobian: Callable[[np.ndarray], np.ndarray], circle: Entry) -> np.ndarray:
    """Tool points (steps + 1, 3) of the report's script: explicit Euler with the pseudo-inverse, from home."""
    steps, dt = circle["steps"], circle["duration"] / circle["steps"]
    q, points = HOME, [forward(table, HOME)[:3, 3]]
    for angle in np.pi / 2 + 2.0 * np.pi * np.arange(steps) / steps:
        twist = circle["speed"] * np.array([0.0, -np.sin(angle), np.cos(angle), 0.0, 0.0, 0.0])
        q = q + dt * np.linalg.pinv(jacobian(q), rcond=1e-12) @ twist
        points.append(forward(table, q)[:3, 3])
    return np.array(points)


def test_delbot_circle_script(arm, table):
    """The script's circle of "radius 0.5" is one of 1/8 of that, does not close and leaves its plane."""
    expected = entry("delbot.circle.script")
    expected.check(np.pi * expected["nominal_radius"] / (4.0 * expected["duration"]), "speed")
    expected.check(expected["speed"] * expected["duration"] / (2.0 * np.pi), "effective_radius")
    points = draw(table, lambda q: columns(table, q, PRINTED_FRAMES), expected)
    expected.check(np.linalg.norm(points[-1] - points[0]), "closure_repo_jacobian")
    for i, key in enumerate(("x_drift", "y_extent", "z_extent")):
        expected.check(np.ptp(points[:, i]), key)
    points = draw(table, lambda q: arm_jacobian(arm, q), expected)
    expected.check(np.linalg.norm(points[-1] - points[0]), "closure_correct_jacobian_from_home")


class Circle:
    """The circle of the reference entry, in the plane yz, from its top, and the joint rates that follow it."""

    def __init__(self, arm: Robot, circle: Entry, gain: float = 0.0) -> None:
        self.arm, self.radius, self.turning, self.gain = arm, circle["radius"], 2.0 * np.pi / circle["T"], gain
        self.top, self.peak = np.array(circle["p0"]), 0.0
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def point(self, t: float) -> np.ndarray:
        angle = self.turning * t
        return self.top + self.radius * np.array([0.0, -np.sin(angle), np.cos(angle) - 1.0])

    def tool(self, q: np.ndarray) -> np.ndarray:
        """Where it is, which is asked at the end of a step and at the beginning of the next one."""
        if self._last is None or self._last[0] is not q:
            self._last = q, forward(self.arm.dh, q)[:3, 3]
        return self._last[1]

    def rates(self, t: float, q: np.ndarray) -> np.ndarray:
        angle, speed = self.turning * t, self.radius * self.turning
        velocity = speed * np.array([0.0, -np.cos(angle), -np.sin(angle)])
        error = self.point(t) - self.tool(q)
        dq = np.linalg.solve(arm_jacobian(self.arm, q), np.concatenate([velocity + self.gain * error, np.zeros(3)]))
        self.peak = max(self.peak, float(np.abs(dq).max()))
        return dq

    def follow(self, q: np.ndarray, duration: float, steps: int, rk4: bool = False) -> tuple[float, float]:
        """Closing error and largest distance from the circle, m."""
        dt, worst = duration / steps, 0.0
        for k in range(steps):
            t, k1 = k * dt, self.rates(k * dt, q)
            step = k1
            if rk4:
                k2 = self.rates(t + dt / 2, q + dt / 2 * k1)
                k3 = self.rates(t + dt / 2, q + dt / 2 * k2)
                step = (k1 + 2.0 * k2 + 2.0 * k3 + self.rates(t + dt, q + dt * k3)) / 6.0
            q = q + dt * step
            worst = max(worst, float(np.linalg.norm(self.tool(q) - self.point(t + dt))))
        return float(np.linalg.norm(self.tool(q) - self.top)), worst


def test_delbot_circle_reference(arm, table):
    expected = entry("delbot.circle.reference")
    q0 = np.array(expected["q0"])
    assert np.abs(forward(table, q0)[:3, 3] - expected["p0"]).max() < 1e-12
    J = ToolKinematics(arm, table.rows[5].name).evaluate(q0[None])[1]
    expected.check(manipulability_measures(J).yoshikawa[0], "manipulability", relative=True)
    runs = [(f"{'rk4' if rk4 else 'euler'}_{steps}", steps, rk4) for steps in (40, 400, 4000) for rk4 in (False, True)]
    for name, steps, rk4 in runs[:-1]:
        circle = Circle(arm, expected)
        closing, worst = circle.follow(q0, expected["T"], steps, rk4)
        expected.check(closing, "closure", name, relative=True)
        if name in expected["max_deviation"]:
            expected.check(worst, "max_deviation", name, relative=True)
        expected.check(circle.peak, "peak_joint_rate", relative=True)
    closing, worst = Circle(arm, expected, gain=4.0).follow(q0, expected["T"], 40)
    expected.check(closing, "euler_40_with_feedback_gain_4", "closure", relative=True)
    expected.check(worst, "euler_40_with_feedback_gain_4", "max_deviation", relative=True)


def test_delbot_dof():
    expected = entry("delbot.dof")
    whole, arm, base = (load_robot("delbot", group=name) for name in ("all", "arm", "base"))
    assert (base.n, arm.n) == (expected["base"], expected["arm"])
    fingers = [name for name in whole.locked if "finger" in name]
    assert len(fingers) == 2 * expected["gripper"]  # two that move as one
    assert whole.n + expected["gripper"] == expected["total"]
    assert whole.n - 6 == expected["task_redundancy"]
    home = np.zeros(9)
    generic = np.random.default_rng(9).uniform(-1.0, 1.0, 9)
    for q, key in ((home, "rank_6x9_at_home"), (generic, "rank_6x9_generic")):
        J = geometric_jacobian(whole, q, arm.dh.rows[5].name)
        assert np.linalg.matrix_rank(J, tol=1e-9) == expected[key]


def test_delbot_gazebo():
    """Pitch is near -pi/2, where roll and yaw are hard to tell apart; the quaternion is not quite of length 1."""
    expected = entry("delbot.gazebo")
    expected.check(np.linalg.norm(expected["quaternion_xyzw"]), "quaternion_norm")
    X = pose_from_data({"position": expected["position"], "quaternion": expected["quaternion_xyzw"]})
    rpy = pin.rpy.matrixToRpy(X.rotation)
    expected.check(rpy, "rpy_from_quaternion")
    assert np.linalg.norm(pin.log3(X.rotation.T @ pin.rpy.rpyToMatrix(*expected["rpy"]))) < 0.01
    assert abs(entry("delbot.points")["distance"] - expected["distance"]) > 0.28  # another zero pose, not an error


def study(arm: Robot, count: int) -> Workspace:
    """The report's: so many values a joint in [-pi, pi], collisions left aside, the flange of the table."""
    bounds = replace(arm.limits, lower=np.full(6, -np.pi), upper=np.full(6, np.pi))
    flange = replace(arm, limits=bounds, tool_frame=arm.dh.rows[5].name)
    return study_workspace(flange, WorkspaceOptions(grid=count, collision=False), processes=1)


def test_delbot_workspace(arm, table):
    expected = entry("delbot.workspace")
    foot = tool_pose(arm, HOME, "arm_base")[:3, 3]
    for name, found in (("3", study(arm, 3)), ("5", study(arm, 5))):
        points = found.samples.position - foot
        expected.check(len(points), f"points_{name}_pow_6")
        distinct = np.unique(np.round(points, 6) + 0.0, axis=0)
        expected.check(len(distinct), f"grid{name}_distinct_points")
        assert np.abs(forward(table, found.samples.q)[:, :3, 3] - points).max() < 1e-12
    expected.check(points.min(axis=0), "grid5_bbox", "min")
    expected.check(points.max(axis=0), "grid5_bbox", "max")
    expected.check(found.reach.largest, "reach_from_shoulder")
    expected.check(found.reach.least, "sampled_min")
    expected.check(found.reach.shoulder - foot, "reach_point")
    expected.check(
        5.0 * abs(table.rows[1].a), "script_chain_radius"
    )  # what figure 8 shows: five equal links in a plane
    assert expected["script_chain_radius"] > 2.0 * found.reach.largest
