"""`Robot.fk`, `Robot.jacobian`, `Problem.is_free`, `Problem.clearance`; values by joint wherever a list is taken."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.collision.kept_models import collision_model
from optiplan.problem.free_space import TOUCHING, touching

STEP = 1e-6


@pytest.fixture(scope="module")
def panda():
    return op.load_robot("panda")


@pytest.fixture(scope="module")
def shelf():
    return op.load_problem("02_shelf")


def by_name(robot, q):
    return dict(reversed(list(zip(robot.joint_names, map(float, q), strict=True))))


def test_pose_of_a_planar_arm_is_that_of_the_formula():
    """x = a1 cos q1 + a2 cos(q1 + q2), z = 0.5 m - a1 sin q1 - a2 sin(q1 + q2): joints that turn about y."""
    (q1, q2), (a1, a2) = (0.3, -1.1), (0.5, 0.6)
    pose = op.load_robot("planar2r").fk([q1, q2])
    expected = [a1 * np.cos(q1) + a2 * np.cos(q1 + q2), 0.18, 0.5 - a1 * np.sin(q1) - a2 * np.sin(q1 + q2)]
    assert isinstance(pose, op.Pose)
    assert np.allclose(pose.position, expected, atol=1e-12)
    assert np.allclose(pose.matrix[:3, 0], [np.cos(q1 + q2), 0.0, -np.sin(q1 + q2)])


def test_pose_is_a_goal(panda):
    q = panda.configurations["ready"]
    goal = panda.fk(q + 0.1)
    assert op.Problem(panda, start="ready", goal=goal).goal[0].frame == panda.tool_frame


@pytest.mark.parametrize("name", ["panda", "ur5", "delbot", "planar2r"])
@pytest.mark.parametrize("at", [0, -1])
def test_jacobian_agrees_with_differences(name, at):
    robot = op.load_robot(name)
    rng = np.random.default_rng(3)
    q = rng.uniform(np.maximum(robot.limits.lower, -2.0), np.minimum(robot.limits.upper, 2.0))
    frame = [robot.tool_frame, robot.joint_names[-1]][at]
    J = robot.jacobian(q, frame)
    assert J.shape == (6, robot.n)
    for j in range(robot.n):
        ahead, back = (robot.fk(q + sign * STEP * np.eye(robot.n)[j], frame).matrix for sign in (1.0, -1.0))
        velocity = (ahead[:3, 3] - back[:3, 3]) / (2.0 * STEP)
        turning = pin.log3(ahead[:3, :3] @ back[:3, :3].T) / (2.0 * STEP)
        assert np.abs(J[:, j] - np.concatenate([velocity, turning])).max() < 1e-7


def test_values_by_joint_are_the_list(panda, shelf):
    q = panda.configurations["ready"] + 0.05
    named = by_name(panda, q)
    assert (panda.fk(named).matrix == panda.fk(q).matrix).all()
    assert (panda.jacobian(named) == panda.jacobian(list(q))).all()
    assert shelf.clearance(by_name(panda, shelf.start)) == shelf.clearance(shelf.start)
    assert bool(shelf.is_free(by_name(panda, shelf.start)))


def test_problem_takes_values_by_joint(panda):
    start, via, goal = (panda.configurations["ready"] + shift for shift in (0.0, 0.05, 0.1))
    listed = op.Problem(panda, start=start, goal=[goal, via], vias=[via], start_velocity=np.full(7, 0.01))
    named = op.Problem(
        "panda",
        start=by_name(panda, start),
        goal=[by_name(panda, goal), by_name(panda, via)],
        vias=[op.ViaPoint(by_name(panda, via))],
        start_velocity=by_name(panda, np.full(7, 0.01)),
    )
    assert named.hash == listed.hash
    assert listed.with_goal(by_name(panda, via)).hash == listed.with_goal(via).hash
    with pytest.raises(op.InputError, match=r"^op.Problem: start.joints.panda_joint_1: unknown joint .*did you mean"):
        op.Problem(panda, start=by_name(panda, start) | {"panda_joint_1": 0.0}, goal=goal)


def test_retime_takes_values_by_joint():
    problem = op.load_problem("12_planar")
    robot, ends = problem.robot, (problem.start, problem.start + 0.1)
    run = op.retime(problem, [by_name(robot, q) for q in ends])
    assert run.duration == op.retime(problem, ends).duration


def test_free_says_the_pair_that_meets(shelf):
    bad = np.zeros(7)
    found = shelf.is_free([shelf.start, bad])
    assert [bool(one) for one in found] == [True, False]
    assert found[0].pair is None
    assert "panda_hand" in found[1].pair
    assert found[1].reason.startswith("'panda_link5' and 'panda_hand' overlap by ")
    assert repr(found[0]) == "FreeCheck: free"
    folded = np.array([0.8, -0.8, -2.7, -3.0, 1.8, 3.4, 0.6])
    contacts = collision_model(shelf.robot, shelf.scene).touching(folded, TOUCHING)
    pairs = {(contact.pair.name_a, contact.pair.name_b) for contact in contacts}
    assert len(pairs) < len(contacts)  # a link of several shapes
    assert shelf.is_free(folded).reason.endswith(f"; and {len(pairs) - 3} more pairs")


def test_the_pair_that_meets_is_that_of_the_check_whatever_its_array_holds_later(shelf):
    q = np.zeros((1, 7))
    found = shelf.is_free(q)
    q[0] = shelf.start
    assert not found[0]
    assert "panda_hand" in found[0].pair


@pytest.mark.parametrize("name", ["02_shelf", "06_attached", "09_ur5", "13_mesh", "14_half_space"])
def test_free_of_many_is_free_of_each(name):
    problem = op.load_problem(name)
    limits = problem.robot.limits
    lower, upper = np.maximum(limits.lower, -3.0), np.minimum(limits.upper, 3.0)
    Q = np.random.default_rng(1).uniform(lower, upper, (203, problem.robot.n))
    found, model = problem.is_free(Q), collision_model(problem.robot, problem.scene)
    assert found.free.tolist() == [touching(model, q) is None for q in Q]
    assert found.free.tolist() == [bool(one) for one in found] == [bool(problem.is_free(q)) for q in Q]
    assert 0 < found.free.sum() < len(Q) == len(found)
    met = [touching(model, q) for q in Q[:20]]
    assert [(one.pair, one.reason) for one in found[:20]] == [(None, "") if one is None else one for one in met]
    assert repr(found) == f"FreeChecks: {found.free.sum()} of 203 free"


def test_clearance_is_negative_where_bodies_overlap_and_the_distance_where_not():
    ball = op.Sphere("ball", radius=0.1, position=(0.0, 3.0, 0.0))
    problem = op.Problem("planar2r", start=[0.0, 0.5], goal=[0.1, 0.6], scene=[ball])
    Q = np.array([[0.0, 0.5], [np.pi / 2, 0.0]])
    found = problem.clearance(Q)
    assert found.shape == (2,)
    assert found[0] == problem.clearance(Q[0])
    tool = problem.robot.fk(Q[1]).position
    near = problem.with_scene([op.Sphere("ball", radius=0.1, position=tool)])
    assert near.clearance(Q[1]) < 0.0 < near.clearance(Q[0])
    assert near.is_free(Q[1]).pair[1] == "ball"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda robot, problem: robot.fk([1.0, 2.0]), "op.Robot.fk: q: found the list"),
        (lambda robot, problem: robot.fk("redy"), "op.Robot.fk: q: found 'redy'; expected one of: ready, extended"),
        (lambda robot, problem: robot.fk("ready", "hand"), "op.Robot.fk: frame: found 'hand'; expected one of: panda_"),
        (
            lambda robot, problem: robot.jacobian(np.full(7, np.nan)),
            "op.Robot.jacobian: q: found an array of shape (7,)",
        ),
        (lambda robot, problem: robot.jacobian({"elbow": 1.0}), "op.Robot.jacobian: q: found unknown joint 'elbow'"),
        (lambda robot, problem: robot.fk(np.zeros((2, 7))), "op.Robot.fk: q: found an array of shape (2, 7)"),
        (lambda robot, problem: problem.is_free(3), "op.Problem.is_free: q: found the int 3"),
        (lambda robot, problem: problem.clearance({"panda_joint1": 0.0}), "op.Problem.clearance: q: found no value of"),
    ],
)
def test_errors_name_the_call_and_the_choices(panda, shelf, call, words):
    with pytest.raises(op.InputError) as caught:
        call(panda, shelf)
    assert str(caught.value).startswith(words)


@pytest.mark.parametrize("q", [np.float32(0.02), np.int64(0)])
def test_locked_joints_may_be_numbers_of_numpy(q):
    robot = op.load_robot("panda", locked={"panda_finger_joint1": q})
    assert robot.locked["panda_finger_joint1"] == float(q)
    assert type(robot.reference.locked["panda_finger_joint1"]) is float
