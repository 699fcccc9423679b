"""`time_path`: the path is not changed, every limit holds, and it is nearly as fast as can be."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from optiplan.errors import UnknownChoiceError
from optiplan.problem.problem import JointGoal, derived
from optiplan.robot.robot import load_robot
from optiplan.trajectory.paths.corners import bezier_corners, blend_path
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.timing.path_constraints import rows_at, tool_motion
from optiplan.trajectory.timing.reachability import fastest_law, slowness
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.time_path import TimingOptions, ToolLimits, _grid, compose, time_path, time_path_by_law
from optiplan.trajectory.timing.time_scaling import speed_ratio
from optiplan.trajectory.timing.torque_scaling import torque_scale
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify
from tests.planners import cases
from tests.trajectory.sample_paths import CORNERS, NAMES, PATHS, limits_of, straight

WEIGHTLESS = None  # the robot is asked only for torques and tools, and only where they are limited
METHODS = ("toppra", "jerk", "uniform")


def farthest(motion, path, count=400):
    """Largest distance of points of the motion from the path, by a search for the nearest parameter."""
    points = motion(np.linspace(0.0, motion.duration, count))
    s = np.linspace(0.0, path.duration, 20_001)
    nearest = s[cKDTree(path(s)).query(points)[1]]
    for _ in range(8):  # Gauss-Newton
        q, d = path(np.clip(nearest, 0.0, path.duration)), path(np.clip(nearest, 0.0, path.duration), 1)
        nearest = np.clip(nearest + ((points - q) * d).sum(axis=1) / (d * d).sum(axis=1), 0.0, path.duration)
    return np.abs(path(nearest) - points).max()


@pytest.fixture(scope="module")
def panda():
    return load_robot("panda")


@pytest.fixture(scope="module")
def reach(panda):
    """A path of the Panda with two rounded corners."""
    ready = panda.configurations["ready"]
    corners = ready + np.array([[0, 0, 0, 0, 0, 0, 0], [0.7, 0.3, 0, 0.2, 0, 0.3, 0], [0.2, 0.6, 0.5, 0.5, 0, 0, 0.5]])
    return blend_path(corners, np.ones(1), panda.limits, panda.joint_names)


@pytest.fixture(scope="module")
def weak(panda, reach):
    """Limits half-way between what holding the arm and what moving it fast takes."""
    fast = time_path(reach, panda, replace(panda.limits, torque=np.full(panda.n, np.inf)), TimingOptions("jerk"))
    t, data = np.linspace(0.0, fast.duration, 300), panda.model.createData()
    Q, V, A = (fast(t, k) for k in range(3))
    moving = [pin.rnea(panda.model, data, *row).copy() for row in zip(Q, V, A, strict=True)]
    holding = [pin.computeGeneralizedGravity(panda.model, data, q).copy() for q in Q]
    return replace(panda.limits, torque=0.5 * (np.abs(moving).max(axis=0) + np.abs(holding).max(axis=0)))


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("method", METHODS)
def test_every_method_keeps_the_path_and_its_limits(name, method):
    path, limits = PATHS[name], limits_of(200.0)
    motion = time_path(path, WEIGHTLESS, limits, TimingOptions(method))
    assert farthest(motion, path) < 1e-9
    kept = limits if method != "toppra" else limits_of(np.inf)
    assert speed_ratio(motion, kept) == pytest.approx(1.0, abs=1e-9)
    ends = np.array([0.0, motion.duration])
    assert np.abs(motion(ends) - path(np.array([0.0, path.duration]))).max() < 1e-12
    assert np.abs(motion(ends, 1)).max() < 1e-9
    if method != "toppra":
        assert np.abs(motion(ends, 2)).max() < 1e-6
        assert np.abs(motion.jumps(2)).max() < 1e-6


@pytest.mark.parametrize("jerk", [30.0, 100.0, 500.0, 5000.0])
def test_on_a_straight_line_it_comes_near_the_optimum(jerk):
    limits = limits_of(jerk)
    best = lower_bound(CORNERS[0], CORNERS[1], limits)
    assert best <= time_path(straight(), WEIGHTLESS, limits).duration < 1.01 * best
    unlimited = lower_bound(CORNERS[0], CORNERS[1], limits_of(np.inf))
    assert time_path(straight(), WEIGHTLESS, limits, TimingOptions("toppra")).duration < 1.001 * unlimited
    assert time_path(straight(), WEIGHTLESS, limits, TimingOptions("uniform")).duration == pytest.approx(best)


@pytest.mark.parametrize("jerk", [100.0, 500.0, 5000.0])
def test_a_better_law_is_a_faster_one(jerk):
    limits = limits_of(jerk)
    fast, smooth, uniform = (
        time_path(PATHS["rounded"], WEIGHTLESS, limits, TimingOptions(method)).duration for method in METHODS
    )
    assert fast < smooth < 0.95 * uniform
    assert smooth < stop_at_corners(CORNERS, limits, NAMES).duration
    assert time_path(PATHS["rounded"], WEIGHTLESS, limits).duration == smooth
    if jerk == 5000.0:
        assert smooth < 1.02 * fast


def winding(seed):
    """A long spline through random points within the Panda's reach."""
    robot = cases.robot("panda")
    middle, half = 0.5 * (robot.limits.upper + robot.limits.lower), 0.15 * (robot.limits.upper - robot.limits.lower)
    points = middle + half * np.random.default_rng(seed).uniform(-1.0, 1.0, (9, robot.n))
    knots = np.concatenate([np.zeros(5), np.linspace(0.0, 1.0, 5), np.ones(5)])
    return Trajectory.from_bspline(robot.joint_names, knots, points, 5)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_is_faster_than_toppra(panda, seed):
    path, limits = winding(seed), replace(panda.limits, torque=np.full(panda.n, np.inf))
    fast, smooth = (time_path(path, panda, limits, TimingOptions(method)).duration for method in ("toppra", "jerk"))
    assert fast < smooth


def test_past_small_corners_toppra_is_as_fast_as_on_a_grid_without_end(panda):
    limits = replace(panda.limits, torque=np.full(panda.n, np.inf))
    middle, half = 0.5 * (limits.upper + limits.lower), 0.2 * (limits.upper - limits.lower)
    points = middle + half * np.random.default_rng(0).uniform(-1.0, 1.0, (12, panda.n))
    path = bezier_corners(points, np.full(10, 0.01), limits, panda.joint_names)
    grid = np.concatenate([np.linspace(a, b, 2000)[:-1] for a, b in pairwise(path.breakpoints)])
    best = fastest_law(rows_at(path, panda, limits, None, np.append(grid, path.duration))).duration
    assert best <= time_path(path, panda, limits, TimingOptions("toppra")).duration < 1.005 * best


def test_slowness_is_that_of_the_motion_between_the_points_of_the_grid(panda):
    path, limits = winding(3).scaled(2.0), panda.limits
    grid = np.linspace(0.0, path.duration, 30)
    law = fastest_law(rows_at(path, panda, limits, None, grid))
    middles = 0.5 * (grid[1:] + grid[:-1])
    slow = slowness(law, rows_at(path, panda, limits, None, middles))
    motion, data = compose(path, law), panda.model.createData()
    assert slow.max() > 1.01
    for s, expected in zip(middles, slow, strict=True):
        t = np.array([brentq(lambda x, s=s: law(np.array([x]))[0, 0] - s, 0.0, law.duration, xtol=1e-14)])
        q, v, a = (motion(t, order)[0] for order in range(3))
        hold = pin.computeGeneralizedGravity(panda.model, data, q).copy()
        moving = pin.rnea(panda.model, data, q, v, a) - hold
        torque = np.abs(moving) / (limits.torque - np.sign(moving) * hold)
        shares = np.concatenate([(v / limits.velocity) ** 2, np.abs(a) / limits.acceleration, torque])
        assert expected == pytest.approx(np.sqrt(shares.max()), rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_the_tool_keeps_its_acceleration_in_sharp_corners_of_a_slow_motion(panda, method):
    ready = panda.configurations["ready"]
    corners = ready + 0.3 * np.random.default_rng(4).uniform(-1.0, 1.0, (4, panda.n))
    path = blend_path(corners, np.array([0.02, 0.05]), panda.limits, panda.joint_names)
    tool = ToolLimits(panda.tool_frame, 0.1, 0.5, 0.01)
    motion = time_path(path, panda, panda.limits, TimingOptions(method, tool))
    assert motion.duration > 20.0
    pairs = zip(motion.breakpoints, np.diff(motion.breakpoints), strict=False)
    t = np.concatenate([a + h * np.linspace(1e-6, 1.0 - 1e-6, 21) for a, h in pairs])
    acceleration = tool_motion(panda, tool.frame, [motion(t, order) for order in range(3)])[1]
    assert np.linalg.norm(acceleration[:, :3], axis=1).max() < 1.001 * tool.linear_acceleration


def test_without_a_jerk_limit_the_default_is_toppra():
    limits = limits_of(np.inf)
    options = TimingOptions("toppra")
    default, asked = (time_path(PATHS["wave"], WEIGHTLESS, limits, o) for o in (None, options))
    assert default.duration == asked.duration


def test_stopped_it_answers_with_the_best_so_far(panda, reach):
    """Before the search the uniform motion; after some steps of it one in between; all keep the path and its limits."""
    durations = []
    for steps in (0, 3, 100):
        left = iter([False] * steps)
        motion = time_path(reach, panda, panda.limits, TimingOptions("jerk", stop=lambda left=left: next(left, True)))
        assert speed_ratio(motion, panda.limits) <= 1.0 + 1e-9
        assert farthest(motion, reach) < 1e-9
        durations.append(motion.duration)
    assert durations[0] == time_path(reach, panda, panda.limits, TimingOptions("uniform")).duration
    assert durations[0] > durations[1] > durations[2]


@pytest.mark.parametrize("share", [1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("name", PATHS)
def test_a_motion_of_hours_without_jerk_limits_has_digits_for_its_ramps(name, share):
    """Up to 1e6 s, and milliseconds of acceleration at its end, where seconds have few digits."""
    limits = limits_of(np.inf)
    limits = replace(limits, velocity=share * limits.velocity, acceleration=10.0 * limits.acceleration)
    motion = time_path(PATHS[name], WEIGHTLESS, limits)
    assert speed_ratio(motion, limits) <= 1.0 + 1e-9
    assert np.abs(motion(motion.duration, 1) / limits.velocity).max() < 1e-6


def test_going_nowhere_is_a_rest():
    path = Trajectory(NAMES, np.array([0.0, 1.0]), np.ones((1, 1, 3)))
    motion = time_path(path, WEIGHTLESS, limits_of(500.0))
    assert np.abs(motion(np.array([0.0, motion.duration])) - 1.0).max() == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_the_verifier_accepts_every_method(panda, reach, weak, method):
    """Free space, joint, torque and (but for TOPP-RA) jerk limits; the torque limit bites."""
    limits = weak
    if method == "toppra":
        limits = replace(limits, jerk=np.full(panda.n, np.inf))
    motion = time_path(reach, panda, limits, TimingOptions(method))
    assert farthest(motion, reach, 100) < 1e-9
    problem = derived(cases.problem("panda", reach.start, [JointGoal(reach.end)]), limits=limits)
    report = verify(problem, motion)
    assert report.verified, [check for check in report.checks if not check.passed]
    strong = time_path(reach, panda, replace(limits, torque=np.full(panda.n, np.inf)), TimingOptions(method))
    assert motion.duration > (1.005 if method != "uniform" else 0.999) * strong.duration


def test_torque_is_used_up_and_not_exceeded(panda, reach, weak):
    for method in ("toppra", "jerk"):
        motion = time_path(reach, panda, weak, TimingOptions(method))
        t = np.linspace(0.0, motion.duration, 1500)
        data = panda.model.createData()
        tau = [pin.rnea(panda.model, data, *row).copy() for row in zip(*(motion(t, k) for k in range(3)), strict=True)]
        assert 0.95 < (np.abs(tau) / weak.torque).max() <= 1.0
        assert torque_scale(panda, weak.torque, motion) == pytest.approx(1.0)


@pytest.mark.parametrize("method", METHODS)
def test_too_weak_to_stand_is_no_motion(panda, reach, method):
    weaker = replace(panda.limits, torque=np.full(panda.n, 1.0))
    assert time_path(reach, panda, weaker, TimingOptions(method)) is None


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("limit", [{"linear": 0.3}, {"angular": 0.5}, {"linear_acceleration": 1.5}])
def test_tool_limits_hold_and_are_met(panda, reach, method, limit):
    tool = ToolLimits(panda.tool_frame, **limit)
    motion = time_path(reach, panda, panda.limits, TimingOptions(method, tool))
    free = time_path(reach, panda, panda.limits, TimingOptions(method))
    assert motion.duration > 1.1 * free.duration
    t = np.linspace(0.0, motion.duration, 5000)
    twist, acceleration = tool_motion(panda, tool.frame, [motion(t, order) for order in range(3)])
    found = {
        "linear": np.linalg.norm(twist[:, :3], axis=1).max(),
        "angular": np.linalg.norm(twist[:, 3:], axis=1).max(),
        "linear_acceleration": np.linalg.norm(acceleration[:, :3], axis=1).max(),
    }
    ((name, value),) = limit.items()
    assert 0.98 * value < found[name] <= value


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("part", [(0.191, 0.785), (0.0, 0.301), (0.3333, 0.3341)])
def test_the_tool_is_as_slow_in_a_part_of_the_path_from_its_first_to_its_last_instant(panda, reach, method, part):
    tool = ToolLimits(panda.tool_frame, linear=0.05, angular=0.3)
    options = TimingOptions(method, tool_parts=((*part, tool),))
    motion, law = time_path_by_law(reach, panda, panda.limits, options)
    t = np.linspace(0.0, motion.duration, 20_001)
    s = law(t)[:, 0]
    t = t[(s >= part[0]) & (s <= part[1])]
    twist, _ = tool_motion(panda, tool.frame, [motion(t, order) for order in range(3)])
    shares = np.linalg.norm(twist[:, :3], axis=1) / tool.linear, np.linalg.norm(twist[:, 3:], axis=1) / tool.angular
    assert 0.9 < np.max(shares) < 1.0 + 1e-4


def test_a_part_that_rounds_to_beside_a_breakpoint_begins_there(panda, reach):
    """No time passes between two such points; a task in which moves are joined ended with a ValueError."""
    begin = reach.breakpoints[1] / reach.duration * (1.0 + 4e-16)
    assert 0.0 < begin * reach.duration - reach.breakpoints[1] < 1e-15
    parts = ((begin, 1.0 - 1e-16, ToolLimits(panda.tool_frame, linear=0.2)),)
    grid = _grid(reach, (160, 4), TimingOptions(tool_parts=parts))
    assert np.diff(grid).min() > 1e-4
    assert np.isin(reach.breakpoints, grid).all()


def test_tool_motion_is_the_derivative_of_the_pose(panda):
    rng, h = np.random.default_rng(3), 1e-5
    q, v, a = panda.configurations["ready"], *rng.normal(size=(2, panda.n))
    data, frame = panda.model.createData(), panda.frame_id(panda.tool_frame)

    def pose(t):
        pin.framesForwardKinematics(panda.model, data, q + v * t + 0.5 * a * t**2)
        return data.oMf[frame].copy()

    back, here, ahead = (pose(t) for t in (-h, 0.0, h))
    twist, acceleration = tool_motion(panda, panda.tool_frame, [x[None] for x in (q, v, a)])
    assert twist[0, :3] == pytest.approx((ahead.translation - back.translation) / (2 * h), abs=1e-7)
    assert twist[0, 3:] == pytest.approx(pin.log3(ahead.rotation @ back.rotation.T) / (2 * h), abs=1e-7)
    second = (ahead.translation - 2.0 * here.translation + back.translation) / h**2
    assert acceleration[0, :3] == pytest.approx(second, abs=1e-4)


def test_rows_are_the_limits_of_the_motion(panda, reach):
    """A sdd + B sd^2 + G is joint acceleration, then torque, then a component of the tool's acceleration."""
    tool = ToolLimits(panda.tool_frame, linear=0.5, linear_acceleration=2.0)
    s = np.linspace(0.1, 0.9, 5) * reach.duration
    rows = rows_at(reach, panda, panda.limits, tool, s)
    sd, sdd = 0.7, -1.3
    q, q1, q2 = (reach(s, order) for order in range(3))
    v, a = q1 * sd, q1 * sdd + q2 * sd**2
    data, n = panda.model.createData(), panda.n
    tau = np.array([pin.rnea(panda.model, data, *row).copy() for row in zip(q, v, a, strict=True)])
    value = rows.A * sdd + rows.B * sd**2 + rows.G
    assert value[:, :n] == pytest.approx(a)
    assert value[:, n : 2 * n] == pytest.approx(tau)
    twist, acceleration = tool_motion(panda, tool.frame, [q, v, a])
    size = np.linalg.norm(acceleration[:, :3], axis=1)
    largest = np.abs(value[:, 2 * n :]).max(axis=1)
    assert (largest <= size + 1e-9).all()
    assert (largest >= size * np.cos(np.pi / 16.0) - 1e-9).all()
    share = np.maximum((np.abs(v) / panda.limits.velocity).max(axis=1), np.linalg.norm(twist[:, :3], axis=1) / 0.5)
    assert sd / rows.speed == pytest.approx(share)


def test_bad_tools_are_told(panda, reach):
    with pytest.raises(ValueError, match="linear = 0"):
        ToolLimits("tool", linear=0.0)
    with pytest.raises(UnknownChoiceError):
        time_path(reach, panda, panda.limits, TimingOptions(tool=ToolLimits("no such frame", linear=1.0)))
