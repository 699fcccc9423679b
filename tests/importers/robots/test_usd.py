"""Robots in USD: the same as the URDF they were written from; what cannot be read is named with its prim."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.importers.robots.describe import describe
from optiplan.importers.robots.usd.joints import read_joints
from optiplan.importers.robots.usd.masses import filled_with_one
from optiplan.importers.robots.usd.shapes import shape_of
from optiplan.importers.robots.usd.stage import UsdStage
from optiplan.importers.robots.usd.tree import rigid_bodies
from optiplan.robot.frames import frame_pose
from tests.importers.robots.usd_stages import write_stage

URDF = """<robot name="arm">
  <link name="base"><collision><origin xyz="0 0 0.05"/><geometry><box size="0.2 0.16 0.1"/></geometry></collision>
    <inertial><mass value="4"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="upper"><collision><origin xyz="0.01 0 0.15" rpy="0.1 0.2 0.3"/>
      <geometry><cylinder radius="0.04" length="0.2"/></geometry></collision>
    <inertial><origin xyz="0.01 0.02 0.1" rpy="0.3 0.2 0.1"/><mass value="2"/>
      <inertia ixx="0.03" iyy="0.02" izz="0.01" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"><collision><origin xyz="0 0 0.15"/><geometry><box size="0.05 0.06 0.2"/></geometry></collision>
    <inertial><origin xyz="0 0 0.1"/><mass value="1"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="slider"><collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.03"/></geometry></collision>
    <inertial><mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tip"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.12" rpy="0 0 0.4"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2.5" velocity="3" effort="50"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0.02 0.3" rpy="0 0.2 0"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="2" velocity="2.5" effort="40"/></joint>
  <joint name="j3" type="prismatic"><parent link="fore"/><child link="slider"/><origin xyz="0 0 0.3"/>
    <axis xyz="0.6 0 0.8"/><limit lower="0.02" upper="0.3" velocity="0.5" effort="30"/></joint>
  <joint name="flange" type="fixed"><parent link="slider"/><child link="tip"/>
    <origin xyz="0 0 0.15" rpy="0.1 0 0"/></joint>
</robot>
"""


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """The robot of the URDF and that of the stage made of it."""
    folder = tmp_path_factory.mktemp("usd")
    (folder / "arm.urdf").write_text(URDF)
    stage = write_stage(folder / "arm.urdf", folder / "arm.usda")
    robots = [op.init_robot(folder / name, folder / name[-3:]) for name in ("arm.urdf", "arm.usda")]
    assert stage.exists()
    return robots


@pytest.mark.parametrize(
    ("metres", "y_up", "nested", "ending"), [(1.0, False, True, "usdc"), (0.01, True, False, "usd")]
)
def test_links_move_as_those_of_the_urdf(pair, tmp_path, metres, y_up, nested, ending):
    (tmp_path / "arm.urdf").write_text(URDF)
    theirs = pair[0]
    path = write_stage(tmp_path / "arm.urdf", tmp_path / f"arm.{ending}", metres, y_up, seed=3, nested=nested)
    ours = op.init_robot(path, tmp_path / "made")
    rng = np.random.default_rng(1)
    for _ in range(5):
        q = rng.uniform(theirs.limits.lower, theirs.limits.upper)
        for link in ("upper", "fore", "slider", "tip"):
            a, b = (frame_pose(robot, q, link) for robot in (theirs, ours))
            np.testing.assert_allclose(b.translation, a.translation, atol=1e-6)
            np.testing.assert_allclose(b.rotation, a.rotation, atol=1e-6)


def test_limits_and_masses_are_those_of_the_urdf(pair):
    theirs, ours = pair
    assert ours.joint_names == theirs.joint_names
    assert ours.tool_frame == theirs.tool_frame
    for key in ("lower", "upper", "velocity", "torque"):
        np.testing.assert_allclose(getattr(ours.limits, key), getattr(theirs.limits, key), rtol=1e-6)
    for a, b in zip(theirs.model.inertias, ours.model.inertias, strict=True):
        assert b.mass == pytest.approx(a.mass, rel=1e-6)
    q = np.array([0.3, 0.4, 0.1])
    torques = [pin.rnea(robot.model, robot.model.createData(), q, q, q) for robot in pair]
    np.testing.assert_allclose(torques[1], torques[0], rtol=1e-5)


def test_distances_are_those_of_the_urdf(pair):
    rng = np.random.default_rng(2)
    models = [CollisionModel(robot, op.Scene()) for robot in pair]
    for _ in range(10):
        q = rng.uniform(pair[0].limits.lower, pair[0].limits.upper)
        theirs, ours = (
            {frozenset((p.name_a, p.name_b)): m.distance(q, p.index).distance for p in m.pairs} for m in models
        )
        assert ours == pytest.approx(theirs, abs=1e-6)
        assert ours


@pytest.fixture
def stage(tmp_path):
    """An empty stage of centimetres, and its path."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "arm.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    return stage


def body(stage, path, height=0.0, size=10.0):
    """A cube of 10 cm as a rigid body."""
    prim = UsdGeom.Cube.Define(stage, path)
    prim.CreateSizeAttr(size)
    prim.AddTranslateOp().Set(Gf.Vec3d(0, 0, height))
    for api in (UsdPhysics.RigidBodyAPI, UsdPhysics.CollisionAPI):
        api.Apply(prim.GetPrim())
    return prim.GetPrim()


def hinge(stage, path, ends, kind=UsdPhysics.RevoluteJoint):
    joint = kind.Define(stage, path)
    for k, end in enumerate(ends):
        (joint.CreateBody0Rel, joint.CreateBody1Rel)[k]().SetTargets([Sdf.Path(end)] if end else [])
    return joint


def two(stage, kind=UsdPhysics.RevoluteJoint):
    """Two cubes 20 cm apart, and the joint between them."""
    body(stage, "/a")
    body(stage, "/b", 20.0)
    joint = hinge(stage, "/hinge", ["/a", "/b"], kind)
    joint.CreateLocalPos0Attr(Gf.Vec3f(0, 0, 10))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0, 0, -10))
    return joint


def described(stage):
    stage.GetRootLayer().Save()
    return describe(Path(stage.GetRootLayer().realPath))


def refused(stage, *words):
    with pytest.raises(op.InputError) as caught:
        described(stage)
    assert str(caught.value).startswith(stage.GetRootLayer().realPath)
    for word in words:
        assert word in str(caught.value)


def test_a_joint_that_a_robot_cannot_have_is_named(stage):
    two(stage, UsdPhysics.SphericalJoint)
    refused(stage, "/hinge: a joint that is spherical", "revolute")


def test_a_generic_joint_is_what_its_limits_leave_free(stage):
    joint = two(stage, UsdPhysics.Joint).GetPrim()
    for name in ("transX", "transY", "transZ", "rotX", "rotY"):
        limit = UsdPhysics.LimitAPI.Apply(joint, name)
        limit.CreateLowAttr(1.0)
        limit.CreateHighAttr(-1.0)
    free = UsdPhysics.LimitAPI.Apply(joint, "rotZ")
    free.CreateLowAttr(-90.0)
    free.CreateHighAttr(45.0)
    found = ET.fromstring(described(stage).text).find("joint[@name='hinge']")
    assert found.get("type") == "revolute"
    assert found.find("axis").get("xyz") == "0.0 0.0 1.0"
    assert float(found.find("limit").get("lower")) == pytest.approx(-np.pi / 2)
    joint.RemoveAPI(UsdPhysics.LimitAPI, "rotX")
    refused(stage, "/hinge", "2 free axes (rotX, rotZ)")


def test_limits_the_wrong_way_round_are_named(stage):
    joint = two(stage)
    joint.CreateLowerLimitAttr(10.0)
    joint.CreateUpperLimitAttr(-10.0)
    refused(stage, "/hinge.physics:lowerLimit: 10 above -10")


@pytest.mark.parametrize(("upper", "expected", "noted"), [(540.0, 3 * np.pi, False), (np.inf, 2 * np.pi, True)])
def test_only_a_missing_limit_is_replaced(stage, upper, expected, noted):
    joint = two(stage)
    joint.CreateLowerLimitAttr(-450.0)
    joint.CreateUpperLimitAttr(upper)
    joint.GetPrim().CreateAttribute("physxJoint:armature", Sdf.ValueTypeNames.Float).Set(0.1)
    found = described(stage)
    limit = ET.fromstring(found.text).find("joint[@name='hinge']/limit")
    assert float(limit.get("lower")) == pytest.approx(-2.5 * np.pi)
    assert float(limit.get("upper")) == pytest.approx(expected)
    assert ("/hinge has no limit at an end" in " ".join(found.notes)) == noted
    assert "left out, torques are without it: inertia of rotors (armature) of /hinge" in found.notes


def test_equal_limits_fix_a_joint_there(stage):
    joint = two(stage)
    joint.CreateLowerLimitAttr(90.0)
    joint.CreateUpperLimitAttr(90.0)
    refused(stage, "none of which moves")
    body(stage, "/c", 40.0)
    hinge(stage, "/second", ["/b", "/c"], UsdPhysics.PrismaticJoint)
    found = ET.fromstring(described(stage).text).find("joint[@name='hinge']")
    assert found.get("type") == "fixed"
    assert float(found.find("origin").get("rpy").split()[0]) == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(("kilograms", "expected"), [(None, 1.0), (0.3, 0.3)])  # 1 l of water; as stated
def test_a_body_weighs_what_is_stated_else_what_its_colliders_do(stage, kilograms, expected):
    two(stage)
    if kilograms is not None:
        UsdPhysics.MassAPI.Apply(stage.GetPrimAtPath("/b")).CreateMassAttr(kilograms)
    inertial = ET.fromstring(described(stage).text).find("link[@name='b']/inertial")
    assert float(inertial.find("mass").get("value")) == pytest.approx(expected, rel=1e-6)
    assert float(inertial.find("inertia").get("ixx")) == pytest.approx(expected * 0.1**2 / 6.0, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "factor", "offset"),
    [
        (UsdPhysics.RevoluteJoint, -2.0, -np.pi / 2),
        (UsdPhysics.PrismaticJoint, -0.02 * 180.0 / np.pi, -0.9),  # 2 cm and 90 cm, a degree of the leader
    ],
)
def test_what_is_not_driven_is_held_and_what_follows_follows(stage, kind, factor, offset):
    joint = two(stage)
    UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "angular").CreateMaxForceAttr(2e4)
    for name, height in (("/c", 40.0), ("/d", 60.0)):
        body(stage, name, height)
    follow(hinge(stage, "/follower", ["/b", "/c"], kind), "/hinge")
    hinge(stage, "/loose", ["/c", "/d"])
    read = described(stage)
    root = ET.fromstring(read.text)
    mimic = root.find("joint[@name='follower']/mimic")
    assert (mimic.get("joint"), float(mimic.get("multiplier"))) == ("hinge", pytest.approx(factor))
    assert float(mimic.get("offset")) == pytest.approx(offset)
    assert root.find("joint[@name='loose']").get("type") == "fixed"
    assert any("held where they are drawn" in note and "/loose" in note for note in read.notes)
    assert float(root.find("joint[@name='hinge']/limit").get("effort")) == pytest.approx(2.0)  # kg cm²/s² to N m


@pytest.mark.parametrize("leader", ["held", "locked"])
def test_what_follows_a_joint_that_stands_still_stands_still_where_it_is_put(stage, leader):
    UsdPhysics.DriveAPI.Apply(two(stage).GetPrim(), "angular").CreateMaxForceAttr(2e4)
    for name, height in (("/c", 40.0), ("/d", 60.0)):
        body(stage, name, height)
    first = hinge(stage, "/first", ["/b", "/c"])
    if leader == "locked":
        first.CreateLowerLimitAttr(30.0)
        first.CreateUpperLimitAttr(30.0)
    follow(hinge(stage, "/second", ["/c", "/d"]), "/first")
    read = described(stage)
    root = ET.fromstring(read.text)
    assert root.find("joint[@name='hinge']").get("type") != "fixed"
    second = root.find("joint[@name='second']")
    assert (second.get("type"), second.find("mimic")) == ("fixed", None)
    angle = -(90.0 + 2.0 * (30.0 if leader == "locked" else 0.0))
    turn = pin.rpy.rpyToMatrix(np.array(second.find("origin").get("rpy").split(), float))
    axis = pin.log3(turn) / np.linalg.norm(pin.log3(turn))
    np.testing.assert_allclose(turn, pin.exp3(np.radians(angle) * np.abs(axis)), atol=1e-6)
    assert "/second stands still with /first, which it follows" in read.notes


def follow(joint, leader):
    follower = joint.GetPrim()
    follower.SetMetadata("apiSchemas", Sdf.TokenListOp.Create(["PhysxMimicJointAPI:rotX"]))
    follower.CreateRelationship("physxMimicJoint:rotX:referenceJoint").SetTargets([Sdf.Path(leader)])
    follower.CreateAttribute("physxMimicJoint:rotX:gearing", Sdf.ValueTypeNames.Float).Set(2.0)
    follower.CreateAttribute("physxMimicJoint:rotX:offset", Sdf.ValueTypeNames.Float).Set(90.0)


def test_loops_floors_and_filtered_pairs(stage):
    two(stage)
    body(stage, "/c", 40.0)
    hinge(stage, "/next", ["/b", "/c"])
    hinge(stage, "/closing", ["/c", "/a"])
    UsdPhysics.FilteredPairsAPI.Apply(stage.GetPrimAtPath("/a")).CreateFilteredPairsRel().SetTargets([Sdf.Path("/c")])
    UsdPhysics.CollisionAPI.Apply(UsdGeom.Plane.Define(stage, "/floor").GetPrim())
    read = described(stage)
    assert read.allowed == (("a", "c"),)
    notes = " | ".join(read.notes)
    for words in ("closes a loop", "belong into the scene: /floor", "nothing holds /a"):
        assert words in notes


def test_several_robots_in_one_stage_are_refused(stage):
    two(stage)
    body(stage, "/c", 40.0)
    body(stage, "/d", 60.0)
    hinge(stage, "/second", ["/c", "/d"])
    refused(stage, "2 articulations, with /a; /c")


def test_a_layer_that_is_missing_is_named(stage):
    two(stage)
    stage.DefinePrim("/hand").GetReferences().AddReference("./gone.usda")
    refused(stage, "gone.usda", "/hand")


def test_a_file_that_is_no_usd_is_named_with_its_line(tmp_path):
    path = tmp_path / "bad.usda"
    path.write_text('#usda 1.0\ndef Xform "a" {\n  float x = \n}\n')
    with pytest.raises(op.InputError, match=rf"{path}:3: usd: Expected"):
        describe(path)
    with pytest.raises(op.InputError, match="no such file"):
        describe(tmp_path / "none.usd")


def test_without_its_package_it_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("optiplan.importers.robots.usd.stage.find_spec", lambda name: None)
    (tmp_path / "arm.usda").write_text("#usda 1.0\n")
    with pytest.raises(op.OptiPlanError, match=r"pip install 'optiplan\[usd\]'"):
        describe(tmp_path / "arm.usda")


WEDGE = [(0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 20)]


@pytest.mark.parametrize(
    ("kind", "scale", "expected", "volume"),
    [
        ("Cube", (1, 2, 3), "box", 8 * 6),
        ("Sphere", (2, 2, 2), "sphere", 32 / 3 * np.pi),
        ("Sphere", (1, 2, 1), "mesh", 8 / 3 * np.pi),
        ("Cylinder", (2, 2, 3), "cylinder", 24 * np.pi),
        ("Cylinder", (1, 2, 1), "mesh", 4 * np.pi),
        ("Capsule", (2, 2, 2), "capsule", 8 * np.pi * (0.25 + 4 / 3 * 0.125)),
        ("Capsule", (1, 1, 2), "mesh", 2 * np.pi * (0.25 + 4 / 3 * 0.125)),
        ("Cone", (1, 1, 1), "mesh", 2 / 3 * np.pi),
    ],
)
def test_scaled_shapes_hold_what_they_stand_for(tmp_path, kind, scale, expected, volume):
    stage = Usd.Stage.CreateNew(str(tmp_path / "shape.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    prim = getattr(UsdGeom, kind).Define(stage, "/shape")
    prim.AddRotateXYZOp().Set(Gf.Vec3f(10, 20, 30))
    prim.AddScaleOp().Set(Gf.Vec3f(*scale))
    stage.GetRootLayer().Save()
    opened = UsdStage(tmp_path / "shape.usda")
    shape = shape_of(opened, opened.stage.GetPrimAtPath("/shape"), pin.SE3.Identity(), True)
    assert shape.kind == expected
    found = filled_with_one(shape).mass / 1e-6
    assert 0.9999 * volume <= found <= 1.1 * volume  # polyhedra stand around


@pytest.mark.parametrize(
    ("approximation", "kind"),
    [("none", "mesh"), ("convexHull", "mesh"), ("boundingCube", "box"), ("boundingSphere", "sphere")],
)
def test_a_mesh_is_what_its_approximation_makes_of_it(stage, approximation, kind):
    mesh = UsdGeom.Mesh.Define(stage, "/wedge")
    mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in WEDGE])
    mesh.CreateFaceVertexCountsAttr([3, 3, 3, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
    UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(approximation)
    stage.GetRootLayer().Save()
    opened = UsdStage(Path(stage.GetRootLayer().realPath))
    shape = shape_of(opened, opened.stage.GetPrimAtPath("/wedge"), pin.SE3.Identity(), True)
    assert (shape.kind, shape.convex) == (kind, approximation == "convexHull")
    if kind == "mesh":
        assert filled_with_one(shape).mass == pytest.approx(10 * 10 * 20 / 6 * 1e-6)
        corners = shape.vertices[shape.triangles]
        volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
        assert volume == pytest.approx(10 * 10 * 20 / 6 * 1e-6)  # triangles look out
    elif kind == "box":
        assert shape.sizes == pytest.approx((0.1, 0.1, 0.2))
    else:
        assert shape.sizes[0] == pytest.approx(np.sqrt(0.05**2 + 0.05**2 + 0.1**2))
    mesh.CreateFaceVertexIndicesAttr([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 9])
    stage.GetRootLayer().Save()
    opened.stage.Reload()
    with pytest.raises(op.InputError, match="/wedge: a corner 9 of 4 points"):
        shape_of(opened, opened.stage.GetPrimAtPath("/wedge"), pin.SE3.Identity(), True)


@pytest.mark.filterwarnings("ignore:LoadUsdPhysicsFromRange:DeprecationWarning")
def test_joints_have_the_frames_that_pixar_reads(tmp_path):
    """Of `UsdPhysics.LoadUsdPhysicsFromRange`, in the units of the stage."""
    (tmp_path / "arm.urdf").write_text(URDF)
    path = write_stage(tmp_path / "arm.urdf", tmp_path / "arm.usda", 0.01, y_up=False)
    stage = UsdStage(path)
    places = {path: stage.placed(prim).pose() for path, prim in rigid_bodies(stage).items()}
    ours = {joint.path: joint for joint in read_joints(stage, places)}
    read = UsdPhysics.LoadUsdPhysicsFromRange(stage.stage, [Sdf.Path("/")])
    kinds = (UsdPhysics.ObjectType.RevoluteJoint, UsdPhysics.ObjectType.PrismaticJoint)
    seen = 0
    for paths, descriptions in (read[kind] for kind in kinds):
        for path, description in zip(paths, descriptions, strict=True):
            joint = ours[str(path)]
            assert joint.bodies == (str(description.body0), str(description.body1))
            X_0F, X_1F = joint.frames
            np.testing.assert_allclose(X_0F.translation * 100, description.localPose0Position, atol=1e-4)
            np.testing.assert_allclose(X_1F.translation * 100, description.localPose1Position, atol=1e-4)
            seen += 1
    assert seen == 3
