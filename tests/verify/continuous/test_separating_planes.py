"""What hulls of the parts of a mesh prove is no more than the distance of the mesh."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.geometry.shapes import Box, Sphere
from optiplan.robot.robot import Robot, load_robot
from optiplan.verify.continuous.bodies import Bodies
from optiplan.verify.continuous.separating_planes import PairDistances
from tests.geometry.horseshoe import horseshoe

YAML = """version: 1
name: horseshoe
urdf: robot.urdf
collision: mesh
"""
URDF = """<robot name="horseshoe"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="u.obj"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="9"/></joint></robot>"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    folder = tmp_path_factory.mktemp("horseshoe")
    points, triangles = horseshoe()
    lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    (folder / "u.obj").write_text("\n".join(lines))
    (folder / "robot.urdf").write_text(URDF)
    (folder / "robot.yaml").write_text(YAML)
    return load_robot(str(folder))


@pytest.fixture(scope="module")
def model(robot: Robot) -> CollisionModel:
    places = [(0.02, 0.1, 0.0), (0.1, 0.05, 0.02), (-0.1, 0.12, 0.0), (0.0, 0.2, 0.0), (0.5, 0.2, 0.1), (0.3, 0.0, 0.0)]
    shapes = [Box((0.05, 0.08, 0.04)), Sphere(0.03)] * 3
    poses = [pin.SE3(np.eye(3), np.array(place)) for place in places]
    found = [Obstacle(f"o{k}", *body) for k, body in enumerate(zip(shapes, poses, strict=True))]
    return CollisionModel(robot, Scene(tuple(found)))


def test_bounds_of_parts_are_below_the_distance_and_near_it(model: CollisionModel) -> None:
    """In the bend, where the hull of all says nothing."""
    bodies = Bodies(model)
    distances = PairDistances(model, bodies)
    Q = np.linspace(-1.5, 1.5, 9)[:, None]
    poses = bodies.kinematics.poses(Q)
    rows, pairs = np.repeat(np.arange(len(Q)), len(bodies.pairs)), np.tile(np.arange(len(bodies.pairs)), len(Q))
    placed = bodies.place(poses, rows, pairs)
    true = distances.query(pairs, placed).measured
    found = distances.query(pairs, placed, 5e-3)
    hulls = distances._between_hulls(pairs, placed)[1]
    assert (found.bound <= np.maximum(true, 0.0) + 1e-9).all()
    assert found.parts.sum() > 10
    assert (hulls[found.parts] <= 5e-3).all()
    assert (true - found.bound)[found.parts].max() < 0.03
    asked = ~found.hulls
    assert np.array_equal(found.measured[asked], true[asked])  # the rest is asked as ever


def test_pairs_asked_alone_have_the_bounds_that_they_have_together(model: CollisionModel) -> None:
    """Alone, a pair often has no second part that could be as near as the first."""
    bodies = Bodies(model)
    distances, chosen = PairDistances(model, bodies), []
    Q = np.linspace(-1.5, 1.5, 9)[:, None]
    rows, pairs = np.repeat(np.arange(len(Q)), len(bodies.pairs)), np.tile(np.arange(len(bodies.pairs)), len(Q))
    placed = bodies.place(bodies.kinematics.poses(Q), rows, pairs)
    ask = distances._to_chosen
    distances._to_chosen = lambda parts, placed, which, gap: (
        chosen.append(which.sum()) or ask(parts, placed, which, gap)
    )
    together = distances.query(pairs, placed, 5e-3)
    for k in range(len(pairs)):
        alone = distances.query(pairs[k : k + 1], placed.take(np.array([k])), 5e-3)
        assert alone.bound[0] == pytest.approx(together.bound[k], abs=1e-12)
    assert 0 in chosen


def test_no_pairs_have_no_support(model: CollisionModel) -> None:
    none = np.zeros(0, dtype=np.intp)
    assert Bodies(model).support(none, np.zeros((0, 4, 4)), np.zeros((0, 3))).shape == (0,)
