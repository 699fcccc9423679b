"""The proof by planes in the core beside the one in Python: the same verdicts, and nothing nearer than it says."""

from concurrent.futures import ThreadPoolExecutor
from unittest.mock import patch

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.collision.model import CollisionModel
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.motion_tools import tools_of
from optiplan.verify.continuous.proof import SCENE, SELF
from optiplan.verify.planes import plane_search as plane_search_module
from optiplan.verify.planes import search_state
from optiplan.verify.planes.plane_search import plane_search
from optiplan.verify.report import VerifyPolicy
from tests.verify.bodies_around import among_bodies
from tests.verify.motions import smooth, within_limits

pytestmark = pytest.mark.skipif(core is None, reason="needs the native core")

ROBOTS = ("panda", "ur5", "srra", "baxter_left", "planar2r")


def motions(problem, count):
    """Smooth motions that begin at the start of a problem."""
    rng, robot = np.random.default_rng(7), problem.robot
    for k in range(count):
        steps = np.cumsum(rng.normal(size=(5, robot.n)), axis=0) * (0.05, 0.15, 0.4)[k % 3]
        points = np.clip(problem.start + np.vstack([np.zeros(robot.n), steps]), robot.limits.lower, robot.limits.upper)
        yield within_limits(smooth(robot.joint_names, points, 1.0), robot.limits)


def without_planes(*arguments, **named):
    with patch.object(search_state, "plane_search", lambda *_: None):
        return certify(*arguments, **named)


@pytest.mark.parametrize("name", ROBOTS)
def test_verdicts_are_those_of_the_proof_in_python(name):
    problem = among_bodies(name, 10, 3)
    model, verdicts = CollisionModel(problem.robot, problem.scene), []
    for motion in motions(problem, 12):
        ours, theirs = (prove(model, motion, VerifyPolicy()) for prove in (certify, without_planes))
        assert ours.proved == theirs.proved
        assert ours.contact == theirs.contact
        verdicts.append(ours.proved)
        if ours.proved:
            Q = motion(np.linspace(0.0, motion.duration, 100))
            assert ours.clearance <= min(model.clearance(q).distance for q in Q) + 1e-6
            for kind in (SELF, SCENE):
                met = theirs.measured(np.inf)[kind]
                assert ours.least[kind] <= met + 1e-6
                if np.isfinite(met) and met < 0.1:
                    assert ours.least[kind] >= 0.7 * min(met, theirs.least[kind])
        else:
            assert ours.nearest.time == theirs.nearest.time
            assert ours.nearest.distance == theirs.nearest.distance
    assert 3 <= sum(verdicts) < len(verdicts)


@pytest.fixture(scope="module")
def grazes():
    """A problem, and of motions: a place that each comes near to, how near to a ball there (m), from which side."""
    problem, found = among_bodies("panda", 6, 5), []
    model = CollisionModel(problem.robot, problem.scene)
    for motion in motions(problem, 4):
        q = motion(0.37 * motion.duration)
        place = model.kinematics.poses(q[None])[0, -1, :3, 3] + np.array([0.0, 0.0, 0.6])
        with_ball = CollisionModel(problem.robot, problem.with_scene([ball(place)]).scene)
        Q = motion(np.linspace(0.0, motion.duration, 1500))
        near = with_ball.clearance(min(Q, key=lambda q: with_ball.clearance(q).distance))
        on_ball = near.point_b if near.pair.name_b == "grazed" else near.point_a
        found.append((motion, place, near.distance, (on_ball - place) / np.linalg.norm(on_ball - place)))
    return problem, found


def ball(place):
    return op.Sphere("grazed", radius=0.05, position=place)


@pytest.mark.parametrize("depth", [1e-3, 1e-5, 3e-6, -3e-6, -1e-5, -1e-3])
def test_grazing_motions(grazes, depth):
    """A ball is put where a motion misses it by `depth`, m; below 0 it touches."""
    problem, found = grazes
    for motion, place, distance, way in found:
        touching = problem.with_scene([ball(place + (distance - depth) * way)]).scene
        moved = CollisionModel(problem.robot, touching)
        assert certify(moved, motion, VerifyPolicy()).proved == without_planes(moved, motion, VerifyPolicy()).proved


def test_it_is_made_once_for_a_work_space():
    problem = among_bodies("panda", 6, 5)
    model = CollisionModel(problem.robot, problem.scene)
    assert plane_search(model, tools_of(model)) is plane_search(model, tools_of(model))


def test_obstacles_that_stand_elsewhere():
    """A work space of the same bodies is proved as one made anew."""
    problem = among_bodies("panda", 4, 5)
    for step in (0.0, 0.1, 0.2):
        bodies = [op.Box("a", size=[0.1, 0.1, 0.1], position=[0.5 + step, 0.4, 0.3])]
        model = CollisionModel(problem.robot, problem.with_scene(bodies).scene)
        for motion in motions(problem, 6):
            ours, theirs = certify(model, motion, VerifyPolicy()), without_planes(model, motion, VerifyPolicy())
            assert ours.proved == theirs.proved


def test_threads_prove_with_the_same_bodies_at_once():
    problem = among_bodies("panda", 6, 5)
    first = CollisionModel(problem.robot, problem.scene)
    motion = next(motion for motion in motions(problem, 18) if certify(first, motion, VerifyPolicy()).proved)
    twins = [first.with_obstacles_moved(problem.scene) for _ in range(4)]
    assert len({model.same_bodies for model in twins}) == 1
    with ThreadPoolExecutor(4) as pool:
        proofs = list(pool.map(lambda model: [certify(model, motion, VerifyPolicy()) for _ in range(5)], twins))
    one, *others = (proof for own in proofs for proof in own)
    assert one.proved
    assert all(
        (proof.least == one.least).all() and proof.queries == one.queries and proof.intervals == one.intervals
        for proof in others
    )


def test_a_long_motion_may_take_more_intervals():
    """A motion of more pieces than the core's least budget is proved there all the same."""
    problem = among_bodies("panda", 6, 5)
    model, proofs = CollisionModel(problem.robot, problem.scene), []
    found = next(motion for motion in motions(problem, 18) if certify(model, motion, VerifyPolicy()).proved)
    times = np.linspace(0.0, found.duration, 400)
    Q = found(times)
    lines = np.stack([Q[:-1], np.diff(Q, axis=0) / np.diff(times)[:, None]], axis=1)
    motion = op.Trajectory(problem.robot.joint_names, times, lines)
    for most in (50_000, 100):
        with patch.object(plane_search_module, "_MOST", most):
            proofs.append(certify(model, motion, VerifyPolicy()))
    assert proofs[0].proved
    assert proofs[0].intervals == proofs[1].intervals
    assert (proofs[0].least == proofs[1].least).all()


def test_what_the_policy_says_ends_it():
    """No interval is looked at that is shorter than the policy's, and no more distances are asked for."""
    problem = among_bodies("panda", 6, 5)
    model, motion = CollisionModel(problem.robot, problem.scene), next(motions(problem, 1))
    found = certify(model, motion, VerifyPolicy(max_queries=1))
    assert not found.proved
    assert "1 distance queries" in found.reason
