"""Obstacles on stated trajectories are proved at the times at which they are where: against dense samples, attacked."""

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.joining import standstill, with_obstacles
from optiplan.verify.tasks.carriage import on_carriage, seen_from
from optiplan.verify.verify import verify
from tests.checks import named

REACH = op.load_problem("01_reach")
MOTION = op.plan(REACH, "scurve").trajectory
T = MOTION.duration
MIDDLE = frame_pose(REACH.robot, MOTION(0.5 * T), REACH.robot.tool_frame).translation


def ball(offset, polynomial, until=None, radius=0.05):
    return op.Sphere("ball", radius, position=tuple(MIDDLE + np.array(offset, float))).moving(polynomial, until)


def collision(scene, motion=MOTION):
    report = verify(REACH.with_scene(scene), motion)
    return named(report, "collision")


def sampled(scene, motion=MOTION, count=1500):
    """Least distance of all pairs at many instants, m."""
    model = CollisionModel(REACH.robot, op.Scene(scene))
    t = np.linspace(0.0, motion.duration, count)
    return min(model.clearance(q).distance for q in model.at_times(motion(t), t))


def through(z, speed=0.0):
    """A polynomial that falls by z within half the motion."""
    return [[0.0], [0.0], [0.0, -2.0 * z / T]]


@pytest.mark.parametrize("seed", range(8))
def test_the_proof_agrees_with_dense_samples(seed):
    rng = np.random.default_rng(seed)
    offset = rng.normal(size=3) * 0.35
    scene = [ball(offset, (rng.normal(size=(3, 4)) * [0.0, 0.6, 0.6, 0.4]).tolist(), until=rng.uniform(0.2, 1.2) * T)]
    try:
        check, least = collision(scene), sampled(scene)
    except op.InputError:
        return  # it touches the start
    if check.passed:
        assert 0.0 < check.worst <= least + 1e-9
        assert check.worst >= 0.75 * least - 1e-6
    else:
        assert least < 1e-3
        assert check.witness["contact"]
        assert len(check.witness["q"]) == REACH.robot.n


def test_at_the_wrong_time_it_is_refused_and_at_another_it_is_not():
    """The same way of the ball through the path, as fast, but sooner or later."""
    hit = collision([ball([0, 0, 0.5], through(0.5))])
    assert not hit.passed
    assert hit.time == pytest.approx(0.5 * T, abs=0.2 * T)
    assert "ball" in hit.place
    assert collision([ball([0, 0, 1.5], through(0.5))]).passed, "it comes when the arm has gone"


def test_a_ball_that_is_there_for_an_instant_only():
    """At 30 m/s it is in the way for 3 ms: samples miss it, the proof does not."""
    speed = 30.0
    away = speed * 0.5 * T
    scene = [ball([0, 0, away], [[0], [0], [0, -speed]], radius=0.02)]
    assert not collision(scene).passed
    t = np.linspace(0.0, T, 40)[1::2]
    model = CollisionModel(REACH.robot, op.Scene(scene))
    assert min(model.clearance(q).distance for q in model.at_times(MOTION(t), t)) > 0.0
    late = [ball([0, 0, away + 1.0], [[0], [0], [0, -speed]], radius=0.02)]
    assert sampled(late, count=4000) > 0.0 or not collision(late).passed


def test_after_its_time_it_stands():
    """It stops on the path; one that would have gone on is out of the way."""
    quick = [[0.0], [0.0], [0.0, -4.0 * 0.6 / T]]
    assert not collision([ball([0, 0, 0.6], quick, until=0.25 * T)]).passed
    assert collision([ball([0, 0, 0.6], quick)]).passed == (sampled([ball([0, 0, 0.6], quick)]) > 0.0)


@pytest.mark.parametrize("off", [-3e-12, -5e-16, 5e-16, 3e-12])
def test_it_may_stop_within_rounding_of_the_end(off):
    """Files hold `until` with as many digits as somebody printed."""
    assert collision([ball([0, 0, 1.5], through(0.5), until=T + off)]).passed
    hit = [ball([0, 0, 0.5], [[0.0], [0.0], [0.0, -0.5 / T]], until=T + off)]
    assert collision(hit).passed == collision([ball([0, 0, 0.5], [[0.0], [0.0], [0.0, -0.5 / T]])]).passed
    extended = with_obstacles(MOTION, [hit[0].motion])
    assert extended.duration == T
    assert np.allclose(extended.end[-1], -0.5, atol=1e-9)


def test_terms_of_a_motion_that_cancel_beyond_their_digits_are_refused():
    """Where it is at the end is a difference of two terms, known to a share of these."""
    terms = [0.0, -5e5 / T, 5e5 / T**2]
    for scale, passes in ((1e-6, True), (1.0, False)):
        scene = [ball([2.0, 0, 0], [[0], [scale * one for one in terms], [0]])]
        report = verify(REACH.with_scene(scene), MOTION)
        assert report.verified == passes
        assert ("motion" in [check.name for check in report.failures]) != passes
    assert "'ball' has terms of 5e+05 m or rad" in report.failures[0].detail


def test_what_moves_into_the_base_is_refused():
    """The base stands still, so that obstacles that stand need no pair with it; those that move do."""
    side = op.Box("cart", size=(0.2, 0.2, 0.2), position=(-1.0, 0.0, 0.1))
    assert not collision([side.moving([[0.0, 1.0 / T], [0], [0]])]).passed
    assert collision([side.moving([[0.0, 0.3 / T], [0], [0]])]).passed


def test_a_waiting_motion_is_judged_by_its_own_time():
    """The same path is free or not by when it is run."""
    scene = [ball([0, 0, 0.5], through(0.5))]
    slow = MOTION.scaled(3.0 * T)
    assert collision(scene, slow).passed == (sampled(scene, slow, 3000) > 0.0)


@pytest.mark.parametrize("core", [True, False])
def test_planners_look_at_the_same_instants(core):
    model = (planning_model if core else CollisionModel)(REACH.robot, op.Scene([ball([0, 0, 0.5], through(0.5))]))
    touch = first_contact(model, MOTION)
    assert touch is not None
    assert len(touch.q) == REACH.robot.n
    assert "ball" in (touch.contact.pair.name_a, touch.contact.pair.name_b)
    free = (planning_model if core else CollisionModel)(REACH.robot, op.Scene([ball([0, 0, 1.5], through(0.5))]))
    assert first_contact(free, MOTION) is None


def test_clearance_asked_for_of_what_moves():
    wanted = op.PairClearance((("panda_hand", "ball"),), at_least=0.1)
    near = REACH.with_scene([ball([0, 0, 1.5], through(0.5))])
    found = {check.name: check for check in verify(near.with_constraints(wanted), MOTION).checks}
    assert found["clearance constraint"].passed
    hit = REACH.with_scene([ball([0, 0, 0.6], through(0.5))])
    found = {check.name: check for check in verify(hit.with_constraints(wanted), MOTION).checks}
    assert not found["clearance constraint"].passed


def test_columns_of_obstacles_are_their_displacement():
    motions = [
        ObstacleMotion.of_data([[0, 1], [0, 0, -2], [0.1]], until=0.3 * T),
        ObstacleMotion.of_data([[0, 0, 0, 1], [1], [0]], until=0.7 * T),
        ObstacleMotion.of_data([[0, 0.5], [0], [0]]),
    ]
    found = with_obstacles(MOTION, motions)
    t = np.linspace(0.0, T, 500)
    for order in (0, 1):
        wanted = np.hstack([MOTION(t, order), *(motion.at(t, order) for motion in motions)])
        assert found(t, order) == pytest.approx(wanted, abs=1e-9)
    assert with_obstacles(MOTION, []) is MOTION


def test_the_scene_later():
    scene = op.Scene([ball([0, 0, 0.5], through(0.5), until=0.6)])
    for t in (0.2, 0.6, 0.9):
        (then,) = scene.later(t).obstacles
        (now,) = scene.obstacles
        for s in (0.0, 0.1, 0.5):
            at = now.motion.at(np.array([t + s]))[0] + now.X_WO.translation
            moved = np.zeros(3) if then.motion is None else then.motion.at(np.array([s]))[0]
            assert then.X_WO.translation + moved == pytest.approx(at, abs=1e-12)
    assert scene.standing.obstacles == ()


@pytest.mark.parametrize(
    ("name", "follower"), [("obstacle 0 row 1", "f"), ("carriage y", "f"), ("slide", "carriage y")]
)
def test_joints_may_have_any_names(tmp_path, name, follower):
    """The proof adds joints that carry what moves, and those that carry the robot where the frame of a line moves."""
    ends = '<parent link="base"/><child link="slide"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    body = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    links = f'<link name="base"/><link name="slide">{body}</link>'
    (tmp_path / "own.urdf").write_text(
        f'<robot name="own">{links}<joint name="{name}" type="prismatic">{ends}</joint>'
        f'<link name="end"/><joint name="{follower}" type="prismatic"><mimic joint="{name}"/>'
        f"{ends.replace('slide', 'end').replace('base', 'slide')}</joint></robot>"
    )
    moving = op.Sphere("ball", 0.1, position=(3.0, 0.0, 0.0)).moving([[0.0, 0.1], [0.0], [0.0]])
    problem = op.Problem(tmp_path / "own.urdf", [0.0], [0.0], scene=[moving])
    still = standstill(problem.robot.joint_names, problem.start, 1.0)
    assert verify(problem, still).verified
    robot = on_carriage(problem, moving.motion).robot
    seen = seen_from(still, moving.motion, 0.0, robot)
    assert seen.joint_names == robot.joint_names
