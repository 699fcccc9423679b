"""Hulls of many bodies on one joint: they save queries and change no answer."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan._core import variants
from optiplan.collision import native_model
from optiplan.collision.clusters import Clusters, clusters_of
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.geometry.scene import Box, Obstacle, Scene, Sphere
from optiplan.planners.common.continuous_collision import contacts_along
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.robot.robot import Robot
from optiplan.trajectory.timing.stops import stop_at_corners

pytestmark = pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")

FINGERS = 10


def link(name: str, boxes: list[tuple[float, float, float]]) -> str:
    bodies = "".join(
        f'<collision><origin xyz="{x} {y} {z}"/><geometry><box size=".03 .02 .1"/></geometry></collision>'
        for x, y, z in boxes
    )
    return f'<link name="{name}">{bodies}</link>'


def joint(name: str, parent: str, child: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 .3"/><axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="2" effort="90"/></joint>'
    )


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Robot:
    """Three joints; the last one carries a row of fingers on both sides."""
    fingers = [(0.04 * (k % 5) - 0.08, 0.1 if k < 5 else -0.1, 0.15) for k in range(FINGERS)]
    links = [link("base", []), link("one", [(0, 0, 0.15)]), link("two", [(0, 0, 0.15)]), link("hand", fingers)]
    joints = [joint("a", "base", "one", "0 0 1"), joint("b", "one", "two", "0 1 0"), joint("c", "two", "hand", "1 0 0")]
    path = tmp_path_factory.mktemp("robot") / "comb.urdf"
    path.write_text(f'<robot name="comb">{"".join(links + joints)}</robot>')
    return Robot.from_urdf(path, tool_frame="hand")


@pytest.fixture(scope="module")
def models(robot) -> tuple[NativeCollisionModel, NativeCollisionModel]:
    rng = np.random.default_rng(1)
    places = [pin.SE3(np.eye(3), np.array([0, 0, 0.6]) + rng.uniform(-0.6, 0.6, 3)) for _ in range(6)]
    shapes = [Box((0.1, 0.2, 0.1)), Sphere(0.08)] * 3
    scene = Scene(tuple(Obstacle(f"o{k}", s, X) for k, (s, X) in enumerate(zip(shapes, places, strict=True))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native_model, "clusters_of", lambda robot: Clusters((), ()))
        patch.setattr(native_model, "_clusters", native_model._clusters.__wrapped__)
        plain = NativeCollisionModel(robot, scene)
    return NativeCollisionModel(robot, scene), plain


def configurations(count: int) -> np.ndarray:
    return np.random.default_rng(2).uniform(-2.0, 2.0, (count, 3))


def test_the_fingers_are_one_cluster(robot) -> None:
    found = clusters_of(robot)
    (hand,) = found.by_joint
    assert [robot.link_of(k) for k in hand.bodies] == ["hand"] * FINGERS
    assert found.by_link == ()


def test_contacts_and_collisions_are_the_same(models) -> None:
    together, plain = models
    Q = configurations(200)
    found, expected = together.near(Q, 0.05), plain.near(Q, 0.05)
    assert len(expected.rows) > 100
    for name in ("rows", "pairs", "distance", "points", "normals"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))
    touching = [plain.collides(q) for q in Q]
    assert 10 < sum(touching) < 190
    assert [together.collides(q) for q in Q] == touching


def test_edges_and_motions_get_the_same_verdicts(models, robot) -> None:
    Q = configurations(120)
    checks = [MotionCheck(model, robot.limits) for model in models]
    verdicts = [
        [not check.blocked(a) and check.free(a, b) for a, b in zip(Q[::2], Q[1::2], strict=True)] for check in checks
    ]
    assert verdicts[0] == verdicts[1]
    assert 5 < sum(verdicts[0]) < 55
    for a, b in zip(Q[:40:2], Q[1:40:2], strict=True):
        motion = stop_at_corners(np.array([a, b]), robot.limits, robot.joint_names)
        free = [not list(contacts_along(model, motion, lambda: False)) for model in models]
        assert free[0] == free[1]
