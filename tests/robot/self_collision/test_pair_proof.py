"""The proof that pairs of links never meet, held against samples and against known geometry."""

import numpy as np
import pytest
from pair_samples import colliding, package_file, proved_pairs

from optiplan.robot.description_files import package_robots
from optiplan.robot.robot import load_robot, robot_names
from optiplan.robot.self_collision import pair_proof
from optiplan.robot.self_collision.pair_proof import BEYOND, GAP, PairProof, joint_box
from optiplan.robot.self_collision.pair_survey import link_pairs
from optiplan.robot.self_collision.pairs import ADJACENT, PROVED

PACKAGE = ("panda",)
"""Proved in seconds; `benchmarks/pair_samples.py` takes more of the package, arms and bodies with legs."""

COUNT = 6_000


@pytest.mark.parametrize("name", [*robot_names(), *(f"package/{robot}" for robot in PACKAGE)])
def test_no_unchecked_pair_collides_in_random_configurations(name, tmp_path):
    """Pairs proved apart, in 6,000 configurations; what the user declares, is fixed or always touches is aside."""
    if name.startswith("package/"):
        if not package_robots():
            pytest.skip("example-robot-data is not installed")
        name = package_file(tmp_path, name.partition("/")[2])
    robot = load_robot(name)
    proved = proved_pairs(robot)
    assert len(proved) or PROVED not in robot.allowed.values()
    assert colliding(robot, proved, COUNT) == 0
    always = [robot.survey.rates[pair] for pair, reason in robot.allowed.items() if reason == ADJACENT]
    assert min(always, default=1.0) > 0.9


@pytest.fixture(scope="module")
def panda():
    return load_robot("panda")


def proof_of(robot, pairs):
    return PairProof(robot.model, robot.geometry, np.array(pairs), (robot.limits.lower, robot.limits.upper))


def test_steps_bound_what_joints_do_to_a_distance(panda):
    """Also in boxes of more than half a turn, where only the chord of the arc is moved."""
    rng = np.random.default_rng(4)
    pairs = np.array([(a, b) for a in range(4) for b in range(5, 9)])
    proof = proof_of(panda, pairs)
    index = np.arange(len(pairs))
    for size in (0.1, 0.5, 2.0, 3.5):
        Q = rng.uniform(panda.limits.lower, panda.limits.upper, (len(pairs), panda.n))
        D = rng.uniform(0.0, size, Q.shape)
        poses, placed = proof.bounds.place(Q, index)
        travel = proof.bounds.steps_of(poses, placed, D, index).sum(axis=1)
        before = proof.distances(placed, index, np.full(len(index), np.inf))
        for _ in range(20):
            after = proof.distances(
                proof.bounds.place(Q + rng.uniform(-D, D), index)[1], index, np.full(len(index), np.inf)
            )
            apart = (before > 0.0) & (after > 0.0)
            assert (np.abs(after - before)[apart] <= travel[apart] + 1e-6).all()


def test_a_proof_needs_the_limits(panda):
    """The wrist of the Panda keeps clear of its upper arm because of limits: without them it is no longer proved."""
    bodies = link_pairs(panda.model, panda.geometry)[("panda_link2", "panda_link4")]
    group = [np.arange(len(bodies))]
    assert proof_of(panda, bodies).prove(group) == [True]
    wide = PairProof(panda.model, panda.geometry, np.array(bodies), (np.full(7, -np.inf), np.full(7, np.inf)))
    assert wide.prove(group) == [False]


def test_groups_are_proved_alone_as_among_others(panda, monkeypatch):
    """Those that may have no more boxes are given up at the first open one, whatever is looked at beside them."""
    monkeypatch.setattr(pair_proof, "BOXES", 300)
    monkeypatch.setattr(pair_proof, "CHUNK", 64)
    found = link_pairs(panda.model, panda.geometry)
    links = [pair for pair in found if pair[0] in ("panda_link0", "panda_link2")]
    groups = np.split(np.arange(sum(len(found[pair]) for pair in links)), np.cumsum([len(found[p]) for p in links]))
    proof = proof_of(panda, [bodies for pair in links for bodies in found[pair]])
    together = proof.prove(groups[:-1])
    assert 0 < sum(together) < len(together)
    assert together == [proof.prove([group])[0] for group in groups[:-1]]


def test_the_joint_box():
    turns = np.array([True, True, True, False, False])
    lower = np.array([-1.0, -np.inf, -7.0, -0.5, -np.inf])
    upper = np.array([2.0, np.inf, 7.0, 0.5, 3.0])
    middle, half = joint_box(turns, lower, upper)
    np.testing.assert_allclose(middle, [0.5, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(half, [1.5 + BEYOND, np.pi, np.pi, 0.5 + BEYOND, np.inf])


def test_meshes_touch_where_their_distance_says_so(tmp_path):
    """The survey asks only whether triangles are as near as `GAP`, which is the same answer for less work."""
    if "z1" not in package_robots():
        pytest.skip("example-robot-data is not installed")
    source = "{package: example-robot-data, robot: z1}"
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: r\nurdf: {source}\ncollision: mesh\n")
    robot = load_robot(str(tmp_path / "robot.yaml"))
    pairs = [pair for bodies in link_pairs(robot.model, robot.geometry).values() for pair in bodies]
    proof = proof_of(robot, pairs)
    half = np.where(np.isfinite(proof.half), proof.half, 1.0)
    Q = proof.middle + half * np.random.default_rng(5).uniform(-1.0, 1.0, (3, robot.n))
    _, asked, placed = proof.bounds.meeting(Q, GAP)
    near = proof.distances(placed, asked, np.full(len(asked), GAP)) <= GAP
    assert 0 < near.sum() < len(near)
    assert (proof.touching(placed, asked) == near).all()
