"""Motions proved by clearance and travel: never more than the proof of the whole curve allows, and hardly less."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.clearance_test import PairMargins
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel, planning_model
from optiplan.geometry.scene import Capsule, Cylinder, HalfSpace, Obstacle, Scene, Sphere
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.robot.robot import load_robot
from tests.planners import cases
from tests.planners.polyline import polyline_contact


def scene():
    """One obstacle of every kind but meshes, with a half-space across the axes."""
    tilt = tuple(np.array([1.0, 2.0, 10.0]) / np.linalg.norm([1.0, 2.0, 10.0]))
    shapes = [Sphere(0.1), Cylinder(0.08, 0.5), Capsule(0.05, 0.4), HalfSpace(tilt, -0.05), HalfSpace((0, 0, 1), -0.1)]
    places = [(0.5, 0.0, 0.6), (-0.4, 0.3, 0.4), (0.3, -0.5, 0.5), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    around = [
        Obstacle(f"body {k}", shape, pin.SE3(np.eye(3), np.array(place, dtype=float)))
        for k, (shape, place) in enumerate(zip(shapes, places, strict=True))
    ]
    return Scene((*around, cases.box("box", (0.2, 0.3, 0.4), (0.2, 0.6, 0.3))))


def motions(model, count, seed=0):
    limits, rng = model.robot.limits, np.random.default_rng(seed)
    low, high = np.maximum(limits.lower, -3.0), np.minimum(limits.upper, 3.0)
    while count:
        a = rng.uniform(low, high)
        if not model.collides(a):
            count -= 1
            yield a, np.clip(a + rng.normal(size=len(a)) * 0.2, low, high)


@pytest.mark.parametrize("name", ["panda", "planar2r", "delbot"])
def test_levers_bound_the_change_of_every_distance(name):
    model = CollisionModel(load_robot(name), scene())
    limits = model.robot.limits
    stroke = np.minimum(np.maximum(np.abs(limits.lower), np.abs(limits.upper)), 10.0)
    moment_arms = model.bounds.moment_arms(stroke)
    rng = np.random.default_rng(1)
    tightest = 0.0
    for _ in range(40):
        q = rng.uniform(np.maximum(limits.lower, -3.0), np.minimum(limits.upper, 3.0))
        d = rng.normal(size=len(q)) * 0.01
        ends = [np.clip(x, -stroke, stroke) for x in (q, q + d)]
        gaps = []
        for end in ends:
            model.place(end)
            gaps.append(np.array([model.pair_gap(pair) for pair in range(len(model.pairs))]))
        change, bound = np.abs(gaps[1] - gaps[0]), moment_arms @ np.abs(ends[1] - ends[0])
        apart = np.minimum(*gaps) > 0.0  # depths of penetration are not trusted
        assert (change[apart] <= bound[apart] + 1e-6).all()
        tightest = max(tightest, (change[apart] / (bound[apart] + 1e-12)).max())
    assert tightest > 0.2, "a bound that is never approached says nothing"


def test_margins_are_held_to_a_micrometre():
    """Each pair on its own, and each kind of body: nearer than its margin by 2 µm is near, farther by 2 µm is not."""
    model = CollisionModel(cases.robot("panda"), scene())
    margins, rng = PairMargins(model), np.random.default_rng(0)
    seen = set()
    for q, _ in motions(model, 40):
        model.place(q)
        gaps = np.array([model.pair_gap(pair) for pair in range(len(model.pairs))])
        for pair in rng.choice(np.argsort(gaps)[:60], 6, replace=False):
            seen.add(model.pairs[pair].name_b)
            for extra, near in ((2e-6, True), (-2e-6, False)):
                one = np.zeros(len(gaps))
                one[pair] = max(gaps[pair] + extra, 0.0)
                margins.set(one)
                assert margins.near(q) == (near and gaps[pair] + extra >= 0.0)
    assert {f"body {k}" for k in range(5)} | {"box"} <= seen


def test_free_motions_are_those_of_the_proof():
    model = CollisionModel(cases.robot("panda"), scene())
    check = MotionCheck(model, model.robot.limits)
    answers = [(check.free(a, b), polyline_contact(model, np.array([a, b])) is None) for a, b in motions(model, 120)]
    ours, proofs = np.array(answers).T
    assert 20 < proofs.sum() < 110
    assert not (ours & ~proofs).any()
    assert (ours == proofs).mean() > 0.98


def test_a_plate_thinner_than_any_step_is_met():
    plate = cases.box("plate", (0.4, 1e-4, 0.1), (0.5, 0.25, 0.55))
    model = CollisionModel(cases.robot("panda"), Scene((plate,)))
    check = MotionCheck(model, model.robot.limits)
    assert not model.collides(cases.READY)
    assert not model.collides(cases.LEFT)
    assert not check.free(cases.READY, cases.LEFT)
    assert MotionCheck(CollisionModel(cases.robot("panda"), Scene()), model.robot.limits).free(cases.READY, cases.LEFT)


def test_no_motion_and_hardly_any_are_free():
    model = CollisionModel(cases.robot("panda"), scene())
    check = MotionCheck(model, model.robot.limits)
    q = next(motions(model, 1))[0]
    assert check.free(q, q)
    assert check.free(q, q + 1e-9)


def test_a_pose_too_heavy_on_the_way_is_refused():
    """Stretched out level, the arm asks most of its shoulder; both ends of the motion ask less than the limit."""
    arm = cases.robot("panda")
    a, level, b = (np.array([0.0, shoulder, 0.0, -0.1, 0.0, 1.5, 0.0]) for shoulder in (1.35, 1.5, 1.75))
    least, less, most = sorted(Gravity(arm, np.full(7, np.inf)).torque(q).max() for q in (a, level, b))
    assert least < less < most
    for model in (CollisionModel(arm, Scene()), planning_model(arm, Scene())):
        proof = MotionCheck(model, arm.limits, Gravity(arm, np.full(7, 0.5 * (less + most))))
        for check in (proof, proof.here_and_there()):
            assert not check.blocked(a)
            assert not check.blocked(b)
            assert not check.free(a, b)
            assert check.free(a, a + 0.01)
        assert MotionCheck(model, arm.limits).free(a, b)


def test_a_look_here_and_there_misses_only_what_is_between():
    """What is proved free is seen free; what is seen free may touch, but at none of the configurations looked at."""
    model = planning_model(cases.robot("panda"), scene())
    check = MotionCheck(model, model.robot.limits)
    looks = check.here_and_there()
    lever = model.bounds.moment_arms(np.maximum(np.abs(check.limits.lower), np.abs(check.limits.upper))).max(axis=0)
    seen, proved, coarse = 0, 0, 0
    for a, b in motions(model, 300):
        if check.free(a, b):
            proved += 1
            assert looks.free(a, b)
        if not looks.free(a, b):
            continue
        seen += 1
        looked_at = 4 * max(1, int(np.ceil(lever @ np.abs(b - a) / 0.2)))
        coarse += looked_at < 40
        assert not any(model.collides(a + k / looked_at * (b - a)) for k in range(1, looked_at + 1))
    assert 40 < proved <= seen < 290
    assert coarse > 20


@pytest.mark.parametrize("error", [None, np.full(7, 1e-3)])
def test_only_a_plain_model_is_looked_at_here_and_there(error):
    model = planning_model(cases.robot("panda"), scene(), error=error)
    check = MotionCheck(model, model.robot.limits)
    plain = isinstance(model, NativeCollisionModel) and error is None
    assert (check.here_and_there() is check) == (not plain)
