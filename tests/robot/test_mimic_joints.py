"""Joints that follow others: everywhere the robot is the one whose joints stand at A q + b."""

import base64
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.geometry.scene import Obstacle, Scene, Sphere
from optiplan.kinematics.ik.joint_wraps import images
from optiplan.kinematics.ik.numeric import IkOptions, joints_that_move, solve_ik
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.kinematics.symbolic.functions import SymbolicRobot
from optiplan.planners.base import Budget
from optiplan.problem.problem import JointGoal, derived
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.mimic_joints import coupling, unfold
from optiplan.robot.robot import Robot, load_robot
from optiplan.robot.urdf.export import export_urdf
from optiplan.runs.pipeline import run
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.report import VerifyPolicy
from optiplan.viewer.scene import build_scene
from tests.robot.robots import BARE, BODILESS, joint, write_robot
from tests.unchecked_problem import unchecked_problem
from tests.verify.motions import quintic

LIMIT = '<limit lower="-2" upper="2" velocity="3" effort="40"/>'
BODY = (
    '<link name="{0}"><inertial><origin xyz="0.1 0.02 0.03"/><mass value="{1}"/><inertia ixx="0.02" iyy="0.03" '
    'izz="0.01" ixy="0.001" ixz="0" iyz="0"/></inertial><collision><origin xyz="0.1 0 0"/><geometry>'
    '<box size="0.2 0.04 0.05"/></geometry></collision></link>'
)


def follower(leader: str, multiplier: float, offset: float = 0.0, limit: str = LIMIT) -> str:
    return f'{limit}<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


PARTS = [
    BARE.format("a"),
    *(BODY.format(name, mass) for name, mass in zip("bcdef", (2, 1.5, 1, 0.7, 0.5), strict=True)),
    joint("early", "a", "b", inside=follower("lift", -0.8, 0.1), x=0.1),
    joint("lift", "a", "c", inside=LIMIT, x=0.4),
    joint("elbow", "c", "d", inside=LIMIT, x=0.3),
    joint("slide", "d", "e", "prismatic", follower("early", -0.25, 0.2), x=0.2),
    joint("late", "e", "f", inside=follower("elbow", 1.7), x=0.2),
]
"""Lift and elbow are planned; `early` stands before its leader in the model, `slide` follows a follower."""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    text = "group: [lift, elbow]\ntool_frame: f\n"
    return load_robot(str(write_robot(tmp_path_factory.mktemp("mimic"), PARTS, text)))


@pytest.fixture(scope="module")
def plain(robot: Robot) -> pin.Model:
    """The robot read without a mimic, by pinocchio alone."""
    return pin.buildModelFromXML(robot.urdf)


def all_joints(robot: Robot, plain: pin.Model, q: np.ndarray) -> np.ndarray:
    values = {"lift": q[0], "elbow": q[1], "early": -0.8 * q[0] + 0.1, "late": 1.7 * q[1]}
    values["slide"] = -0.25 * values["early"] + 0.2
    return np.array([values[name] for name in plain.names[1:]])


def samples(robot: Robot, count: int = 20) -> np.ndarray:
    return np.random.default_rng(4).uniform(robot.limits.lower, robot.limits.upper, (count, robot.n))


def test_the_planned_joints_are_the_degrees_of_freedom(robot):
    assert robot.joint_names == ("lift", "elbow")
    assert (robot.model.nq, robot.model.nv, robot.model.njoints - 1) == (2, 2, 5)
    assert {name: mimic.source for name, mimic in robot.followers.items()} == {
        "early": "lift",
        "slide": "lift",
        "late": "elbow",
    }
    assert robot.locked == {}


def test_every_link_stands_where_its_joints_put_it(robot, plain):
    data, truth = robot.model.createData(), plain.createData()
    Q = samples(robot)
    poses = BatchKinematics(robot.model).poses(Q)
    for q, batch in zip(Q, poses, strict=True):
        pin.framesForwardKinematics(robot.model, data, q)
        pin.framesForwardKinematics(plain, truth, all_joints(robot, plain, q))
        for name in "bcdef":
            expected = truth.oMf[plain.getFrameId(name)].homogeneous
            frame = robot.model.frames[robot.model.getFrameId(name)]
            np.testing.assert_allclose(data.oMf[robot.model.getFrameId(name)].homogeneous, expected, atol=1e-12)
            np.testing.assert_allclose(batch[frame.parentJoint] @ frame.placement.homogeneous, expected, atol=1e-12)


def test_jacobians_count_the_followers(robot):
    tool, step = ToolKinematics(robot), 1e-6
    for q in samples(robot, 5):
        X, J = tool.evaluate(q[None])
        np.testing.assert_allclose(J[0], geometric_jacobian(robot, q, "f"), atol=1e-12)
        H = tool.hessians(q[None])[0]
        for j in range(robot.n):
            ahead = q + step * np.eye(robot.n)[j]
            X_ahead, J_ahead = tool.evaluate(ahead[None])
            np.testing.assert_allclose((X_ahead - X)[0, :3, 3] / step, J[0, :3, j], atol=1e-5)
            np.testing.assert_allclose((J_ahead - J)[0] / step, H[:, :, j], atol=1e-5)


def test_inverse_kinematics_moves_what_its_followers_move(robot):
    assert joints_that_move(robot, "b").tolist() == [True, False]  # b hangs on `early`, which follows lift
    assert joints_that_move(robot, "f").tolist() == [True, True]
    goal = frame_pose(robot, np.array([0.4, -0.3]), "f")
    found = solve_ik(robot, "f", goal, [np.zeros(2)], IkOptions())
    X = frame_pose(robot, found.solutions[0], "f")
    np.testing.assert_allclose(X.homogeneous, goal.homogeneous, atol=1e-5)


def test_torque_is_the_generalised_force_of_the_leader(robot, plain):
    A, _ = coupling(robot.model)
    rng, unfolded = np.random.default_rng(1), unfold(robot.model)
    data, truth, other = robot.model.createData(), plain.createData(), unfolded.model.createData()
    order = [list(plain.names)[1:].index(name) for name in list(robot.model.names)[1:]]
    for q in samples(robot, 5):
        v, a = rng.uniform(-2, 2, (2, robot.n))
        v_all, a_all = np.empty(5), np.empty(5)
        v_all[order], a_all[order] = A @ v, A @ a
        expected = A.T @ pin.rnea(plain, truth, all_joints(robot, plain, q), v_all, a_all)[order]
        np.testing.assert_allclose(pin.rnea(robot.model, data, q, v, a), expected, atol=1e-10)
        same = pin.rnea(unfolded.model, other, unfolded.A @ q + unfolded.b, unfolded.A @ v, unfolded.A @ a)
        np.testing.assert_allclose(unfolded.A.T @ same, expected, atol=1e-10)


def test_the_base_keeps_its_mass(tmp_path):
    heavy = [BODY.format("a", 100), *PARTS[1:]]
    robot = load_robot(str(write_robot(tmp_path, heavy, BODILESS + "group: [lift, elbow]\n")))
    q = np.zeros((1, robot.n))
    assert base_reaction(robot, q, q, q)[0, 2] == pytest.approx(105.7 * 9.81)
    assert robot.holding({"lift": 0.1, "elbow": 0.2}).model.inertias[0].mass == pytest.approx(105.7)


def test_the_symbolic_twin_is_the_same_robot(robot):
    twin, data = SymbolicRobot(robot.model, machine_code=False), robot.model.createData()
    rng = np.random.default_rng(2)
    for q in samples(robot, 3):
        v, a = rng.uniform(-2, 2, (2, robot.n))
        pin.framesForwardKinematics(robot.model, data, q)
        expected = data.oMf[robot.model.getFrameId("f")].homogeneous
        np.testing.assert_allclose(np.array(twin.pose("f")(q)), expected, atol=1e-12)
        np.testing.assert_allclose(np.array(twin.jacobian("f")(q)), geometric_jacobian(robot, q, "f"), atol=1e-12)
        tau = pin.rnea(robot.model, data, q, v, a)
        np.testing.assert_allclose(np.array(twin.rnea()(q, v, a)).ravel(), tau, atol=1e-9)
        mass = np.triu(np.array(pin.crba(robot.model, data, q)))
        np.testing.assert_allclose(np.triu(np.array(twin.mass_matrix()(q))), mass, atol=1e-9)
        np.testing.assert_allclose(np.array(twin.tangent()(q)), np.eye(2))


@pytest.fixture(scope="module")
def model(robot: Robot) -> CollisionModel:
    ball = Obstacle("ball", Sphere(0.05), pin.SE3(np.eye(3), np.array([0.6, 1.0, 0.1])))
    return CollisionModel(robot, Scene(obstacles=(ball,)))


def distances(model: CollisionModel, q: np.ndarray) -> np.ndarray:
    model.place(q)
    return np.array([model.pair_gap(pair) for pair in range(len(model.pairs))])


def test_no_pair_comes_nearer_than_its_bounds_allow(model, robot):
    rng = np.random.default_rng(3)
    stroke = np.maximum(np.abs(robot.limits.lower), np.abs(robot.limits.upper))
    moment_arms = model.bounds.moment_arms(stroke)
    for q in samples(robot, 10):
        reach = rng.uniform(0.01, 0.4, robot.n)
        travel = model.travel(q[None], reach[None])[0]
        now = distances(model, q)
        assert (model.lower_bounds(q[None])[0] <= now + 1e-6).all()
        for _ in range(10):
            moved = np.clip(q + rng.uniform(-1, 1, robot.n) * reach, robot.limits.lower, robot.limits.upper)
            then = distances(model, moved)
            apart = (now > 0) & (then > 0)
            assert (np.abs(then - now)[apart] <= travel[apart] + 1e-6).all()
            assert (np.abs(then - now)[apart] <= (moment_arms @ np.abs(moved - q))[apart] + 1e-6).all()


def test_which_planned_joints_move_a_pair(model):
    depends = {frozenset((p.name_a, p.name_b)): model.bounds.depends[p.index].tolist() for p in model.pairs}
    assert depends[frozenset(("b", "ball"))] == [True, False]  # b hangs on `early`, which follows lift
    assert depends[frozenset(("d", "ball"))] == [True, True]
    if frozenset(("d", "f")) in depends:
        assert depends[frozenset(("d", "f"))] == [True, True]  # between them slide (lift) and late (elbow)


def test_gradients_of_distances(model, robot):
    step = 1e-6
    for q in samples(robot, 5):
        found = model.near(q[None], 2.0)
        apart = found.distance > 0.02
        gradient = model.gradients(q[None], found)
        for j in range(robot.n):
            ends = [distances(model, q + sign * step * np.eye(robot.n)[j])[found.pairs] for sign in (1, -1)]
            differences = (ends[0] - ends[1]) / (2 * step)
            off = np.abs(gradient[:, j] - differences)[apart]
            assert np.median(off) < 1e-5  # parallel faces have kinks
            assert (off < 1e-3).mean() > 0.8


def test_the_certificate_never_proves_more_than_is_there(robot):
    rng = np.random.default_rng(5)
    proved = 0
    for ball in rng.uniform((0.3, -0.6, -0.05), (1.0, 0.6, 0.05), (30, 3)):
        obstacle = Obstacle("ball", Sphere(0.05), pin.SE3(np.eye(3), ball))
        alone = replace(robot, geometry=robot.geometry.copy())
        alone.geometry.removeAllCollisionPairs()
        model = CollisionModel(alone, Scene(obstacles=(obstacle,)))
        start, end = rng.uniform(robot.limits.lower, robot.limits.upper, (2, robot.n))
        motion = quintic(robot.joint_names, start, end, 1.0)
        proof = certify(model, motion, VerifyPolicy())
        truth = min(distances(model, q).min() for q in motion(np.linspace(0, 1, 400)))
        assert proof.proved == (truth > 0)
        if proof.proved:
            proved += 1
            assert proof.clearance <= truth + 1e-9
    assert 5 < proved < 25


def test_followers_narrow_what_their_leader_may_do(tmp_path):
    tight = follower("lead", -2, 0.5, '<limit lower="-1" upper="1.5" velocity="1" effort="1"/>')
    parts = [*(BARE.format(name) for name in "abc"), joint("lead", "a", "b"), joint("tail", "b", "c", inside=tight)]
    robot = load_robot(str(write_robot(tmp_path, parts, BODILESS)))
    assert (robot.limits.lower, robot.limits.upper) == (-0.5, 0.75)  # -1 <= 0.5 - 2 q <= 1.5
    assert robot.limits.velocity == 0.5
    assert robot.limits.torque == 4  # of the leader's drive
    assert any("lead stays within [-0.5, 0.75], for tail that follows it" in note for note in robot.notes)
    own = load_robot(str(write_robot(tmp_path, parts, BODILESS + "limits: {velocity: 0.9}\n")))
    assert own.limits.velocity == 0.9  # the robot file's word


def test_a_leader_that_is_locked_locks_what_follows_it(tmp_path):
    text = "group: [elbow]\nlocked: {lift: 0.5}\n"
    robot = load_robot(str(write_robot(tmp_path, PARTS, text)))
    assert robot.locked == pytest.approx({"lift": 0.5, "early": -0.3, "slide": 0.275})
    assert set(robot.followers) == {"late"}


def test_a_follower_that_the_file_locks_stands_still(tmp_path):
    text = "group: [lift, elbow]\nlocked: {late: 0.2}\n"
    robot = load_robot(str(write_robot(tmp_path, PARTS, text)))
    assert set(robot.followers) == {"early", "slide"}
    assert robot.locked == {"late": 0.2}
    assert "joint late is locked here and does not follow elbow" in robot.notes


@pytest.mark.parametrize(("group", "followers"), [("lift, elbow", {"late"}), ("elbow", {"late"})])
def test_a_follower_that_stands_still_holds_what_follows_it(tmp_path, group, followers):
    text = f"group: [{group}]\nlocked: {{early: 0.4}}\n"
    robot = load_robot(str(write_robot(tmp_path, PARTS, text)))
    assert set(robot.followers) == followers
    assert robot.locked["slide"] == pytest.approx(-0.25 * 0.4 + 0.2)


def test_joints_are_held_where_a_leader_is_on_a_later_branch(tmp_path):
    """Depth first, `a2` comes before `b1`, which it follows."""
    parts = [*(BARE.format(name) for name in "abcde"), joint("a1", "a", "b"), joint("b1", "a", "d")]
    parts += [joint("a2", "b", "c", inside=follower("b1", -2)), joint("z9", "d", "e")]
    robot = load_robot(str(write_robot(tmp_path, parts, BODILESS + "group: [a1, b1, z9]\n")))
    held = robot.holding({"z9": 0.3})
    assert (held.joint_names, set(held.followers)) == (("a1", "b1"), {"a2"})
    for frame in "ce":
        found = frame_pose(held, np.array([0.4, 0.5]), frame).homogeneous
        np.testing.assert_allclose(found, frame_pose(robot, np.array([0.4, 0.5, 0.3]), frame).homogeneous, atol=1e-12)


def test_a_multiplier_of_zero_is_a_joint_that_stands_still(tmp_path):
    parts = [*(BARE.format(n) for n in "abc"), joint("j", "a", "b"), joint("k", "b", "c", inside=follower("j", 0, 0.3))]
    robot = load_robot(str(write_robot(tmp_path, parts, BODILESS)))
    assert (robot.followers, robot.locked) == ({}, {"k": 0.3})


@pytest.mark.parametrize(
    ("leaders", "words"),
    [
        ({"j1": "j2", "j2": "j1"}, "a circle: j1 follows j2 follows j1"),
        ({"j1": "j1"}, "a circle: j1 follows j1"),
        ({"j2": "j9"}, "<mimic> of 'j9', which is no joint that moves; expected one of: j1, j3"),
        ({"j2": "still"}, "<mimic> of 'still', which is no joint that moves"),
        ({"j1": "j2"}, "<mimic> of 'j2', a joint that it carries"),
    ],
)
def test_what_cannot_be_followed_is_refused(tmp_path, leaders, words):
    inside = {name: follower(leaders[name], 1) if name in leaders else LIMIT for name in ("j1", "j2", "j3")}
    parts = [*(BARE.format(name) for name in "abcde"), joint("still", "d", "e", "fixed", "")]
    parts += [joint(name, *ends, inside=inside[name]) for name, ends in zip(inside, ("ab", "bc", "cd"), strict=True)]
    with pytest.raises(InputError) as caught:
        load_robot(str(write_robot(tmp_path, parts, BODILESS)))
    (issue,) = caught.value.issues
    assert issue.file.endswith("robot.urdf")
    assert issue.line == 1
    assert words in str(issue)


def test_turns_of_a_joint_that_another_follows_by_halves(tmp_path):
    endless = [*(BARE.format(n) for n in "abc"), joint("j", "a", "b", "continuous", "")]
    with pytest.raises(InputError, match=r"which turns without end, by 0\.5; expected a whole multiplier"):
        load_robot(str(write_robot(tmp_path, [*endless, joint("k", "b", "c", inside=follower("j", 0.5))])))
    wide = '<limit lower="-9" upper="9" velocity="1" effort="1"/>'
    for multiplier, count in ((1, 3), (0.5, 1)):
        parts = [*(BARE.format(n) for n in "abc"), joint("j", "a", "b", inside=wide)]
        parts.append(joint("k", "b", "c", inside=follower("j", multiplier, 0, wide)))
        robot = load_robot(str(write_robot(tmp_path, parts, BODILESS)))
        (found,) = images(robot, np.array([0.0]), np.array([0.0]))
        assert len(found) == count


def test_trajopt_plans_within_the_torque_of_the_leader(robot):
    """Its derivatives of inverse dynamics are of the unfolded model; pinocchio refuses them for followers."""
    limits = replace(robot.limits, torque=np.array([6.0, 2.0]))
    strong = unchecked_problem(
        name="t",
        robot=robot,
        scene=Scene(),
        start=np.array([-0.6, -0.9]),
        goal=(JointGoal(np.array([0.9, 0.8])),),
        limits=robot.limits,
    )
    weak = derived(strong, limits=limits)
    fast, slow = (run(problem, "trajopt", {}, Budget(5.0), lambda *_: None) for problem in (strong, weak))
    assert fast.report is not None
    assert slow.report is not None
    assert fast.report.verified
    assert slow.report.verified
    assert slow.trajectory.duration > 1.2 * fast.trajectory.duration  # the torque rows matter


def test_the_viewer_moves_the_followers(robot):
    problem = unchecked_problem(
        name="t",
        robot=robot,
        scene=Scene(),
        start=np.zeros(2),
        goal=(JointGoal(np.array([0.5, 0.5])),),
        limits=robot.limits,
    )
    scene = build_scene(problem, [])
    assert scene.bodies == 5
    assert len(unpacked(scene.start)) == 5 * 7
    assert {part["body"] for part in scene.parts} == {1, 2, 3, 4, 5}


def unpacked(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=np.float32)


def test_the_exported_urdf_has_the_mimics(robot, tmp_path):
    (tmp_path / "again.urdf").write_text(export_urdf(robot))
    (tmp_path / "robot.yaml").write_text("version: 1\nname: again\nurdf: again.urdf\ngroup: [lift, elbow]\n")
    again = load_robot(str(tmp_path))
    assert again.followers == robot.followers
    np.testing.assert_array_equal(again.limits.lower, robot.limits.lower)
    limit = ET.parse(tmp_path / "again.urdf").find("joint[@name='elbow']/limit")
    stated = [float(limit.get(end)) for end in ("lower", "upper")]
    assert stated == [robot.limits.lower[1], robot.limits.upper[1]] == pytest.approx([-2 / 1.7, 2 / 1.7])


def test_derivatives_of_torque_come_from_the_unfolded_model(robot):
    """A^T (dtau_J/dq_J) A against differences of the folded model's inverse dynamics."""
    plain, data, step = unfold(robot.model), robot.model.createData(), 1e-6
    unfolded = plain.model.createData()
    q, v, a = np.array([0.3, -0.4]), np.array([1.0, -2.0]), np.array([0.5, 3.0])
    pin.computeRNEADerivatives(plain.model, unfolded, plain.A @ q + plain.b, plain.A @ v, plain.A @ a)
    by_q, by_v = (plain.A.T @ np.array(D) @ plain.A for D in (unfolded.dtau_dq, unfolded.dtau_dv))
    for j, change in enumerate(step * np.eye(robot.n)):
        ahead, back = (pin.rnea(robot.model, data, q + s * change, v, a).copy() for s in (1, -1))
        np.testing.assert_allclose(by_q[:, j], (ahead - back) / (2 * step), atol=1e-6)
        ahead, back = (pin.rnea(robot.model, data, q, v + s * change, a).copy() for s in (1, -1))
        np.testing.assert_allclose(by_v[:, j], (ahead - back) / (2 * step), atol=1e-6)
