"""Pairs of hulls in the certificate: they save queries, and what they prove holds."""

import gc
import weakref
from collections.abc import Iterator
from unittest.mock import patch

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Box, HalfSpace, Obstacle, Scene, Sphere
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous import pair_tree
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.continuous.pair_tree import PairTree
from optiplan.verify.continuous.proof import Proof
from optiplan.verify.planes import search_state
from optiplan.verify.report import VerifyPolicy
from tests.verify.motions import smooth

FINGERS = 6


def bodies(name: str, boxes: list[tuple[float, float, float]]) -> str:
    shapes = "".join(
        f'<collision><origin xyz="{x} {y} {z}"/><geometry><box size=".03 .02 .1"/></geometry></collision>'
        for x, y, z in boxes
    )
    return f'<link name="{name}">{shapes}</link>'


def joint(name: str, parent: str, child: str, kind: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 .3"/><axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="2" effort="90"/></joint>'
    )


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Three joints; the last one carries two links, each with a row of fingers."""
    links = [bodies("base", []), bodies("one", [(0, 0, 0.15)]), bodies("two", [(0, 0, 0.15)])]
    for side, y, z in (("left", 0.1, -0.15), ("right", -0.1, 0.15)):
        links.append(bodies(side, [(0.04 * k - 0.1, y, z) for k in range(FINGERS)]))
    joints = [joint("a", "base", "one", "revolute", "0 0 1"), joint("b", "one", "two", "revolute", "0 1 0")]
    joints += [joint("c", "two", "right", "revolute", "1 0 0"), joint("d", "right", "left", "fixed", "1 0 0")]
    path = tmp_path_factory.mktemp("robot") / "combs.urdf"
    path.write_text(f'<robot name="combs">{"".join(links + joints)}</robot>')
    return Robot.from_urdf(path, tool_frame="right")


@pytest.fixture(scope="module")
def scene() -> Scene:
    rng = np.random.default_rng(1)
    places = [pin.SE3(np.eye(3), np.array([0, 0, 0.6]) + rng.uniform(-0.5, 0.5, 3)) for _ in range(6)]
    shapes = [Box((0.1, 0.2, 0.1)), Sphere(0.08)] * 3
    floor = Obstacle("floor", HalfSpace((0, 0, 1), -0.4), pin.SE3.Identity())
    return Scene((*(Obstacle(f"o{k}", s, X) for k, (s, X) in enumerate(zip(shapes, places, strict=True))), floor))


def motions(robot: Robot) -> Iterator[Trajectory]:
    rng = np.random.default_rng(3)
    for _ in range(40):
        yield smooth(
            robot.joint_names, rng.uniform(-1.5, 1.5, 3) + np.cumsum(rng.normal(size=(5, 3)) * 0.12, axis=0), 2.0
        )


def proofs(robot: Robot, scene: Scene) -> list[Proof]:
    model = CollisionModel(robot, scene)
    return [certify(model, motion, VerifyPolicy()) for motion in motions(robot)]


def test_every_pair_is_stood_for_once(robot, scene) -> None:
    model = CollisionModel(robot, scene)
    tree = PairTree(model)
    told = np.concatenate([tree.members(pair) for pair in tree.tops.tolist()])
    assert sorted(told.tolist()) == list(range(len(model.pairs)))
    assert len(tree.tops) < len(model.pairs) / 3 < len(tree.pairs)
    assert {len(tree.parts[top]) for top in tree.tops.tolist() if top >= tree.count} == {2}  # left and right


def test_verdicts_are_those_of_the_pairs_themselves(robot, scene) -> None:
    together = proofs(robot, scene)
    with patch.object(pair_tree, "_levels", lambda robot: ((), ())):
        plain = proofs(robot, scene)
    assert [proof.proved for proof in together] == [proof.proved for proof in plain]
    assert 5 < sum(proof.proved for proof in plain) < 35
    assert [proof.contact for proof in together] == [proof.contact for proof in plain]
    with patch.object(search_state, "plane_search", lambda *_: None):
        together = proofs(robot, scene)
        with patch.object(pair_tree, "_levels", lambda robot: ((), ())):
            plain = proofs(robot, scene)
    free = [(one, other) for one, other in zip(together, plain, strict=True) if one.proved]
    assert sum(one.queries for one, _ in free) < 0.6 * sum(other.queries for _, other in free)


def test_what_is_proved_and_recorded_holds(robot, scene) -> None:
    model = CollisionModel(robot, scene)
    for motion in motions(robot):
        record = ClearanceRecord()
        proof = certify(model, motion, VerifyPolicy(), record)
        if not proof.proved:
            continue
        least = min(
            found.distance for t in np.linspace(0, 2.0, 60) if (found := model.clearance(motion(np.array([t]))[0]))
        )
        assert proof.clearance <= least + 1e-9
        assert proof.nearest is None or proof.nearest.distance >= proof.clearance
        told = record.bound(motion.duration, len(model.pairs))
        assert told.clearance.min() == proof.clearance


def test_a_proof_among_moved_obstacles_is_that_of_a_new_model(robot, scene) -> None:
    known = CollisionModel(robot, scene)
    certify(known, next(motions(robot)), VerifyPolicy())
    changed = scene.moved("o0", x=0.07).moved("o3", z=-0.1).moved("floor", z=0.05)
    moved, new = known.with_obstacles_moved(changed), CollisionModel(robot, changed)
    assert moved is not None
    found = [[certify(model, motion, VerifyPolicy()) for motion in motions(robot)] for model in (moved, new)]
    assert len({proof.proved for proof in found[0]}) == 2
    for one, other in zip(*found, strict=True):
        assert [one.proved, one.reason, one.queries, one.clearance] == [
            other.proved,
            other.reason,
            other.queries,
            other.clearance,
        ]
        if one.nearest is not None:
            assert one.nearest.distance == other.nearest.distance
            assert one.nearest.pair == other.nearest.pair


def test_nothing_is_kept_of_a_work_space_that_is_gone(robot, scene) -> None:
    model = CollisionModel(robot, scene)
    certify(model, next(motions(robot)), VerifyPolicy())
    gone = weakref.ref(model)
    del model
    gc.collect()
    assert gone() is None
