"""Path constraints: stated in files and in Python, proved for all times, refused with time and place."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.problem.constraints.measures import measures
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameMotion
from optiplan.verify.continuous.motion_bounds import Boxes
from optiplan.verify.joint_constraint_check import tool_acceleration
from tests.checks import named
from tests.unchecked_problem import unchecked_problem

TOOL = "panda_hand_tcp"
GOAL = op.Pose((0.45, 0.3, 0.45), rpy=(3.14159, 0, 0))


@pytest.fixture(scope="module")
def problem():
    return op.Problem("panda", start="ready", goal=GOAL)


@pytest.fixture(scope="module")
def line(problem):
    """The tool on a straight line, upright."""
    run = op.plan(problem, "line", budget=10.0)
    assert run.verified
    return run


def place(robot, frame, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.frame_id(frame)]


@pytest.fixture(scope="module")
def constraints(problem, line):
    """One of each kind, as its class and as a file says it, with a value just held and one just broken."""
    a, b = (place(problem.robot, TOOL, q) for q in (line.trajectory.start, line.trajectory.end))
    along = b.translation - a.translation
    middle = np.linspace(0.0, line.duration, 2001)
    twists = FrameMotion(problem.robot, TOOL).twists(line.trajectory(middle), line.trajectory(middle, 1))
    speed = np.linalg.norm(twists[0], axis=1).max()
    side = np.cross(along, [0, 0, 1.0])
    normal = (side / np.linalg.norm(side)).tolist()
    offset = float(np.dot(normal, a.translation))
    span = np.abs(along)
    centre = (0.5 * (a.translation + b.translation)).tolist()
    clearance = min(_clearance(problem, q) for q in line.trajectory(middle[::50]))
    hand, link = place(problem.robot, "panda_hand", line.trajectory.start), "panda_link7"
    relative = place(problem.robot, link, line.trajectory.start).inverse() * hand
    pose = {
        "position": relative.translation.tolist(),
        "quaternion": pin.Quaternion(relative.rotation).coeffs().tolist(),
    }
    return {
        "orientation": (
            {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.01},
            {"axis": [0, 0, 1], "toward": [0.1, 0, -0.99498743710662], "within": 0.09},
        ),
        "position": tuple(
            {"box": {"size": (span + 2 * more).tolist(), "pose": {"position": centre}}} for more in (1e-3, -1e-3)
        ),
        "plane": tuple({"normal": normal, "offset": offset + by, "within": 1e-3} for by in (0.0, 1.5e-3)),
        "line": tuple(
            {"from": a.translation.tolist(), "to": (b.translation + by * np.array([0, 0, 1])).tolist(), "within": 1e-3}
            for by in (0.0, 0.01)
        ),
        "tool_speed": ({"linear": 1.01 * speed}, {"linear": 0.95 * speed}),
        "clearance": tuple({"pairs": [["panda_hand", "panda_link0"]], "at_least": by * clearance} for by in (0.9, 1.1)),
        "relative_pose": (
            {"frame": "panda_hand", "to": link, **pose},
            {"frame": "panda_hand", "to": "panda_link6", **pose, "tolerance": {"position": 0.01, "orientation": 0.01}},
        ),
    }


def _clearance(problem, q):
    from optiplan.collision.model import CollisionModel

    model = CollisionModel(problem.robot.with_proved_checked(), problem.scene)
    pair = {"panda_hand", "panda_link0"}
    return min(c.distance for c in model.contacts(q, 2.0) if {c.pair.name_a, c.pair.name_b} == pair)


KINDS = ["orientation", "position", "plane", "line", "tool_speed", "clearance", "relative_pose"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_constraint_that_holds_is_proved_and_a_broken_one_refused(problem, line, constraints, kind):
    held, broken = constraints[kind]
    wide = problem.with_constraints({kind: held})
    report = op.verify(wide, line.trajectory)
    own = [check for check in report.checks if check.name == f"{kind.replace('_', ' ')} constraint"]
    assert own
    assert all(check.passed and check.kind == "continuous" for check in own), own
    assert report.verified
    part = {**broken, "during": [0.3, 0.9]}  # not at the ends, where a problem would refuse it
    report = op.verify(problem.with_constraints({kind: part}), line.trajectory)
    (refused,) = [check for check in report.failures][:1]
    assert refused.name == f"{kind.replace('_', ' ')} constraint"
    assert refused.worst is not None
    assert 0.3 * line.duration - 1e-9 <= refused.time <= 0.9 * line.duration + 1e-9
    assert refused.place


@pytest.mark.parametrize("kind", KINDS)
def test_files_and_python_say_the_same(problem, constraints, kind, tmp_path):
    held, _ = constraints[kind]
    of_file = problem.with_constraints({kind: held})
    (one,) = of_file.path_constraints
    (same,) = problem.with_constraints(one).path_constraints
    X = np.tile(np.eye(4), (3, 1, 1))
    X[:, :3, 3] = [[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [0.0, 0.0, 1.0]]
    for measure, other in zip(measures(one), measures(same), strict=True):
        assert measure.value(X) == pytest.approx(other.value(X), abs=1e-12)
        assert measure.limit == other.limit
    of_file.save(tmp_path / "p.yaml")
    again = op.load_problem(tmp_path / "p.yaml")
    assert again.hash == of_file.hash
    assert type(again.path_constraints[0]) is type(one)
    assert of_file.hash != problem.hash


CHAINS = [(TOOL, None), ("panda_link5", None), (TOOL, "panda_link3"), ("panda_link2", TOOL)]


@pytest.mark.parametrize(("frame", "base"), CHAINS)
def test_bounds_of_a_frame_hold_against_dense_samples(problem, line, frame, base):
    motion, trajectory = FrameMotion(problem.robot, frame, base), line.trajectory
    rng = np.random.default_rng(0)
    for middle, half in zip(rng.uniform(0.1, 0.5, 12), rng.choice([0.002, 0.01, 0.05], 12), strict=True):
        t = np.linspace(middle - half, middle + half, 401)
        speed, acceleration = (np.abs(trajectory(t, k)).max(axis=0)[None] for k in (1, 2))
        none = np.zeros_like(speed)
        q, v = trajectory(np.array([middle])), trajectory(np.array([middle]), 1)
        bounds = motion.bounds(Boxes(np.array([half]), q, v, speed * half, speed, acceleration, none))
        X, centre = motion.poses(trajectory(t)), motion.poses(q)[0]
        step = t[1] - t[0]
        assert np.linalg.norm(X[:, :3, 3] - centre[:3, 3], axis=1).max() <= bounds.travel[0] + 1e-12
        curvature = np.linalg.norm(np.diff(X[:, :3, 3], 2, axis=0), axis=1).max() / step**2
        assert curvature <= bounds.curvature[0] * (1.0 + 1e-6) + 1e-4
        turned = [np.linalg.norm(pin.log3(centre[:3, :3].T @ R)) for R in X[::40, :3, :3]]
        assert max(turned) <= bounds.turn[0] + 1e-9
        bend = np.linalg.norm(np.diff(X[:, :3, :3], 2, axis=0), axis=1).max() / step**2
        assert bend <= bounds.turn_curvature[0] * (1.0 + 1e-6) + 1e-3


def test_a_violation_between_samples_is_found(problem, line):
    """A bump of 1 ms that no sampling at 200 Hz sees."""
    motion = line.trajectory
    half = 0.0005
    at = 0.5 * line.duration + 0.00123
    breakpoints = np.union1d(motion.breakpoints, [at - half, at, at + half])
    lift = 2e-4
    taylor = []
    for begin in breakpoints[:-1]:
        c = np.stack([motion(np.array([begin + 1e-15]), k)[0] / f for k, f in enumerate((1.0, 1.0, 2.0, 6.0))])
        x = (begin - (at - half)) / half
        if -1e-9 <= x < 2.0 - 1e-9:
            rising = x < 1.0 - 1e-9
            c[0, 1] += 0.0 if rising else lift
            c[1, 1] += lift / half if rising else -lift / half
        taylor.append(c)
    bumped = Trajectory(motion.joint_names, breakpoints, np.array(taylor))
    a, b = (place(problem.robot, TOOL, q).translation for q in (motion.start, motion.end))
    near = problem.with_constraints(op.OnLine(TOOL, a, b, within=2e-5))
    assert not [c for c in op.verify(near, motion).failures if c.name == "line constraint"]
    (refused,) = [c for c in op.verify(near, bumped).failures if c.name == "line constraint"]
    assert refused.time == pytest.approx(at, abs=2 * half)


def test_a_pose_is_measured_as_an_angle_and_a_distance():
    cone = op.OrientationCone("tip", np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), within=0.2)
    (tilt,) = measures(cone)
    X = np.stack([pin.SE3(pin.rpy.rpyToMatrix(angle, 0, 0), np.zeros(3)).homogeneous for angle in (0.0, 0.1, 0.2, 3.0)])
    assert [tilt.shown(float(value)) for value in tilt.value(X)] == pytest.approx([0.0, 0.1, 0.2, 3.0])
    assert tilt.shown(tilt.limit) == pytest.approx(0.2)


def test_planners_that_do_not_hold_constraints_say_so(problem):
    level = problem.with_constraints(op.OrientationCone(TOOL, np.array([0, 0, 1.0]), np.array([0, 0, -1.0]), 0.1))
    run = op.plan(level, "bitstar", budget=2.0)
    assert run.failure.kind == "unsupported"
    assert "orientation" in run.failure.detail
    assert op.plan(level, "line", budget=5.0).verified
    assert op.plan(level, "rrtconnect", budget=5.0).verified


def test_a_line_keeps_the_tool_speed_of_the_problem(problem, line):
    slow = problem.with_constraints(op.ToolSpeed(TOOL, linear=0.3))
    run = op.plan(slow, "line", budget=10.0)
    assert run.verified
    assert run.duration > line.duration
    check = named(run.report, "tool speed constraint")
    assert check.worst == pytest.approx(0.3, rel=2e-3)


@pytest.mark.parametrize(
    ("constraint", "where", "words"),
    [
        ({"orientation": {"axis": [0, 0, 1], "toward": [0, 0, 1], "within": 0.1}}, "start", "tilted by 3.14"),
        (
            {"plane": {"frame": "nose", "normal": [0, 0, 1], "offset": 0, "within": 0.1}},
            "frame",
            "frame 'nose'",
        ),
        ({"clearance": {"pairs": [["panda_hand", "wall"]], "at_least": 0.1}}, "pairs[0]", "unknown body 'wall'"),
        ({"tool_speed": {}}, "tool_speed", "linear, angular, or both"),
        ({"line": {"from": [0, 0, 0], "to": [1, 0, 0], "within": 9.0, "during": [0.5, 0.2]}}, "during", "from < to"),
    ],
)
def test_bad_constraints_are_named(problem, constraint, where, words):
    with pytest.raises(op.InputError) as caught:
        problem.with_constraints(constraint)
    assert where in str(caught.value)
    assert words in str(caught.value)


@pytest.mark.parametrize("within", [0.5, 3.0, 3.1415, 3.14159, np.pi - 1e-7])
@pytest.mark.parametrize("kind", ["axis", "rotation", "relative", "screw"])
def test_a_tolerance_near_half_a_turn_is_as_sharp_as_others(kind, within):
    """The chord of an angle hardly grows there: what rounding allows it must not be some 1e-5 rad."""
    still, up, X = np.eye(3), np.array([0.0, 0.0, 1.0]), pin.SE3.Identity()
    one = {
        "axis": op.OrientationCone("tool0", up, up, within),
        "rotation": op.FixedOrientation("tool0", still, within),
        "relative": op.RelativePose("tool0", "base", X, 1.0, within),
        "screw": op.OnScrew("tool0", up, np.zeros(3), 0.0, X, 1.0, within),
    }[kind]
    measure = measures(one)[-1]

    def value(angle):
        turned = pin.SE3(pin.exp3(np.array([angle, 0.0, 0.0])), np.zeros(3))
        return measure.value(turned.homogeneous[None])[0]

    assert value(within - 2e-9) <= measure.allowed
    assert value(min(within + 5e-8, np.pi)) > measure.allowed or within + 5e-8 > np.pi


def test_half_a_turn_allows_every_orientation():
    one = op.FixedOrientation("tool0", np.eye(3), np.pi)
    turned = pin.SE3(pin.exp3(np.pi * np.array([0.6, 0.0, 0.8])), np.zeros(3)).homogeneous
    assert measures(one)[0].value(turned[None])[0] <= measures(one)[0].allowed


def test_a_peak_of_acceleration_before_a_knot_is_found(planar):
    """In a piece shorter than the step between samples q'' grows to 32 rad/s² just before the next piece begins."""
    edges, c, q, v = np.array([0.0, 0.25, 0.2503, 0.5]), np.zeros((3, 4, 2)), 0.0, 0.0
    for k, (h, slope) in enumerate(zip(np.diff(edges), (0.0, 1e5, 0.0), strict=True)):
        c[k, :, 0] = q, v, 1.0, slope / 6.0
        q, v = q + v * h + h**2 + slope * h**3 / 6.0, v + 2.0 * h + slope * h**2 / 2.0
    motion = Trajectory(planar.joint_names, edges, c)
    problem = unchecked_problem(planar, motion.start, (op.JointGoal(motion.end),))
    arm = float(np.hypot(*place(planar, planar.tool_frame, motion.start).translation[:2]))
    for during in ((0.0, 1.0), (0.2, 0.9)):
        (check,) = tool_acceleration(problem, motion, op.ToolAcceleration(planar.tool_frame, 3.0 * arm, during=during))
        assert not check.passed
        assert check.worst > 31.0 * arm
        assert check.time == pytest.approx(0.2503, abs=1e-9)
