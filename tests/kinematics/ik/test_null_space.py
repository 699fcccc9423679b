"""Redundant arms: the pose stays, the preference is met, limits hold."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import UnknownChoiceError
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.null_space import AIMS, Preference
from optiplan.kinematics.ik.numeric import IkOptions, random_seeds, solve_ik
from optiplan.robot.robot import load_robot

ROBOTS = ["panda", "baxter_left", "delbot"]


def preference(aim, robot):
    zero = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    return Preference(aim, zero if aim == "reference" else None)


def cost_at(chosen, robot, q):
    return chosen.cost(q, Descent(robot, robot.tool_frame).jacobian(q), robot.limits)


def manifold_slope(robot, q, gradient):
    """Least-squares norm of the gradient along what keeps the pose, joints at a limit that it pushes outward apart."""
    free = ~(((q < robot.limits.lower + 1e-5) & (gradient > 0)) | ((q > robot.limits.upper - 1e-5) & (gradient < 0)))
    J = Descent(robot, robot.tool_frame).jacobian(q)[:, free]
    weights = np.linalg.lstsq(J.T, gradient[free], rcond=None)[0]
    return np.linalg.norm(gradient[free] - J.T @ weights)


@pytest.mark.parametrize("aim", AIMS)
@pytest.mark.parametrize("name", ROBOTS)
def test_the_pose_stays_and_the_preference_is_met(name, aim):
    robot = load_robot(name)
    chosen, descent = preference(aim, robot), Descent(robot, robot.tool_frame)
    gains, slopes = [], []
    for seed in random_seeds(robot, np.zeros(robot.n), np.random.default_rng(2), 8):
        X_WG = descent.place(seed).copy()
        q = solve_ik(robot, robot.tool_frame, X_WG, [seed], IkOptions(count=1, prefer=chosen)).solutions[0]
        assert max(pose_error(descent.place(q), X_WG)) <= 1e-8
        assert ((robot.limits.lower <= q) & (q <= robot.limits.upper)).all()
        (before, steep), (after, flat) = cost_at(chosen, robot, seed), cost_at(chosen, robot, q)
        gains.append(before - after)
        slopes.append([manifold_slope(robot, seed, steep), manifold_slope(robot, q, flat)])
    assert min(gains) >= 0.0
    assert np.mean(gains) > 0.01
    steep, flat = np.median(slopes, axis=0)
    assert flat < 0.02 * steep


@pytest.mark.parametrize("aim", AIMS)
@pytest.mark.parametrize("name", ROBOTS)
def test_costs_are_the_formulas_and_gradients_their_differences(name, aim):
    robot = load_robot(name)
    chosen, h = preference(aim, robot), 1e-6
    low, high = robot.limits.lower, robot.limits.upper

    def formula(q):
        if aim == "manipulability":
            J = Descent(robot, robot.tool_frame).jacobian(q)
            return -np.log(np.sqrt(np.linalg.det(J @ J.T)))
        if aim == "reference":
            return 0.5 * np.sum((q - chosen.reference) ** 2)
        bounded = np.isfinite(low) & np.isfinite(high)
        middle, half = (low + high)[bounded] / 2, (high - low)[bounded] / 2
        return 0.5 * np.sum(((q[bounded] - middle) / half) ** 2)

    for q in random_seeds(robot, np.zeros(robot.n), np.random.default_rng(3), 3):
        cost, gradient = cost_at(chosen, robot, q)
        assert cost == pytest.approx(formula(q), abs=1e-9)
        differences = [(formula(q + step) - formula(q - step)) / (2 * h) for step in h * np.eye(robot.n)]
        np.testing.assert_allclose(gradient, differences, rtol=1e-5, atol=1e-6)


def test_position_alone_leaves_more_to_choose():
    robot = load_robot("panda")
    ready = robot.configurations["ready"]
    X_WG = Descent(robot, robot.tool_frame).place(ready).copy()
    costs = []
    for orientation in (1e-8, np.pi):
        options = IkOptions(orientation=orientation, count=1, prefer=Preference("middle"))
        q = solve_ik(robot, robot.tool_frame, X_WG, [ready], options).solutions[0]
        assert pose_error(Descent(robot, robot.tool_frame).place(q), X_WG)[0] <= 1e-8
        costs.append(cost_at(Preference("middle"), robot, q)[0])
    assert costs[1] < costs[0] - 1e-3


def test_distinct_solutions_are_kept():
    robot = load_robot("panda")
    X_WG = Descent(robot, robot.tool_frame).place(robot.configurations["ready"]).copy()
    seeds = random_seeds(robot, np.zeros(7), np.random.default_rng(0), 40)
    options = IkOptions(prefer=Preference("middle"), count=100)
    found = solve_ik(robot, robot.tool_frame, X_WG, seeds, options).solutions
    raw = solve_ik(robot, robot.tool_frame, X_WG, seeds, IkOptions(count=100)).solutions
    assert 2 <= len(found) < len(raw)  # one a valley of the cost, not one a start
    assert all(np.abs(a - b).max() > options.distinct for k, a in enumerate(found) for b in found[:k])


def test_an_arm_without_a_null_space_stays():
    robot = load_robot("ur5")
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.5, 0.6])
    X_WG = Descent(robot, robot.tool_frame).place(q).copy()
    for aim in AIMS:
        options = IkOptions(count=1, prefer=preference(aim, robot))
        assert solve_ik(robot, robot.tool_frame, X_WG, [q], options).solutions[0] == pytest.approx(q, abs=1e-8)


def test_room_ends_at_the_first_limit():
    robot = load_robot("panda")
    q, direction = robot.configurations["ready"], np.array([0.0, 1.0, 0.0, -2.0, 0.0, 0.0, 0.5])
    room = Descent(robot, robot.tool_frame).distance_to_limits(q, direction)
    reached = q + room * direction
    slack = np.minimum(robot.limits.upper - reached, reached - robot.limits.lower)
    assert slack.min() == pytest.approx(0.0, abs=1e-12)
    assert Descent(robot, robot.tool_frame).distance_to_limits(q, np.zeros(7)) == np.inf


def test_a_descent_stops_at_its_target():
    robot = load_robot("ur3")
    descent, q = Descent(robot, robot.tool_frame), np.array([0.3, -1.0, 1.2, 0.4, 0.5, 0.6])
    descent.aim(descent.place(q).copy())
    assert descent.reached(descent.descend(q + 0.05, 60))
    assert not descent.reached(q + 0.05)
    data = robot.model.createData()
    frame = robot.model.getFrameId(robot.tool_frame)
    expected = pin.computeFrameJacobian(robot.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    np.testing.assert_array_equal(descent.jacobian(q), expected)
    np.testing.assert_array_equal(Descent(robot, robot.tool_frame, orientation=False).jacobian(q), expected[:3])


def test_preferences_are_checked():
    with pytest.raises(UnknownChoiceError, match="unknown preference 'center'"):
        Preference("center")
    with pytest.raises(ValueError, match="needs a reference"):
        Preference("reference")
    with pytest.raises(ValueError, match="no other"):
        Preference("middle", np.zeros(7))
