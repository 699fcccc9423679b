"""The native core against the reference: the same answers about the same bodies."""

import re
import subprocess
import sys
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from optiplan._core import variants
from optiplan.cache import MostRecent
from optiplan.collision import native_model
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel, not_in_core, planning_model
from optiplan.geometry.scene import Attachment, Box, Capsule, Cylinder, HalfSpace, Mesh, Obstacle, Scene, Sphere
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Robot, load_robot

pytestmark = pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")

CUTOFF = 0.2
ATTACKS = Path(__file__).parents[1] / "attacks"


def scene(robot: Robot, tmp_path: Path) -> Scene:
    """Every kind of obstacle, a mesh and a half-space among them, and something held."""
    rng = np.random.default_rng(3)
    (tmp_path / "roof.obj").write_text("v 0 0 0\nv .4 0 0\nv 0 .4 0\nv 0 0 .4\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    shapes = [Box((0.2, 0.3, 0.1)), Sphere(0.15), Capsule(0.05, 0.4), Cylinder(0.1, 0.3), Mesh(tmp_path / "roof.obj")]
    obstacles = [
        Obstacle(
            f"o{k}", shape, pin.SE3(pin.exp3(rng.normal(size=3)), np.array([0, 0, 0.4]) + rng.uniform(-0.6, 0.6, 3))
        )
        for k, shape in enumerate(shapes)
    ]
    floor = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), -0.1), pin.SE3.Identity())
    held = Attachment("part", Box((0.05, 0.05, 0.2)), robot.tool_frame, pin.SE3(np.eye(3), np.array([0, 0, 0.2])))
    return Scene((*obstacles, floor), (held,))


@pytest.fixture(scope="module", params=["panda", "ur5", "delbot", str(ATTACKS / "mimic" / "problem.yaml")])
def models(request, tmp_path_factory) -> tuple[CollisionModel, NativeCollisionModel]:
    if request.param.endswith(".yaml"):
        from optiplan.problem.load import load_problem

        robot = load_problem(request.param).robot
    else:
        robot = load_robot(request.param)
    world = scene(robot, tmp_path_factory.mktemp("meshes"))
    native = planning_model(robot, world)
    assert isinstance(native, NativeCollisionModel)
    assert native.world is not None
    return CollisionModel(robot, world), native


def configurations(model: CollisionModel, count: int, seed: int = 0) -> np.ndarray:
    limits = model.robot.limits
    return np.random.default_rng(seed).uniform(
        np.maximum(limits.lower, -3.0), np.minimum(limits.upper, 3.0), (count, model.robot.n)
    )


def test_near_pairs_are_the_same(models) -> None:
    reference, native = models
    Q = configurations(reference, 40)
    expected, found = reference.near(Q, CUTOFF), native.near(Q, CUTOFF)
    old = {key: k for k, key in enumerate(zip(expected.rows.tolist(), expected.pairs.tolist(), strict=True))}
    new = {key: k for k, key in enumerate(zip(found.rows.tolist(), found.pairs.tolist(), strict=True))}
    assert len(old) > 10
    for key in old.keys() ^ new.keys():  # only what rounding takes over the edge
        contacts, at = (expected, old[key]) if key in old else (found, new[key])
        assert abs(contacts.distance[at] - CUTOFF) < 1e-5
    both = [(old[key], new[key]) for key in old.keys() & new.keys()]
    apart = [(i, k) for i, k in both if expected.distance[i] > 1e-4]
    assert len(apart) > 5
    for i, k in apart:
        assert found.distance[k] == pytest.approx(expected.distance[i], abs=2e-6)
        a, b = found.points[k]
        np.testing.assert_allclose(b - a, found.distance[k] * found.normals[k], atol=1e-8)
    for i, k in both:
        if expected.distance[i] < -1e-4:  # the way out may be another one, never a longer one
            assert expected.distance[i] - 1e-5 < found.distance[k] < 0.0


def test_gradients_equal_differences(models) -> None:
    _, native = models
    Q = configurations(native, 25, seed=1)
    contacts = native.near(Q, CUTOFF)
    slopes, step = native.gradients(Q, contacts), 1e-6
    errors = []
    apart = np.flatnonzero(contacts.distance >= 1e-3)
    for k in apart[:: 1 + len(apart) // 60]:
        row, pair = int(contacts.rows[k]), int(contacts.pairs[k])
        moved = np.repeat(Q[row][None], 2 * native.robot.n, axis=0) + step * np.vstack(
            [np.eye(native.robot.n), -np.eye(native.robot.n)]
        )
        again = native.near(moved, 2.0 * CUTOFF)
        distance = dict(zip(zip(again.rows.tolist(), again.pairs.tolist(), strict=True), again.distance, strict=True))
        values = np.array([distance[n, pair] for n in range(len(moved))])
        errors.append(np.abs((values[: native.robot.n] - values[native.robot.n :]) / (2 * step) - slopes[k]).max())
    assert len(errors) > 2
    assert np.median(errors) < 1e-6
    assert np.mean(np.array(errors) < 1e-3) > 0.9  # others are at a kink: parallel faces


def test_collisions_bounds_and_clearance_are_the_same(models) -> None:
    reference, native = models
    Q = configurations(reference, 60, seed=2)
    assert [reference.collides(q) for q in Q] == [native.collides(q) for q in Q]
    np.testing.assert_allclose(native.lower_bounds(Q), reference.lower_bounds(Q), atol=1e-9)
    D = np.random.default_rng(0).uniform(0.0, 0.1, Q.shape)
    expected, travel = reference.travel(Q, D), native.travel(Q, D)
    finite = np.isfinite(expected)
    assert (travel[finite] <= expected[finite] + 1e-12).all()  # the reference adds a micrometre an axis
    np.testing.assert_allclose(travel[finite], expected[finite], atol=1e-5)
    for q in Q[:10]:
        old, new = reference.clearance(q), native.clearance(q)
        assert old is not None
        assert new is not None
        if old.distance > 0.0:
            assert new.distance == pytest.approx(old.distance, abs=2e-6)
        else:
            assert new.distance <= 0.0


def test_poses_and_gravity_are_pinocchios(models) -> None:
    _, native = models
    robot, Q = native.robot, configurations(native, 10, seed=4)
    tree = native_tree(robot.model)
    np.testing.assert_allclose(tree.poses(Q), native.bounds.kinematics.poses(Q), atol=1e-12)
    gravity = Gravity(robot, np.full(robot.n, np.inf))
    np.testing.assert_allclose(np.abs(tree.gravity(Q)), [gravity.torque(q) for q in Q], atol=1e-9)


def test_a_segment_that_is_proved_free_touches_nothing(models) -> None:
    """And what the reference proves is proved by the core, for it asks no less precisely."""
    reference, native = models
    checks = MotionCheck(reference, reference.robot.limits), MotionCheck(native, native.robot.limits)
    assert checks[0].native is None
    assert checks[1].native is not None
    starts = [q for q in configurations(reference, 80, seed=5) if not reference.collides(q)]
    rng, free = np.random.default_rng(6), 0
    for a in starts:
        b = a + rng.normal(size=a.shape) * 0.15
        verdict = checks[1].free(a, b)
        free += verdict
        if verdict:
            assert not any(reference.collides(a + s * (b - a)) for s in np.linspace(0.0, 1.0, 60))
        elif checks[0].free(a, b):
            pytest.fail("proved by the reference alone")
    assert 0 < free


def test_configurations_asked_in_turn_get_the_answers_of_each_alone(models) -> None:
    _, native = models
    corners = configurations(native, 12, seed=11)
    Q = np.concatenate([a + np.linspace(0, 1, 40)[:, None] * (b - a) for a, b in pairwise(corners)])
    found, alone = native.near(Q, CUTOFF), [native.near(q[None], CUTOFF) for q in Q]
    assert found.pairs.tolist() == [pair for one in alone for pair in one.pairs.tolist()]
    distance = np.concatenate([one.distance for one in alone])
    assert (distance < 0).sum() > 10
    np.testing.assert_allclose(found.distance, distance, rtol=0, atol=1e-8)
    # Where it is farther apart than rounding tells, the normal is the direction between the nearest points of both.
    apart = distance > 1e-3
    normals = np.concatenate([one.normals for one in alone])[apart]
    along = np.einsum("ki,ki->k", found.normals[apart], normals)
    assert (along > 1.0 - 1e-6).mean() > 0.999


def test_all_builds_give_the_same_bits(models, monkeypatch) -> None:
    _, native = models
    Q, answers = configurations(native, 30, seed=7), []
    for variant in variants()[:-1]:
        built = import_module(f"optiplan._core._core_{variant}")
        for module in ("collision.native_model", "robot.native_tree"):
            monkeypatch.setattr(import_module(f"optiplan.{module}"), "core", built)
        monkeypatch.setattr(native_model, "_made", MostRecent(512))
        monkeypatch.setattr(native_model, "_links", {})
        for name in ("_link_shapes", "_clusters"):  # anew, by this build
            monkeypatch.setattr(native_model, name, once_for_each_robot(getattr(native_model, name).__wrapped__))
        world = planning_model(native.robot, native.scene)
        assert isinstance(world, NativeCollisionModel)
        assert world.world is not None
        answers.append([part.tobytes() for part in world.world.near(Q, CUTOFF)])
    assert all(answer == answers[0] for answer in answers)


def test_the_verifier_asks_only_its_own_part_of_the_core() -> None:
    """None of it is a planner's but `Shape`, which only proposes normals to `PlaneProof`."""
    own = {"PlaneProof", "ProvedShape", "Shape", "BoxClosing", "TorqueBounds"}
    chunks = {"MotionProof", "NearestChunk"}  # of `warm_proof`, whose verdict is of execution, not `verify`'s
    for path in (Path(__file__).parents[2] / "optiplan" / "verify").rglob("*.py"):
        asked = set(re.findall(r"\bcore\.([A-Z]\w+)", path.read_text()))
        assert asked <= (chunks if path.name == "warm_proof.py" else own), path
    code = "import sys, optiplan.verify.verify; print([name for name in sys.modules if name == 'optiplan.planners'])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout == "[]\n"


def test_bodies_that_the_core_does_not_know_are_named(monkeypatch) -> None:
    robot = load_robot("panda")
    obstacles = (Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.array([0.6, 0.0, 0.6]))),)
    assert not_in_core(planning_model(robot, Scene(obstacles))) == {}
    known = native_model.native_shape
    monkeypatch.setattr(
        native_model, "native_shape", lambda body: None if isinstance(body, coal.Sphere) else known(body)
    )
    model = planning_model(robot, Scene(obstacles))
    assert isinstance(model, NativeCollisionModel)
    assert model.world is None
    assert not_in_core(model) == {"not_in_core": ["ball"]}
    q = robot.configurations["ready"]
    assert model.collides(q) == CollisionModel(robot, Scene(obstacles)).collides(q)
