"""The check `via`: what it must pass, and what it must refuse."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.geometry.scene import Scene
from optiplan.problem.problem import JointGoal, PoseGoal, Via, derived
from optiplan.robot.robot import load_robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import via_check
from optiplan.verify.limit_checks import miss
from optiplan.verify.verify import verify
from optiplan.verify.via_check import vias
from tests.verify.motions import problem_of, quintic, smooth, within_limits


def joints(q, tolerance=1e-6):
    return Via(JointGoal(np.array(q, dtype=float), tolerance))


def tool(robot, q, tolerance=1e-6):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array(q, dtype=float))
    X = data.oMf[robot.model.getFrameId(robot.tool_frame)].copy()
    return Via(PoseGoal(robot.tool_frame, X, tolerance, tolerance))


@pytest.fixture(scope="module")
def line():
    """Straight in joint space: both joints of the planar arm stay equal."""
    robot = load_robot("planar2r")
    motion = within_limits(quintic(robot.joint_names, [0.0, 0.0], [1.0, 1.0], 1.0), robot.limits)
    return problem_of(robot, motion, Scene()), motion


def check(line, *points):
    problem, motion = line
    return vias(derived(problem, vias=points), motion)


def test_a_problem_without_vias_has_no_such_check(line):
    assert "via" not in [one.name for one in verify(*line).checks]


def test_vias_on_the_way_are_passed_exactly(line):
    found = check(line, joints([0.0, 0.0]), joints([0.25, 0.25]), joints([0.9, 0.9]), joints([1.0, 1.0]))
    assert found.passed
    assert found.kind == "exact"
    assert found.worst < 1e-9
    assert found.witness["times"] == sorted(found.witness["times"])
    q = line[1](np.array(found.witness["times"]))
    assert q == pytest.approx(np.array([[0, 0], [0.25, 0.25], [0.9, 0.9], [1, 1]]), abs=1e-8)


@pytest.mark.parametrize(("off", "verdict"), [(0.999e-6, True), (1.01e-6, False)])
def test_a_via_is_missed_by_a_hair(line, off, verdict):
    """The nearest point of the line to (x + d, x - d) is (x, x), by the largest joint error d."""
    found = check(line, joints([0.3 + off, 0.3 - off]))
    assert found.passed is verdict
    assert found.worst == pytest.approx(off, rel=1e-3)
    assert line[1](np.array([found.time]))[0] == pytest.approx([0.3, 0.3], abs=1e-6)


def test_vias_in_the_wrong_order_are_refused(line):
    found = check(line, joints([0.6, 0.6]), joints([0.4, 0.4]))
    assert not found.passed
    assert found.witness["via"] == 2
    assert found.worst == pytest.approx(0.2, abs=2e-6)
    assert "via 2 of 2 is missed" in found.detail
    assert not verify(derived(line[0], vias=(joints([0.6, 0.6]), joints([0.4, 0.4]))), line[1]).verified


def test_one_place_serves_two_vias_in_a_row(line):
    assert check(line, joints([0.5, 0.5]), joints([0.5, 0.5])).passed


def test_a_motion_that_comes_back_passes_both_ways(planar):
    there_and_back = smooth(planar.joint_names, [[0.0, 0.0], [1.0, 0.5], [0.0, 0.0]], 4.0)
    problem = problem_of(planar, there_and_back, Scene())
    q = there_and_back(np.array([1.0, 2.0]))
    for order, verdict in (((0, 1, 0), True), ((1, 0, 1), False)):
        assert vias(derived(problem, vias=tuple(joints(q[i]) for i in order)), there_and_back).passed is verdict


def test_a_pose_is_found_between_samples(line):
    found = check(line, joints([0.1, 0.1]), tool(line[0].robot, line[1](np.array([0.4567891 * line[1].duration]))[0]))
    assert found.passed
    assert found.kind == "sampled"
    assert found.time == pytest.approx(0.4567891 * line[1].duration, abs=1e-6)


def test_a_pose_off_the_way_is_missed_by_its_distance(line):
    robot = line[0].robot
    at = tool(robot, [0.5, 0.5])
    lifted = at.at.X_WG.copy()
    lifted.translation = lifted.translation + np.array([0.0, 0.01, 0.0])  # off the plane of motion
    found = check(line, Via(PoseGoal(robot.tool_frame, lifted, 1e-3, 1e-2)))
    assert not found.passed
    assert (found.unit, found.limit) == ("m", 1e-3)
    assert found.worst == pytest.approx(0.01, abs=1e-6)
    assert check(line, Via(PoseGoal(robot.tool_frame, lifted, 0.0101, 1e-2))).passed


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 5), st.floats(1e-7, 0.3))
def test_it_says_the_same_as_dense_samples(seed, degree, tolerance):
    """Where samples are inside, it passes; where it refuses, no sample is nearer than it says."""
    rng = np.random.default_rng(seed)
    h, coefficients = rng.uniform(0.1, 1.0, 4), rng.normal(size=(4, degree + 1, 2))
    for i in range(3):  # no steps
        coefficients[i + 1, 0] = h[i] ** np.arange(degree + 1) @ coefficients[i]
    motion = Trajectory(("a", "b"), np.append(0.0, np.cumsum(h)), coefficients)
    robot = load_robot("planar2r")
    problem = derived(problem_of(robot, motion, Scene()), vias=(joints(rng.normal(size=2), tolerance),))
    found = vias(problem, motion)
    distance = np.abs(motion(np.linspace(0.0, motion.duration, 5000)) - problem.vias[0].at.q).max(axis=1)
    assert found.worst <= distance.min() + 1e-9
    assert found.passed == (found.worst <= tolerance + 1e-9)
    nearest = np.abs(motion(np.array([found.time]))[0] - problem.vias[0].at.q).max()
    assert found.worst == pytest.approx(nearest, abs=1e-12)


def test_a_pose_is_looked_for_in_all_samples_at_once(line, monkeypatch):
    """One configuration at a time, 500 a second for each via, took longer than planning a tour of twelve vias."""
    problem, motion = line
    motion = motion.scaled(10.0)
    counted = []
    monkeypatch.setattr(via_check, "miss", lambda *given: counted.append(1) or miss(*given))
    points = [tool(problem.robot, motion(share * motion.duration)) for share in np.linspace(0.1, 0.9, 9)]
    found = vias(derived(problem, vias=tuple(points)), motion)
    assert found.passed, found.detail
    assert len(counted) < 100 * len(points)
