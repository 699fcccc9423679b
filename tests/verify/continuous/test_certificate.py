"""The certificate: sound (what it proves holds), complete (what is clear it proves), and honest when it gives up."""

import time

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Attachment, Box, Capsule, Cylinder, HalfSpace, Mesh, Obstacle, Scene, Sphere
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.verify import collision
from tests.verify.motions import problem_of, quintic, smooth, within_limits

seeds = st.integers(0, 2**31)


def random_scene(rng, count, low, high):
    """Obstacles of all convex kinds, anywhere in a box of the workspace."""
    obstacles = []
    for i in range(count):
        a, b, c = rng.uniform(0.01, 0.15, 3)
        shape = [Box((a, b, c)), Sphere(a), Cylinder(a, 2 * b), Capsule(a, b)][rng.integers(4)]
        obstacles.append(Obstacle(f"o{i}", shape, pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(low, high))))
    return Scene(tuple(obstacles))


def random_motion(rng, robot, spread):
    """A smooth motion about a random configuration within limits, as fast as the limits allow."""
    lower, upper = np.maximum(robot.limits.lower, -3.0), np.minimum(robot.limits.upper, 3.0)
    middle = rng.uniform(0.8 * lower + 0.2 * upper, 0.2 * lower + 0.8 * upper)
    points = np.clip(middle + np.cumsum(rng.normal(size=(6, robot.n)), axis=0) * spread, lower, upper)
    return within_limits(smooth(robot.joint_names, points, 1.0), robot.limits)


def sampled_clearance(model, trajectory, count):
    """Smallest distance of all pairs at this many instants."""
    Q = trajectory(np.linspace(0.0, trajectory.duration, count))
    return min(model.clearance(q).distance for q in Q)


@settings(max_examples=25)
@given(seeds)
def test_dense_sampling_finds_no_collision_in_what_was_proved_planar(planar, seed):
    check_against_samples(planar, seed, 0.25, ([-0.9, 0.0, -0.4], [0.9, 0.3, 1.4]))


@settings(max_examples=12)
@given(seeds)
def test_dense_sampling_finds_no_collision_in_what_was_proved_panda(panda, seed):
    check_against_samples(panda, seed, 0.08, ([-0.8, -0.8, 0.0], [0.8, 0.8, 1.2]))


def check_against_samples(robot, seed, spread, room):
    """Proved: no collision at any sample, and never nearer than the clearance told. Clear by 1 cm: proved."""
    rng = np.random.default_rng(seed)
    trajectory = random_motion(rng, robot, spread)
    model = CollisionModel(robot, random_scene(rng, rng.integers(1, 8), *room))
    proof = certify(model, trajectory, VerifyPolicy())
    near = proof.nearest.time if proof.nearest else 0.0
    t = np.concatenate([np.linspace(0, trajectory.duration, 1500), near + np.linspace(-0.01, 0.01, 500)])
    Q = trajectory(np.clip(t, 0.0, trajectory.duration))
    if proof.proved:
        assert not any(model.collides(q) for q in Q)
        smallest = min(model.clearance(q).distance for q in Q[::5])
        assert smallest >= proof.clearance - 1e-6  # coal's tolerance
    else:
        assert proof.contact
        assert proof.nearest.distance <= 1e-9
        assert model.collides(proof.nearest.q) or proof.nearest.distance > -1e-5
        assert sampled_clearance(model, trajectory, 300) < 0.01


def test_a_clear_motion_is_proved_near_its_true_clearance(panda):
    """The bound told is about half of what dense sampling finds, or 5 mm, at a few hundred queries."""
    end = panda.configurations["ready"] + np.array([1.2, 0.3, 0.4, 0.5, -0.5, 0.4, 1.0])
    path = quintic(panda.joint_names, panda.configurations["ready"], end, 1.0)
    trajectory = within_limits(path, panda.limits)
    tips = [pin.SE3(np.eye(3), np.array(p)) for p in ([0.35, 0.35, 0.75], [0.5, 0.1, 0.2], [0.3, 0.6, 0.3])]
    scene = Scene(tuple(Obstacle(f"o{i}", Sphere(0.05), X) for i, X in enumerate(tips)))
    model = CollisionModel(panda, scene)
    proof = certify(model, trajectory, VerifyPolicy())
    smallest = sampled_clearance(model, trajectory, 2000)
    assert proof.proved
    assert 0.4 * min(smallest, 0.01) <= proof.clearance <= smallest <= proof.nearest.distance + 1e-9
    assert proof.queries < 5000


@pytest.mark.parametrize(("asked", "proved"), [(0.0, True), (9.9e-4, True), (1.01e-3, False)])
def test_clearance_asked_for(planar, asked, proved):
    """The tool's ball passes another at 1 mm exactly, in the plane of the outer link."""
    trajectory = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([1.06 + 0.04 + 0.02 + 0.001, 0.18, 0.5])))
    proof = certify(CollisionModel(planar, Scene((ball,))), trajectory, VerifyPolicy(clearance=asked))
    assert proof.proved is proved
    if proved:
        assert asked < proof.clearance <= 1e-3
    else:
        assert proof.contact
        assert "too near" in proof.reason
        assert proof.nearest.distance == pytest.approx(1e-3, abs=1e-5)


@pytest.mark.parametrize("gap", [2e-4, 3e-3, 0.02, 0.06])
def test_the_clearance_proved_is_near_the_smallest_distance_met(planar, gap):
    """Told beside *verified* is what is proved; where bounding volumes answered, it was 5 mm of 20."""
    trajectory = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([1.06 + 0.04 + 0.02 + gap, 0.18, 0.5])))
    floor = Obstacle("floor", Box((4.0, 4.0, 0.02)), pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0])))
    scene = Scene((ball, floor))
    model = CollisionModel(planar, scene)
    proof = certify(model, trajectory, VerifyPolicy())
    assert proof.nearest.distance == pytest.approx(gap, rel=0.1)
    assert 0.8 * proof.nearest.distance <= proof.clearance + 1e-9 <= proof.nearest.distance + 2e-9
    assert proof.clearance <= sampled_clearance(model, trajectory, 500)
    check = collision(problem_of(planar, trajectory, scene), trajectory, VerifyPolicy())
    assert check.worst == check.witness["proved_clearance"] == proof.clearance
    assert check.witness["met_clearance"] == proof.nearest.distance


def test_touching_without_depth_is_refused(planar):
    trajectory = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([1.06 + 0.04 + 0.02, 0.18, 0.5])))
    proof = certify(CollisionModel(planar, Scene((ball,))), trajectory, VerifyPolicy())
    assert not proof.proved
    assert proof.reason


@pytest.mark.parametrize(
    ("policy", "word"),
    [(VerifyPolicy(max_queries=20), "20 distance queries"), (VerifyPolicy(min_interval=0.02), "intervals of 0.02 s")],
)
def test_giving_up_is_not_a_contact(planar, policy, word):
    trajectory = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([1.06 + 0.04 + 0.02 + 1e-5, 0.18, 0.5])))
    scene = Scene((ball,))
    proof = certify(CollisionModel(planar, scene), trajectory, policy)
    assert not proof.proved
    assert not proof.contact
    assert word in proof.reason
    check = collision(problem_of(planar, trajectory, scene), trajectory, policy)
    assert not check.passed
    assert word in check.detail
    assert certify(CollisionModel(planar, scene), trajectory, VerifyPolicy()).proved


def test_travel_without_measure_is_refused_before_it_fills_the_memory(planar):
    """A file of 300 kB asks for 8 million intervals."""
    t = np.linspace(0.0, 10.0, 2001)
    ramps = np.tile([[0.0, 0.0], [2e5, 0.0]], (2000, 1, 1))
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0])))
    model, began = CollisionModel(planar, Scene((ball,))), time.perf_counter()
    proof = certify(model, Trajectory(planar.joint_names, t, ramps), VerifyPolicy())
    assert not proof.proved
    assert "travel too far for 1002000 intervals" in proof.reason
    assert time.perf_counter() - began < 5.0


def test_steps_within_tolerance_are_covered(planar):
    """A step at a breakpoint, small enough to be tolerated, counts in the proof."""
    trajectory = smooth(planar.joint_names, np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]]), 1.0)
    c = trajectory.coefficients.copy()
    c[1:, 0] += 5e-8
    stepped = type(trajectory)(trajectory.joint_names, trajectory.breakpoints, c)
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([0.7, 0.18, 0.7])))
    model = CollisionModel(planar, Scene((ball,)))
    smooth_proof, proof = (certify(model, t, VerifyPolicy(jump_tolerance=1e-3)) for t in (trajectory, stepped))
    assert smooth_proof.proved
    assert proof.proved
    assert proof.clearance < smooth_proof.clearance


@pytest.fixture
def mesh_file(tmp_path):
    """A closed L-shaped mesh: not convex, so only triangles tell what is free."""
    parts = [trimesh.creation.box((0.4, 0.4, 0.02)), trimesh.creation.box((0.02, 0.4, 0.4))]
    parts[1].apply_translation([0.19, 0.0, 0.21])
    path = tmp_path / "ell.stl"
    trimesh.util.concatenate(parts).export(path)
    return path


def test_meshes_are_taken_by_their_triangles(planar, mesh_file):
    """The ball at the tool stands in the corner of the L, inside its hull; coal's word is believed there, and told."""
    q = np.array([0.3, 0.4])
    trajectory = quintic(planar.joint_names, q, np.add(q, [0.02, -0.02]), 1.0)
    data = planar.model.createData()
    pin.framesForwardKinematics(planar.model, data, q)
    tip = data.oMf[planar.model.getFrameId("tool")].translation
    ell = Obstacle("ell", Mesh(mesh_file), pin.SE3(np.eye(3), np.add(tip, [-0.10, 0.0, -0.09])))
    model = CollisionModel(planar, Scene((ell,)))
    free = certify(model, trajectory, VerifyPolicy())
    hull = Obstacle("ell", Mesh(mesh_file, convex=True), ell.X_WO)
    filled = certify(CollisionModel(planar, Scene((hull,))), trajectory, VerifyPolicy())
    assert not filled.proved
    assert free.proved, free
    assert free.gjk_only > 0
    assert free.clearance <= sampled_clearance(model, trajectory, 500)


def test_a_body_inside_a_mesh_is_refused(planar, tmp_path):
    """Far from every triangle, and yet not free."""
    path = tmp_path / "shell.stl"
    trimesh.creation.box((3.0, 3.0, 3.0)).export(path)
    trajectory = quintic(planar.joint_names, [0.3, 0.4], [0.4, 0.5], 1.0)
    for centre, proved in ((0.0, False), (9.0, True)):
        shell = Obstacle("shell", Mesh(path), pin.SE3(np.eye(3), np.array([centre, 0.0, 0.5])))
        proof = certify(CollisionModel(planar, Scene((shell,))), trajectory, VerifyPolicy())
        assert proof.proved is proved
    assert "inside" in certify_inside(planar, path, trajectory)


def certify_inside(planar, path, trajectory):
    shell = Obstacle("shell", Mesh(path), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5])))
    return collision(problem_of(planar, trajectory, Scene((shell,))), trajectory, VerifyPolicy()).detail


@pytest.mark.parametrize("first", [0, 1])
def test_every_part_of_a_mesh_is_looked_for_inside(planar, tmp_path, first):
    """A held hollow box around one of two dice of a single mesh, whichever the file has first."""
    dice = [trimesh.creation.box((0.02, 0.02, 0.02)) for _ in range(2)]
    dice[1].apply_translation([5.0, 5.0, 5.0])
    trimesh.util.concatenate([dice[first], dice[1 - first]]).export(tmp_path / "dice.stl")
    trimesh.creation.box((0.3, 0.3, 0.3)).export(tmp_path / "hollow.stl")
    trajectory = quintic(planar.joint_names, [0.3, 0.4], [0.35, 0.45], 1.0)
    data = planar.model.createData()
    pin.framesForwardKinematics(planar.model, data, trajectory.start)
    offset = pin.SE3(np.eye(3), np.array([0.0, 0.4, 0.0]))
    held = Attachment("hollow", Mesh(tmp_path / "hollow.stl"), "tip", offset)
    X_WO = data.oMf[planar.model.getFrameId("tip")] * offset
    scene = Scene((Obstacle("dice", Mesh(tmp_path / "dice.stl"), X_WO),), (held,))
    proof = certify(CollisionModel(planar, scene), trajectory, VerifyPolicy())
    assert not proof.proved
    assert "inside" in proof.reason


def test_numbers_that_leave_no_digits_are_refused(planar):
    """A box of a million km leaves gaps of nanometres to rounding; so do polynomials whose huge terms cancel."""
    trajectory = quintic(planar.joint_names, [0.3, 0.4], [0.35, 0.45], 1.0)
    far = Obstacle("moon", Box((1e9, 1e9, 1e9)), pin.SE3(np.eye(3), np.array([0.0, 0.0, -5e8 - 1.0])))
    proof = certify(CollisionModel(planar, Scene((far,))), trajectory, VerifyPolicy())
    assert "'moon'" in proof.reason
    c = np.zeros((1, 9, 2))
    c[0, :6] = trajectory.coefficients[0]
    c[0, 3:, 0] += 1e6 * np.array([1.0, -5.0, 10.0, -10.0, 5.0, -1.0])  # 1e6 s^3 (1 - s)^5
    wild = type(trajectory)(trajectory.joint_names, trajectory.breakpoints, c)
    assert "no digits" in certify(CollisionModel(planar, Scene()), wild, VerifyPolicy()).reason


def test_a_half_space_that_moves_is_refused(planar):
    """Its points are infinitely far from the joints: nothing bounds how far they travel."""
    held = Attachment("wall", HalfSpace((0.0, 0.0, 1.0), -1.0), "tip", pin.SE3.Identity())
    ball = Obstacle("ball", Sphere(0.02), pin.SE3(np.eye(3), np.array([0.0, 2.0, 0.5])))
    trajectory = quintic(planar.joint_names, [0.3, 0.4], [0.4, 0.5], 1.0)
    proof = certify(CollisionModel(planar, Scene((ball,), (held,))), trajectory, VerifyPolicy())
    assert not proof.proved
    assert "'wall'" in proof.reason
    assert proof.queries == 0


def test_it_is_fast(panda):
    """A motion among twenty obstacles in a fraction of a second; measured 0.02 s on one slow core."""
    rng = np.random.default_rng(3)
    end = panda.configurations["ready"] + np.array([1.2, 0.3, 0.4, 0.5, -0.5, 0.4, 1.0])
    path = np.linspace(panda.configurations["ready"], end, 24)
    trajectory = within_limits(smooth(panda.joint_names, path, 1.0), panda.limits)
    model = CollisionModel(panda, random_scene(rng, 20, [0.3, -0.8, 0.9], [0.8, 0.0, 1.2]))
    began = time.process_time()
    proof = certify(model, trajectory, VerifyPolicy())
    assert proof.proved
    assert time.process_time() - began < 1.0


def test_many_questions_are_answered_in_portions(panda, monkeypatch):
    trajectory = quintic(panda.joint_names, panda.configurations["ready"], panda.configurations["ready"] + 0.3, 1.0)
    scene = Scene((Obstacle("ball", Sphere(0.05), pin.SE3(np.eye(3), np.array([0.3, 0.5, 0.6]))),))
    whole = certify(CollisionModel(panda, scene), trajectory, VerifyPolicy())
    monkeypatch.setattr("optiplan.verify.continuous.certificate.MOST_AT_ONCE", 10)
    portions = certify(CollisionModel(panda, scene), trajectory, VerifyPolicy())
    assert whole.proved
    assert portions.proved
    assert portions.nearest.pair == whole.nearest.pair


def test_hulls_asked_first_change_no_verdict(planar, tmp_path, monkeypatch):
    """With a plane between hulls the proof asks meshes less, finds the same, and claims no more than they allow."""
    sides = [trimesh.creation.box((0.4, 0.05, 0.1)), trimesh.creation.box((0.05, 0.4, 0.1))]
    sides[0].apply_translation((0.2, 0.0, 0.0))
    sides[1].apply_translation((0.0, 0.2, 0.0))
    trimesh.util.concatenate(sides).export(tmp_path / "angle.stl")
    angle = Obstacle("angle", Mesh(tmp_path / "angle.stl"), pin.SE3(np.eye(3), np.array([0.45, 0.1, 0.0])))
    model, verdicts, spared = CollisionModel(planar, Scene((angle,))), [], 0
    for seed in range(12):
        trajectory, proofs = random_motion(np.random.default_rng(seed), planar, 0.25), []
        for hulls in (5e-3, np.inf):
            monkeypatch.setattr("optiplan.verify.continuous.certificate._HULLS", hulls)
            proofs.append(certify(model, trajectory, VerifyPolicy()))
        first, exact = proofs
        assert (first.proved, first.contact) == (exact.proved, exact.contact)
        assert first.gjk_only <= exact.gjk_only
        if first.proved and first.nearest is not None:
            assert first.clearance <= sampled_clearance(model, trajectory, 200)
            assert first.nearest.distance >= first.clearance
            model.place(first.nearest.q)
            gaps = [model.pair_distance(pair).distance for pair in range(len(model.pairs))]
            assert first.nearest.distance >= min(gaps) - 1e-5
        spared += exact.gjk_only - first.gjk_only
        verdicts.append(first.proved)
    assert set(verdicts) == {True, False}
    assert spared > 0
