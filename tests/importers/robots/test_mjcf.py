"""Robots of MuJoCo: the URDF moves as MuJoCo's own model does, and says what it left out."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.importers.robots.describe import describe
from optiplan.importers.robots.polyhedra import ellipsoid_hull
from optiplan.robot.urdf.reader import build_model, read_urdf

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco model="small arm">
  <compiler angle="radian" autolimits="true"/>
  <default><default class="seen"><geom contype="0" conaffinity="0" group="2"/></default></default>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.2"/>
    <mesh name="gone" file="gone.obj"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="base" pos="0.1 0 0.2" euler="0 0 0.3">
      <geom type="cylinder" size="0.05 0.1"/>
      <body name="upper" pos="0 0 0.1">
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/>
        <joint name="shoulder" axis="0 1 0" pos="0.02 0 0.01" range="-2 2" ref="0.3"/>
        <joint name="lift" type="slide" axis="0 0 1" range="0 0.2"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.03"/>
        <geom class="seen" type="mesh" mesh="gone"/>
        <body name="fore" pos="0 0 0.25">
          <joint name="fore" axis="1 0 0"/>
          <geom type="mesh" mesh="wedge" pos="0.01 0.02 0.03" euler="0.1 0.2 0.3"/>
          <site name="attachment_site" pos="0 0 0.2"/>
          <body name="left" pos="0 0.02 0.2">
            <joint name="left_finger" type="slide" axis="0 1 0" range="0 0.04"/>
            <geom type="box" size="0.01 0.01 0.02"/>
          </body>
          <body name="right" pos="0 -0.02 0.2">
            <joint name="right_finger" type="slide" axis="0 1 0" range="-0.04 0"/>
            <geom type="ellipsoid" size="0.01 0.02 0.03"/>
          </body>
          <body name="flap" pos="0.05 0 0.1"><joint name="flap" axis="0 1 0" ref="0.2"/><geom size="0.01"/></body>
        </body>
      </body>
    </body>
    <body name="cube" pos="1 0 0"><freejoint name="loose"/><geom type="box" size="0.1 0.1 0.1"/></body>
  </worldbody>
  <contact><exclude body1="base" body2="fore"/></contact>
  <equality><joint joint1="right_finger" joint2="left_finger" polycoef="0.001 -1 0 0 0"/></equality>
  <actuator>
    <position joint="shoulder" forcerange="-20 30"/><position joint="lift"/><motor joint="fore"/>
    <position joint="left_finger"/>
  </actuator>
  <keyframe><key name="home" qpos="0.5 0.1 0.2 0.02 -0.019 0.2 1 0 0 1 0 0 0"/></keyframe>
</mujoco>
"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("mjcf") / "arm.xml"
    path.write_text(ARM)
    return path


@pytest.fixture(scope="module")
def robot(arm):
    return op.init_robot(arm, arm.parent / "made")


def test_bodies_move_as_in_mujoco(arm, robot):
    urdf = read_urdf(robot.source.parent / "robot.urdf", robot.source.parent)
    model = build_model(urdf)
    data = model.createData()
    spec = mujoco.MjSpec.from_file(str(arm))
    spec.delete(next(geom for geom in spec.geoms if geom.meshname == "gone"))
    spec.delete(spec.mesh("gone"))
    theirs = spec.compile()
    state = mujoco.MjData(theirs)
    rng = np.random.default_rng(0)
    for _ in range(4):
        values = dict(
            zip(("shoulder", "lift", "fore", "left_finger"), rng.uniform(0.0, [1.5, 0.2, 3.0, 0.04]), strict=True)
        )
        values["right_finger"] = 0.001 - values["left_finger"]
        q = pin.neutral(model)
        for name, value in values.items():
            q[model.joints[model.getJointId(name)].idx_q] = value
            state.qpos[theirs.joint(name).qposadr[0]] = value
        pin.framesForwardKinematics(model, data, q)
        mujoco.mj_kinematics(theirs, state)
        for body, link in [("upper", "upper"), ("fore", "fore_link"), ("left", "left"), ("right", "right")]:
            ours = data.oMf[model.getFrameId(link)]
            np.testing.assert_allclose(ours.translation, state.body(body).xpos, atol=1e-12)
            np.testing.assert_allclose(ours.rotation.ravel(), state.body(body).xmat, atol=1e-12)
        site = data.oMf[model.getFrameId("attachment_site")]
        np.testing.assert_allclose(site.translation, state.site("attachment_site").xpos, atol=1e-12)


def test_the_robot_has_what_the_file_says(robot):
    assert robot.joint_names == ("shoulder", "lift", "fore")
    assert robot.tool_frame == "attachment_site"
    assert robot.limits.torque[0] == 20.0
    assert np.isinf(robot.limits.lower[2])
    np.testing.assert_array_equal(robot.configurations["home"], [0.5, 0.1, 0.2])
    assert robot.locked["left_finger"] == 0.02  # where the keyframe has it
    assert robot.locked["right_finger"] == pytest.approx(0.001 - 0.02)
    assert ("base", "fore_link") in robot.allowed
    assert robot.model.inertias[1].mass == 0.0  # the link between the two joints of one body
    assert robot.model.inertias[2].mass == pytest.approx(1.0)


def test_what_is_left_out_is_said(arm):
    notes = " | ".join(describe(arm).notes)
    for words in ("plane of world", "visual mesh gone.obj", "free joint loose", "flap, which no actuator drives"):
        assert words in notes


@pytest.mark.parametrize(("stated", "name"), [("", "m"), ('model="my arm"', "my_arm")])
def test_a_comment_with_dashes_is_one_for_mujoco(tmp_path, stated, name):
    body = '<worldbody><body><joint/><geom size="0.1"/></body></worldbody>'
    (tmp_path / "m.xml").write_text(f"<mujoco {stated}><!-- ------ arm ------ -->{body}</mujoco>")
    assert describe(tmp_path / "m.xml").name == name


def test_the_hull_of_a_mesh_is_where_mujoco_has_it(robot):
    (body,) = [item for item in robot.geometry.geometryObjects if item.name.startswith("fore_link")]
    body.geometry.computeLocalAABB()
    model = mujoco.MjModel.from_xml_string(
        ARM.replace('<geom class="seen" type="mesh" mesh="gone"/>', "").replace(
            '<mesh name="gone" file="gone.obj"/>', ""
        )
    )
    geom = next(k for k in range(model.ngeom) if model.geom_type[k] == int(mujoco.mjtGeom.mjGEOM_MESH))
    points = model.mesh_vert @ pin.Quaternion(*model.geom_quat[geom]).matrix().T + model.geom_pos[geom]
    ours = np.array([body.placement.act(point) for point in body.geometry.points()])
    frame = robot.model.frames[robot.model.getFrameId("fore_link")].placement
    np.testing.assert_allclose(
        np.sort(ours, axis=0), np.sort([frame.act(p) for p in points.astype(float)], axis=0), atol=1e-6
    )


def test_a_polyhedron_holds_the_ellipsoid():
    vertices, triangles = ellipsoid_hull(1.0, 2.0, 3.0)
    a, b, c = (vertices[triangles[:, k]] / [1.0, 2.0, 3.0] for k in range(3))
    normals = np.cross(b - a, c - a)
    distances = np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)
    assert distances.min() == pytest.approx(1.0)
    assert np.linalg.norm(vertices / [1.0, 2.0, 3.0], axis=1).max() < 1.032


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('class="seen" type="mesh"', 'type="mesh"', "the collision mesh gone.obj of body upper"),
        ('<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/>', "", "of body upper and its mass"),
        ('range="-2 2"', 'range="-2"', ":14: mjcf: "),
        ("<worldbody>", "<worldbody", "mjcf"),
        (
            'type="box" size="0.1 0.1 0.1"',
            'type="box" size="0.1 inf 0.1"',
            "an inertia of body cube that is not finite",
        ),
    ],
)
def test_bad_files_are_named(arm, tmp_path, old, new, words):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace(old, new))
    with pytest.raises(op.InputError, match=r"arm\.xml") as caught:
        describe(path)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("table", "moving"), [("", ""), ('<geom type="box" size="1 1 0.1" pos="0 0 -1"/>', "that moves ")]
)
def test_hidden_geoms_are_the_bodies_where_none_can_touch(tmp_path, table, moving):
    path = tmp_path / "ghost.xml"
    table = table and table.replace("/>", ' contype="1" conaffinity="1"/>')
    path.write_text(f"""<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>{table}
        <body name="a"><joint/><geom size="0.1" group="2"/><geom size="0.2" group="3"/>
        <body name="b"><joint/><geom size="0.1" group="2"/></body></body></worldbody></mujoco>""")
    described = describe(path)
    assert described.text.count("<collision>") == (2 if table else 1)
    assert 'radius="0.2"' in described.text[described.text.rindex("<collision>") :]
    notes = " | ".join(described.notes)
    assert f"no geom {moving}can touch another in the file: those that are not drawn are taken as bodies" in notes
    assert "only drawn, since no geom of them can touch another: b" in notes


@pytest.mark.parametrize(("first", "second"), [("a", "b"), ("b", "a")])
def test_a_leader_carries_its_follower(tmp_path, first, second):
    path = tmp_path / "chain.xml"
    path.write_text(f"""<mujoco><worldbody><body><joint name="a" range="-1 1" limited="true"/><geom size="0.1"/>
        <body pos="1 0 0"><joint name="b" range="-1 1" limited="true"/><geom size="0.1"/></body></body></worldbody>
        <equality><joint joint1="{first}" joint2="{second}" polycoef="0 2 0 0 0"/></equality>
        <actuator><motor joint="b"/></actuator></mujoco>""")
    urdf = read_urdf(Path("chain.urdf"), tmp_path, describe(path).text)
    assert {name: (mimic.source, mimic.multiplier) for name, mimic in urdf.mimics.items()} == {
        "b": ("a", 0.5 if first == "a" else 2.0)
    }


@pytest.mark.parametrize(
    ("drive", "torque", "noted"),
    [
        ('<motor joint="j" ctrlrange="-200 200" gear="0.5"/>', 100.0, False),
        ('<motor joint="j" ctrlrange="-200 200" forcerange="-50 60"/>', 50.0, False),
        ('<general joint="j" gainprm="3" ctrlrange="-2 2"/>', 6.0, False),
        ('<position joint="j" ctrlrange="-2 2"/>', 0.0, False),
        ('<position joint="j" forcerange="0 50" gear="2"/>', 100.0, True),
        ('<motor joint="j"/>', 0.0, False),
    ],
)
def test_a_drive_limits_the_torque_of_its_joint(tmp_path, drive, torque, noted):
    path = tmp_path / "one.xml"
    joint = '<joint name="j" axis="0 1 0" armature="0.1" frictionloss="2" stiffness="3"/>'
    path.write_text(f"""<mujoco><worldbody><body>{joint}<geom size="0.1"/></body></worldbody>
        <actuator>{drive}</actuator></mujoco>""")
    described, notes = describe(path), " | ".join(describe(path).notes)
    assert read_urdf(Path("one.urdf"), tmp_path, described.text).limit("j", "effort") == pytest.approx(torque)
    assert ("j is driven one way only" in notes) == noted
    for kind in (
        "inertia of rotors (armature) of j",
        "friction (damping, frictionloss) of j",
        "springs (stiffness) of j",
    ):
        assert kind in notes


def test_links_that_overlap_as_drawn_go_unchecked_where_mujoco_lets_them(tmp_path):
    path = tmp_path / "row.xml"
    ball = '<geom size="0.1" {}/>'
    path.write_text(f"""<mujoco><worldbody><body name="a"><joint axis="0 1 0"/>{ball.format("")}
        <body name="b" pos="0.05 0 0"><joint axis="0 1 0"/>{ball.format("")}
        <body name="c" pos="0.5 0 0"><joint axis="0 1 0"/>{ball.format("")}</body></body></body>
        <body name="d" pos="0 0.05 0"><joint axis="0 1 0"/>{ball.format('contype="2" conaffinity="2"')}</body>
        <body name="e" pos="0 -0.05 0"><joint axis="0 1 0"/>{ball.format("")}</body></worldbody></mujoco>""")
    described = describe(path)
    assert set(described.allowed) == {("a", "b"), ("a", "d"), ("b", "d"), ("d", "e")}
    assert "overlap as drawn" in " ".join(described.notes)


@pytest.mark.parametrize("contact", ["", '<pair geom1="ball" geom2="pedestal"/>'])
def test_links_of_which_some_geoms_touch_in_mujoco_are_checked(tmp_path, contact):
    other = "" if contact else '<geom size="0.1" pos="1 0 0"/>'
    path = tmp_path / "pedestal.xml"
    path.write_text(f"""<mujoco><worldbody><geom name="pedestal" type="box" size="0.1 0.1 0.1"/>
        <body name="l1"><joint/><geom name="ball" size="0.1" contype="2" conaffinity="2"/>{other}</body></worldbody>
        <contact>{contact}</contact></mujoco>""")
    assert describe(path).allowed == ()


@pytest.mark.parametrize(
    ("equality", "actuator", "words", "moving"),
    [
        ('<joint joint1="b" joint2="a" polycoef="0 1 1 0 0"/>', '<motor joint="a"/>', "by a polynomial", {"a"}),
        ('<joint joint1="a" joint2="b" polycoef="0 2 0 0 0"/>', '<motor joint="a"/>', "", {"a"}),
        ("", '<motor tendon="both"/>', "share the drive of tendon both", set()),
        ('<tendon tendon1="both"/>', '<motor tendon="both"/>', "", {"b"}),
    ],
)
def test_couplings(tmp_path, equality, actuator, words, moving):
    path = tmp_path / "pair.xml"
    path.write_text(f"""<mujoco><worldbody>
        <body name="x"><joint name="a" axis="0 1 0" range="-1 1"/><geom size="0.1"/></body>
        <body name="y" pos="1 0 0"><joint name="b" axis="0 1 0" range="-1 1"/><geom size="0.1"/></body></worldbody>
        <tendon><fixed name="both"><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed></tendon>
        <equality>{equality}</equality><actuator>{actuator}</actuator></mujoco>""")
    described = describe(path)
    urdf = read_urdf(Path("pair.urdf"), tmp_path, described.text)
    moves = {name for name, kind in urdf.joint_types.items() if kind != "fixed"}
    assert moves - set(urdf.mimics) == moving
    assert words in " ".join(described.notes)
    if len(moves) == 2:
        ((follower, mimic),) = urdf.mimics.items()
        expected = {("a", "b"): -2.0, ("b", "a"): 0.5}[follower, mimic.source]
        assert mimic.multiplier == pytest.approx(expected)


def test_keyframes_are_moved_into_limits_where_rounding_took_them_out_and_else_named(tmp_path):
    joint = '<joint name="{0}" axis="0 1 0" range="-1 1" limited="true"/><geom size="0.1"/>'
    chain = f'<body>{joint.format("a")}<body pos="1 0 0">{joint.format("b")}</body></body>'
    keys = '<key name="near" qpos="1.0005 0"/><key name="far" qpos="0 1.2"/>'
    (tmp_path / "two.xml").write_text(
        f'<mujoco><compiler angle="radian"/><worldbody>{chain}</worldbody><keyframe>{keys}</keyframe></mujoco>'
    )
    robot = op.init_robot(tmp_path / "two.xml", tmp_path / "made")
    assert {name: q.tolist() for name, q in robot.configurations.items()} == {"near": [1.0, 0.0]}
    head = (tmp_path / "made/robot.yaml").read_text()
    assert "# configuration near has a beyond limits by rounding: moved to the limit" in head
    assert "# left out: configuration far, in which b is beyond its limits" in head
