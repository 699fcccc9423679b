"""Neighbours that pass each other a hair apart wherever their joint stands are left to the verifier."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from optiplan._core import core, variants
from optiplan.collision.floors import with_built
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel, planning_model
from optiplan.collision.passing_neighbours import passing_neighbours
from optiplan.control.limits.clearance import ClearanceLimit
from optiplan.geometry.safety import Safety
from optiplan.geometry.scene import Obstacle, Scene, Sphere
from optiplan.robot.robot import Robot, load_robot

GAP = 2e-4
"""m, between the two discs of the robot."""

ROBOT = """<robot name="discs"><link name="base"><collision><geometry><mesh filename="base.obj"/></geometry></collision>
</link><link name="disc"><collision><geometry><mesh filename="disc.obj"/></geometry></collision></link>
<link name="tip"><collision><origin xyz="0.3 0 0"/><geometry><box size="0.4 0.02 0.02"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="2" effort="9"/></joint>
<joint name="lift" type="revolute"><origin xyz="0 0 0.05"/><parent link="disc"/><child link="tip"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="0.1" velocity="2" effort="9"/></joint></robot>"""

STOP = (0.065 * np.cos(1.0), 0.065 * np.sin(1.0), 0.01)
"""m: where the disc's arm meets a stop of the base, around 1 rad of the first joint."""

BALL = Obstacle("ball", Sphere(0.12), pin.SE3(np.eye(3), np.array([0.0, -0.35, 0.2])))

MIDDLE = np.array([0.0, -0.5])


def box(size: tuple[float, float, float], at: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


def robot_in(folder: Path, stop: bool = False, treatment: str = "mesh", gap: float = GAP) -> Robot:
    """A disc with an arm that turns above another one, which may have a stop; and a tip that is lifted."""
    disc = trimesh.creation.cylinder(0.05, 0.02, sections=16)
    base = [disc.copy().apply_translation((0.0, 0.0, -0.01 - gap))] + [box((0.01, 0.01, 0.04), STOP)] * stop
    arm = box((0.05, 0.01, 0.01), (0.05, 0.0, 0.012))
    trimesh.util.concatenate(base).export(folder / "base.obj")
    trimesh.util.concatenate([disc.copy().apply_translation((0.0, 0.0, 0.01)), arm]).export(folder / "disc.obj")
    (folder / "robot.urdf").write_text(ROBOT)
    (folder / "robot.yaml").write_text(f"version: 1\nname: discs\nurdf: robot.urdf\ncollision: {treatment}\n")
    return load_robot(str(folder))


def names(robot: Robot) -> set[tuple[str, str]]:
    return {(robot.link_of(a), robot.link_of(b)) for a, b in passing_neighbours(robot)}


def near(model: CollisionModel, Q: np.ndarray) -> set[tuple[str, str]]:
    return {(model.pairs[k].name_a, model.pairs[k].name_b) for k in model.near(Q, 0.02).pairs}


def places(robot: Robot) -> np.ndarray:
    return np.random.default_rng(0).uniform(robot.limits.lower, robot.limits.upper, (50, robot.n))


def test_only_pairs_that_are_apart_at_all_places_are_passing(tmp_path: Path) -> None:
    (tmp_path / "free").mkdir()
    (tmp_path / "stopped").mkdir()
    assert names(robot_in(tmp_path / "free")) == {("base", "disc")}
    assert names(robot_in(tmp_path / "stopped", stop=True)) == set()


def test_convex_bodies_and_robots_that_are_held_are_asked_as_ever(tmp_path: Path) -> None:
    (tmp_path / "held").mkdir()
    (tmp_path / "hull").mkdir()
    assert names(robot_in(tmp_path / "held").holding({"lift": -0.5})) == set()
    assert names(robot_in(tmp_path / "hull", treatment="hull")) == set()


@pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")
def test_a_planners_world_does_not_ask_them(tmp_path: Path) -> None:
    robot, scene = robot_in(tmp_path), Scene((BALL,))
    reference, planners = CollisionModel(robot, scene), planning_model(robot, scene)
    Q = places(robot)
    assert near(reference, Q) - near(planners, Q) == {("base", "disc")}
    assert near(planning_model(robot, scene, passing=True), Q) == near(reference, Q)
    assert planners.pairs == reference.pairs
    found = planners.clearance(MIDDLE)  # the nearest pair of all is still told
    assert found is not None
    assert (found.pair.name_a, found.pair.name_b) == ("base", "disc")
    assert [planners.collides(q) for q in Q] == [reference.collides(q) for q in Q]


@pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")
def test_convex_neighbours_are_asked_only_where_a_clearance_is_required(tmp_path: Path) -> None:
    """They never touch, but may come nearer than a floor; these are so near that the survey does not prove them."""
    robot = robot_in(tmp_path, treatment="hull", gap=1.05e-4)
    Q, pair = places(robot), ("base", "disc")
    assert pair in near(CollisionModel(robot, Scene((BALL,))), Q)
    assert pair not in near(planning_model(robot, Scene((BALL,))), Q)
    assert pair in near(planning_model(robot, Scene((BALL,)), passing=True), Q)
    assert pair in near(planning_model(robot, Scene((BALL,), safety=Safety(0.001))), Q)


@pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")
def test_a_pair_that_meets_a_stop_is_asked(tmp_path: Path) -> None:
    robot = robot_in(tmp_path, stop=True)
    planners = planning_model(robot, Scene())
    assert planners.collides(np.array([1.0, -0.5]))
    assert not planners.collides(np.array([-1.0, -0.5]))
    assert ("base", "disc") in near(planners, MIDDLE[None])


@pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")
def test_a_world_counts_no_contact_of_pairs_that_it_never_asks(tmp_path: Path) -> None:
    """Also where the pair is the first, which is asked before the others."""
    from optiplan.collision.native_model import _links_of
    from optiplan.robot.native_tree import native_tree

    robot = robot_in(tmp_path, stop=True)
    model = planning_model(robot, Scene())
    assert isinstance(model, NativeCollisionModel)
    pairs, touching = model.bounds.pairs.astype(np.int64), np.array([1.0, -0.5])
    given = native_tree(model.model), _links_of(model), pairs
    assert core.World.of(*given).collides(touching)
    left_out = next(k for k, p in enumerate(model.pairs) if (p.name_a, p.name_b) == ("base", "disc"))
    world = core.World.of(*given, never=[left_out])
    assert not world.collides(touching)
    assert left_out not in world.near(touching[None], 0.02)[1].tolist()
    assert not core.World.of(*given, never=list(range(len(pairs)))).collides(touching)
    with pytest.raises(ValueError, match="never asked"):
        core.World.of(*given, never=[len(pairs)])


def test_controllers_keep_what_the_structure_allows(tmp_path: Path) -> None:
    limit = ClearanceLimit(Scene(), at_least=0.005)
    limit.bind(robot_in(tmp_path))
    assert list(limit.structure) == ["base and disc"]
    assert limit.structure["base and disc"] == pytest.approx(GAP, rel=0.51)


@pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")
def test_what_is_built_nearer_is_left_out_where_a_clearance_is_required(tmp_path: Path) -> None:
    """Edges were cut into thousands of parts, by the hair between the discs and their floor."""
    robot = robot_in(tmp_path, treatment="hull", gap=1.05e-4)
    Q = places(robot)
    for clearance, left_out in ((0.005, True), (5e-5, False)):  # of the second the discs keep all
        scene = Scene([BALL], safety=with_built(Safety(clearance, own=clearance), robot))
        model = planning_model(robot, scene)
        assert (("base", "disc") not in near(model, Q)) == left_out
        assert ("base", "disc") in near(CollisionModel(robot, scene), Q)
