import os
import xml.etree.ElementTree as ET

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

import optiplan as op
from optiplan.errors import InputError
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf import ros_packages
from tests.robot.robots import BARE, LINK, chain, joint, write_robot

BACKWARDS = '<limit lower="1" upper="-1" velocity="3" effort="4"/>'
BACKWARDS_FOLLOWER = joint("j", "b", "c", inside=BACKWARDS + '<mimic joint="i"/>')
ODD_MIMIC = '<limit lower="-1" upper="1" velocity="3" effort="4"/><mimic joint="j" multiplier="x"/>'
MESH = '<link name="m"><{0}><geometry><mesh filename="{1}" scale="2 2 2"/></geometry></{0}></link>'


def meshed(kind, name):
    return [LINK.format("a"), LINK.format("b"), MESH.format(kind, name), joint("j1", "a", "b"), joint("j2", "b", "m")]


@pytest.fixture
def cube(tmp_path):
    """A mesh in a package called `pack` two folders above the robot."""
    path = tmp_path / "pack/meshes/cube.stl"
    path.parent.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(path)
    return path


@pytest.mark.parametrize(
    "form",
    [
        "package://pack/meshes/cube.stl",
        "package:///pack/meshes/cube.stl",
        "../meshes/cube.stl",
        "file://{}",
        "file://../meshes/cube.stl",
        "{}",
    ],
)
def test_meshes_are_found_and_scaled(cube, form):
    folder = cube.parent.parent / "robot"
    robot = load_robot(str(write_robot(folder, meshed("collision", form.format(cube)))))
    shape = next(item.geometry for item in robot.geometry.geometryObjects if "m_" in item.name)
    assert np.allclose(np.asarray(shape.points()).max(axis=0), [0.1, 0.2, 0.3])
    assert cube.resolve() in [path.resolve() for path in robot.files]


@pytest.mark.parametrize(("size", "noted"), [(4.0, []), (400.0, ["m (800 m)"])])
def test_a_mesh_in_millimetres_is_noted(tmp_path, size, noted):
    path = write_robot(tmp_path, meshed("collision", "long.stl"))
    trimesh.creation.box((0.1, 0.2, size)).export(tmp_path / "long.stl")
    notes = [note for note in load_robot(str(path)).notes if "millimetres" in note]
    assert [note.partition("those of ")[2].partition(";")[0] for note in notes] == noted


def test_a_missing_collision_mesh_names_the_link_and_what_was_tried(tmp_path):
    path = write_robot(tmp_path, meshed("collision", "package://pack/meshes/none.stl"))
    with pytest.raises(InputError) as caught:
        load_robot(str(path))
    (issue,) = caught.value.issues
    assert issue.field == "m"
    assert issue.line == 1
    assert str(tmp_path / "pack/meshes/none.stl") in issue.found
    assert str(tmp_path / "meshes/none.stl") in issue.found


def test_a_mesh_whose_name_differs_in_capitals_is_proposed(cube):
    path = write_robot(cube.parent.parent / "robot", meshed("collision", "package://pack/Meshes/Cube.STL"))
    with pytest.raises(InputError, match=f"expected a mesh file, such as {cube.resolve()}, whose capitals differ"):
        load_robot(str(path))


def test_a_missing_visual_mesh_is_only_noted(tmp_path):
    robot = load_robot(str(write_robot(tmp_path, meshed("visual", "package://pack/none.dae"))))
    assert robot.visual.ngeoms == 0
    assert [note for note in robot.notes if "none.dae is missing" in note]


def test_visuals_that_cannot_be_read_give_way_to_collision_shapes(tmp_path, caplog):
    (tmp_path / "bad.stl").write_text("this is no mesh")
    robot = load_robot(str(write_robot(tmp_path, meshed("visual", "bad.stl"))))
    assert robot.visual.ngeoms == robot.geometry.ngeoms == 2
    assert "cannot be read" in caplog.text


def test_a_collision_mesh_that_cannot_be_read(tmp_path):
    (tmp_path / "bad.stl").write_text("this is no mesh")
    with pytest.raises(InputError, match="expected collision meshes that can be read"):
        load_robot(str(write_robot(tmp_path, meshed("collision", "bad.stl"))))


def test_joints_without_end_keep_one_coordinate(tmp_path):
    robot = load_robot(str(write_robot(tmp_path, chain(joint("j1", "a", "b", "continuous", inside="")))))
    assert robot.model.nq == 1
    assert robot.limits.lower.tolist() == [-np.inf]
    assert robot.limits.upper.tolist() == [np.inf]
    assert robot.limits.velocity.tolist() == [1]
    assert [note for note in robot.notes if "no velocity limit is given for any joint" in note]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array([2 * np.pi + 0.3]))
    assert np.isclose(data.oMf[robot.model.getFrameId("b")].rotation[0, 0], np.cos(0.3))


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_floating_and_planar_joints_are_fixed_and_said_to_be(tmp_path, kind):
    parts = chain(joint("j1", "a", "b", kind, inside=""), joint("j2", "b", "c"))
    robot = load_robot(str(write_robot(tmp_path, parts)))
    assert robot.joint_names == ("j2",)
    assert f"joint j1 is {kind}: it is fixed here, where the URDF puts it" in robot.notes
    with pytest.raises(InputError, match=f"the {kind} joint 'j1', which cannot be planned"):
        load_robot(str(write_robot(tmp_path, parts, "group: [j1, j2]\n")))
    assert load_robot(str(write_robot(tmp_path, parts, "group: [j2]\n"))).joint_names == ("j2",)


def test_followers_stand_where_their_leader_puts_them(tmp_path):
    follower = '<limit lower="-9" upper="9" velocity="1" effort="1"/><mimic joint="j1" multiplier="-2" offset="0.1"/>'
    parts = chain(joint("j1", "a", "b"), joint("j2", "b", "c", inside=follower), joint("j3", "c", "d"))
    robot = load_robot(str(write_robot(tmp_path, parts, "group: [j3]\nlocked: {j1: 0.5}\n")))
    assert robot.locked == pytest.approx({"j1": 0.5, "j2": -0.9})
    robot = load_robot(str(write_robot(tmp_path, parts)))
    assert robot.joint_names == ("j1", "j3")
    assert "joint j2 moves with j1: q = -2 · j1 +0.1" in robot.notes


def test_links_without_mass_or_with_shapes_of_one_name_load(tmp_path):
    shape = '<collision name="same"><geometry><sphere radius="0.1"/></geometry></collision>'
    mass = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    parts = [BARE.format("a"), f'<link name="b">{mass}{shape}{shape}</link>', joint("j1", "a", "b")]
    robot = load_robot(str(write_robot(tmp_path, parts)))
    assert robot.geometry.ngeoms == 2
    assert {robot.link_of(index) for index in range(2)} == {"b"}
    assert robot.link_geometry == {"b": "primitive"}


@pytest.mark.parametrize("version", ["", ' version="1.0"', ' version="1.1"'])
def test_a_quaternion_turns_whatever_the_version_says(tmp_path, version):
    path = write_robot(tmp_path, [*chain(joint("j1", "a", "b")), joint("f", "b", "c", "fixed", ""), LINK.format("c")])
    urdf = tmp_path / "robot.urdf"
    turned = urdf.read_text().replace('xyz="0.5 0 0"', 'xyz="0 0 0" quat_xyzw="0 0 0.6 0.8"', 1)
    urdf.write_text(turned.replace('name="r"', f'name="r"{version}'))
    turn = load_robot(str(path)).fk([0.0], "c").position
    np.testing.assert_allclose(turn, [0.5 * 0.28, 0.5 * 0.96, 0.0], atol=1e-12)
    arms = {"a": str(path), "b": {"use": str(path), "base": op.Pose((0.0, 0.0, 1.0))}}
    assert ET.fromstring(op.Robot.side_by_side(arms).urdf).get("version") == "1.1"


def test_every_capsule_of_a_link_is_one(tmp_path):
    """Pinocchio reads the first <collision_checking> of a link only; a cylinder lacks the caps."""
    shape = '<collision name="{0}"><geometry><cylinder radius="0.1" length="0.2"/></geometry></collision>'
    marks = "".join(f'<collision_checking><capsule name="{name}"/></collision_checking>' for name in "pq")
    shapes = "".join(shape.format(name) for name in "prq")
    parts = [BARE.format("a"), f'<link name="b">{shapes}{marks}</link>', joint("j1", "a", "b")]
    bodies = load_robot(str(write_robot(tmp_path, parts))).geometry.geometryObjects
    assert [type(body.geometry) for body in bodies] == [coal.Capsule, coal.Cylinder, coal.Capsule]


def test_a_link_and_a_joint_of_one_name(tmp_path):
    path = write_robot(tmp_path, chain(joint("b", "a", "b"), joint("j2", "b", "c")), "srdf: r.srdf\n")
    pair = '<disable_collisions link1="b" link2="c" reason="&#x9b;"/>'
    (tmp_path / "r.srdf").write_text(f'<robot name="r">{pair}</robot>')
    robot = load_robot(str(path))
    assert robot.joint_names == ("b", "j2")
    assert [robot.link_of(index) for index in range(3)] == ["a", "b_link", "c"]
    assert robot.allowed["b_link", "c"] == r"SRDF: \x9b"
    assert [note for note in robot.notes if "link b is called b_link" in note]


def test_new_names_of_links_differ(tmp_path):
    bodies = [LINK.format(name) for name in ("a", "b", "b_link")]
    path = write_robot(tmp_path, [*bodies, joint("b", "a", "b"), joint("b_link", "b", "b_link")])
    robot = load_robot(str(path))
    assert [robot.link_of(index) for index in range(3)] == ["a", "b_link_link", "b_link_link_link"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("<robot name='r'><link", "expected well-formed XML"),
        ("<sdf/>", "expected a URDF, whose root is <robot>"),
        ("<robot name='r'/>", "expected"),
        (f"<robot name='r'>{''.join(chain(joint('j', 'a', 'b', inside='')))}</robot>", "without <limit>"),
        (
            f"<robot name='r'>{''.join(chain(joint('j', 'a', 'z')))}</robot>",
            "j: the child link 'z', which is not there",
        ),
        (f"<robot name='r'>{LINK.format('a')}</robot>", "without movable joints"),
        (
            f"<robot name='r'>{''.join(chain(joint('j', 'a', 'b', inside=BACKWARDS)))}</robot>",
            "j with a lower limit above",
        ),
        (
            f"<robot name='r'>{''.join(chain(joint('i', 'a', 'b'), BACKWARDS_FOLLOWER))}</robot>",
            "j with a lower limit above",
        ),
        (
            f"<robot name='r'>{''.join(chain(joint('j', 'a', 'b', inside=ODD_MIMIC)))}</robot>",
            "<mimic> with multiplier='x'",
        ),
    ],
)
def test_broken_urdfs(tmp_path, content, words):
    path = write_robot(tmp_path, [])
    (tmp_path / "robot.urdf").write_text(content)
    with pytest.raises(InputError) as caught:
        load_robot(str(path))
    assert words in str(caught.value)


LIMITS = '<limit lower="-1" upper="1" velocity="1" effort="10"/>'
HEAVY = '<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="{}" ixz="0" iyz="0"/>'
BOX = '<geometry><box size="0.1 0.1 0.1"/></geometry>'


@pytest.mark.parametrize(
    ("inside", "link", "more", "words"),
    [
        (LIMITS + LIMITS.replace("1", "2"), "", "", "j: 2 <limit> in a <joint>"),
        (LIMITS + '<axis xyz="0 1 0"/>', "", "", "j: 2 <axis> in a <joint>"),
        (LIMITS, 2 * f"<inertial>{HEAVY.format(0)}</inertial>", "", "b: 2 <inertial> in a <link>"),
        (LIMITS, f'<inertial>{HEAVY.format(0)}<mass value="9"/></inertial>', "", "b: 2 <mass> in a <inertial>"),
        (LIMITS, f"<collision>{2 * '<origin/>'}{BOX}</collision>", "", "b: 2 <origin> in a <collision>"),
        (LIMITS, f"<collision>{2 * BOX}</collision>", "", "b: 2 <geometry> in a <collision>"),
        (LIMITS, "", '<link name="c"/>', "c: a link that no joint carries, besides 'a'"),
        (LIMITS, "", joint("k", "b", "a", inside=LIMITS), "a: links that carry each other in a circle"),
        (LIMITS, f"<collision>{BOX}</collision><inertial>{HEAVY.format(0.05)}</inertial>", "", ""),
        (LIMITS, 2 * f"<collision>{BOX}</collision>", "", ""),
    ],
)
def test_nothing_is_dropped_without_a_word(tmp_path, capfd, inside, link, more, words):
    """Of what stands twice, readers take the first; of trees, the parser spoke in words of its own."""
    path = write_robot(tmp_path, [])
    links = f'<link name="a"><collision>{BOX}</collision></link><link name="b">{link}</link>'
    content = f"<robot name='r'>{links}{joint('j', 'a', 'b', inside=inside)}{more}</robot>"
    (tmp_path / "robot.urdf").write_text(content)
    if not words:
        assert load_robot(str(path)).joint_names == ("j",)
        return
    with pytest.raises(InputError) as caught:
        load_robot(str(path))
    assert words in str(caught.value)
    assert "urdfdom" not in "".join(capfd.readouterr())


@pytest.mark.parametrize(("product", "noted"), [(0.0, False), (0.05, False), (5.0, True)])
def test_an_inertia_that_no_body_has_is_noted(tmp_path, product, noted):
    path = write_robot(tmp_path, [])
    links = f'<link name="a"/><link name="b"><collision>{BOX}</collision>{HEAVY.format(product)}</link>'
    links = links.replace("<mass", "<inertial><mass").replace("</link>", "</inertial></link>", 1)
    content = f"<robot name='r'>{links}{joint('j', 'a', 'b', inside=LIMITS)}</robot>"
    (tmp_path / "robot.urdf").write_text(content)
    notes = [note for note in load_robot(str(path)).notes if "a principal moment of -4.9 kg m²" in note]
    assert len(notes) == noted


def test_a_missing_urdf(tmp_path):
    path = write_robot(tmp_path, [])
    (tmp_path / "robot.urdf").unlink()
    with pytest.raises(
        InputError, match=r"robot\.yaml:\d+: urdf: 'robot\.urdf', but there is no file .*a readable URDF"
    ):
        load_robot(str(path))


def test_a_missing_srdf(tmp_path):
    path = write_robot(tmp_path, chain(joint("j", "a", "b")), "srdf: pairs.srdf\n")
    with pytest.raises(
        InputError, match=r"robot\.yaml:\d+: srdf: 'pairs\.srdf', but there is no file .*a readable SRDF"
    ):
        load_robot(str(path))


@pytest.mark.parametrize(
    ("variable", "place", "entry"),
    [
        ("ROS_PACKAGE_PATH", "src/pack", "src"),
        ("ROS_PACKAGE_PATH", "src/pack", "src/pack"),
        ("AMENT_PREFIX_PATH", "install/share/pack", "install"),
    ],
)
def test_a_package_is_looked_for_where_ros_says(tmp_path, monkeypatch, variable, place, entry):
    folder = tmp_path / place / "meshes"
    folder.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "cube.stl")
    path = write_robot(tmp_path / "far" / "away" / "from" / "it", meshed("collision", "package://pack/meshes/cube.stl"))
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    with pytest.raises(InputError, match="missing"):
        load_robot(str(path))
    monkeypatch.setenv(variable, f"/nowhere{os.pathsep}{tmp_path / entry}")
    assert load_robot(str(path)).link_geometry


@pytest.mark.parametrize("manifests", [True, False])
def test_a_mesh_is_that_of_its_own_package_where_another_has_one_of_that_name(tmp_path, manifests):
    for folder, name, size in (("arm", "arm", 0.1), ("tool" if manifests else "hand", "hand", 0.3)):
        mesh = tmp_path / "src" / folder / "meshes/base_link.stl"
        mesh.parent.mkdir(parents=True)
        trimesh.creation.box((size, size, size)).export(mesh)
        if manifests:
            (mesh.parents[1] / "package.xml").write_text(f"<package><name>{name}</name></package>")
    robot = load_robot(
        str(write_robot(tmp_path / "src/arm/urdf", meshed("collision", "package://hand/meshes/base_link.stl")))
    )
    shape = next(item.geometry for item in robot.geometry.geometryObjects if "m_" in item.name)
    assert np.allclose(np.asarray(shape.points()).max(axis=0), 0.3)


def write_cube(path, size):
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((size, size, size)).export(path)


def size_of_m(robot):
    shape = next(item.geometry for item in robot.geometry.geometryObjects if "m_" in item.name)
    return float(np.asarray(shape.points()).max())


def test_a_folder_that_is_called_like_a_package_and_is_another_one_is_not_taken(tmp_path):
    for folder, name, size in (("hand", "old_hand", 0.1), ("tool", "hand", 0.3)):
        write_cube(tmp_path / "src" / folder / "meshes/base_link.stl", size)
        (tmp_path / "src" / folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    path = write_robot(tmp_path / "src/arm/urdf", meshed("collision", "package://hand/meshes/base_link.stl"))
    assert size_of_m(load_robot(str(path))) == pytest.approx(0.3)


@pytest.mark.parametrize("manifest", ["<package><name>arm</name></package>", ""])
def test_the_package_that_holds_the_urdf_comes_before_a_copy_beside_the_robot_file(tmp_path, manifest):
    own, copy = tmp_path / "ws/src/arm", tmp_path / "arm"
    for folder, size in ((own, 0.3), (copy, 0.1)):
        write_cube(folder / "meshes/base_link.stl", size)
        (folder / "package.xml").write_text("<package><name>arm</name></package>")
    (own / "package.xml").write_text(manifest)
    write_robot(own / "urdf", meshed("collision", "package://arm/meshes/base_link.stl"))
    path = write_robot(tmp_path / "cells/a", [])
    path.write_text(path.read_text().replace("robot.urdf", str(own / "urdf/robot.urdf")))
    robot = load_robot(str(path))
    assert size_of_m(robot) == pytest.approx(0.3)
    assert f"meshes of package arm are read from {own}, not from {copy}" in robot.notes


def test_a_file_that_a_package_lacks_is_not_guessed(tmp_path):
    write_cube(tmp_path / "arm/meshes/base_link.stl", 0.1)
    (tmp_path / "tool").mkdir()
    (tmp_path / "tool/package.xml").write_text("<package><name>hand</name></package>")
    path = write_robot(tmp_path / "arm/urdf", meshed("collision", "package://hand/meshes/base_link.stl"))
    with pytest.raises(InputError, match="missing") as caught:
        load_robot(str(path))
    assert f"(tried {tmp_path / 'tool/meshes/base_link.stl'})" in caught.value.issues[0].found


def test_a_note_names_a_package_of_ros_where_its_files_are_near_as_well(tmp_path, monkeypatch):
    write_cube(tmp_path / "arm/urdf/meshes/base_link.stl", 0.1)
    path = write_robot(tmp_path / "arm/urdf", meshed("collision", "package://hand/meshes/base_link.stl"))
    near, ros = tmp_path / "arm/urdf", tmp_path / "far/opt/ros/hand"
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(ros.parent))
    found = load_robot(str(path))
    assert size_of_m(found) == pytest.approx(0.1)
    assert f"package hand is not found; its meshes are read from {near}" in found.notes
    write_cube(ros / "meshes/base_link.stl", 0.3)
    found = load_robot(str(path.rename(path.with_name("again.yaml"))))
    assert size_of_m(found) == pytest.approx(0.3)
    assert f"meshes of package hand are read from {ros}, not from {near}" in found.notes
    write_cube(tmp_path / "arm/hand/meshes/base_link.stl", 0.2)
    found = load_robot(str(path.with_name("again.yaml").rename(path)))
    assert size_of_m(found) == pytest.approx(0.2)
    assert not [note for note in found.notes if "package hand" in note]


def test_a_package_near_is_found_without_reading_those_of_ros(tmp_path, monkeypatch):
    read = []
    name_of = ros_packages._package_name
    monkeypatch.setattr(ros_packages, "_package_name", lambda folder: [name_of(folder), read.append(folder)][0])
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "far"))
    for folder in ("near/hand", "far/other"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "package.xml").write_text(f"<package><name>{folder[-4:]}</name></package>")
    packages = ros_packages.RosPackages(tmp_path / "near")
    assert packages.find("hand") == next(packages.folders("hand")) == tmp_path / "near/hand"
    assert len(read) == len(set(read)) > 0
    assert tmp_path / "far/other" not in read
    assert packages.names() == ["hand", "ther"]


def test_a_mesh_of_a_package_that_is_not_found_is_guessed_with_a_note_and_never_that_of_another(tmp_path):
    mesh = tmp_path / "arm/meshes/base_link.stl"
    mesh.parent.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(mesh)
    path = write_robot(tmp_path / "arm/urdf", meshed("collision", "package://hand/meshes/base_link.stl"))
    note = f"package hand is not found; its meshes are read from {tmp_path / 'arm'}"
    assert load_robot(str(path)).notes.count(note) == 1
    (tmp_path / "arm/package.xml").write_text("<package><name>arm</name></package>")
    with pytest.raises(InputError, match="missing"):
        load_robot(str(path.rename(path.with_name("again.yaml"))))
