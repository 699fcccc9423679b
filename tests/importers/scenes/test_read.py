"""Scenes of MoveIt, Gazebo, MuJoCo and USD: the same cell four times gives the same obstacles; bad files are named."""

import numpy as np
import pytest

import optiplan as op
from optiplan.geometry.poses import pose_from_data
from optiplan.importers.scenes.read import read_scene

MOVEIT = """(noname)+
* table
0.5 0 0.2
0 0 0.3826834323650898 0.9238795325112867
2
box
0.4 0.6 0.02
0 0 0.1
0 0 0 1
0 0 0 1
cylinder
0.03 0.3
0.1 0 -0.05
0 0 0 1
1 1 1 1
0
* floor
0 0 -0.5
0 0 0 1
1
plane
0 0 1 0
0 0 0
0 0 0 1
0 0 0 0
1
corner
1 1 0
0 0 0 1
.
"""
SDF = """<sdf version="1.9"><world name="cell">
  <model name="table"><pose>0.5 0 0.2 0 0 0.7853981633974483</pose><static>true</static>
    <frame name="top"><pose>0 0 0.1 0 0 0</pose></frame>
    <link name="board"><pose relative_to="top"/>
      <collision name="c"><geometry><box><size>0.4 0.6 0.02</size></box></geometry></collision>
      <visual name="v"><geometry><sphere><radius>9</radius></sphere></geometry></visual></link>
    <link name="leg"><pose degrees="true">0.1 0 0 0 0 0</pose>
      <collision name="c"><pose>0 0 -0.05 0 0 0</pose>
        <geometry><cylinder><radius>0.03</radius><length>0.3</length></cylinder></geometry></collision></link>
    <joint name="hinge" type="revolute"><parent>board</parent><child>leg</child></joint>
  </model>
  <model name="floor"><pose>0 0 -0.5 0 0 0</pose>
    <link name="l"><collision name="c"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link>
  </model>
  <actor name="person"/>
</world></sdf>
"""
MJCF = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" pos="0 0 -0.5"/>
  <body name="table" pos="0.5 0 0.2" euler="0 0 45"><freejoint/>
    <geom type="box" size="0.2 0.3 0.01" pos="0 0 0.1"/>
    <geom type="cylinder" size="0.03 0.15" pos="0.1 0 -0.05"/>
    <geom type="sphere" size="9" contype="0" conaffinity="0"/></body>
  <body name="robot"><joint axis="0 0 1"/><geom size="0.1"/></body></worldbody></mujoco>
"""
USD = """#usda 1.0
(
    metersPerUnit = 0.1
    upAxis = "Y"
)
def Xform "table" (prepend apiSchemas = ["PhysicsRigidBodyAPI"])
{
    double3 xformOp:translate = (5, 2, 0)
    float xformOp:rotateY = 45
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
    def Cube "board" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double size = 1
        double3 xformOp:translate = (0, 1, 0)
        float xformOp:rotateX = -90
        float3 xformOp:scale = (4, 6, 0.2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX", "xformOp:scale"]
    }
    def Cylinder "leg" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double radius = 0.3
        double height = 3
        token axis = "Y"
        double3 xformOp:translate = (1, -0.5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Sphere "halo"
    {
        double radius = 90
    }
}
def Plane "floor" (prepend apiSchemas = ["PhysicsCollisionAPI"])
{
    token axis = "Y"
    double3 xformOp:translate = (0, -5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "robot" (prepend apiSchemas = ["PhysicsRigidBodyAPI"])
{
    def Cube "link" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
    }
}
def PhysicsRevoluteJoint "hinge"
{
    rel physics:body1 = </robot>
}
"""
FILES = {"cell.scene": MOVEIT, "cell.sdf": SDF, "cell.xml": MJCF, "cell.usda": USD}


@pytest.mark.parametrize("name", FILES)
def test_the_same_cell_gives_the_same_obstacles(tmp_path, name):
    if name.endswith("xml"):
        pytest.importorskip("mujoco")
    (tmp_path / name).write_text(FILES[name])
    bodies = {next(iter(body["shape"])): body for body in read_scene(tmp_path / name).obstacles}
    assert bodies.keys() == {"box", "cylinder", "half_space"}
    assert bodies["box"]["shape"]["box"] == pytest.approx([0.4, 0.6, 0.02])
    assert bodies["cylinder"]["shape"]["cylinder"] == pytest.approx({"radius": 0.03, "length": 0.3})
    assert bodies["half_space"]["shape"]["half_space"]["offset"] == pytest.approx(-0.5)
    assert bodies["half_space"]["shape"]["half_space"]["normal"] == pytest.approx([0, 0, 1])
    board, leg = (pose_from_data(bodies[kind]["pose"]) for kind in ("box", "cylinder"))
    turn = [[np.sqrt(0.5), -np.sqrt(0.5), 0], [np.sqrt(0.5), np.sqrt(0.5), 0], [0, 0, 1]]
    np.testing.assert_allclose(board.rotation, turn, atol=1e-9)
    np.testing.assert_allclose(board.translation, [0.5, 0, 0.3], atol=1e-9)
    np.testing.assert_allclose(leg.translation, [0.5 + 0.1 * np.sqrt(0.5), 0.1 * np.sqrt(0.5), 0.15], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("cell.scene", ["1 subframes of floor", "plane floor became a half-space"]),
        ("cell.sdf", ["table has 1 joints that move", "left out: 1 <actor>"]),
        ("cell.xml", ["left out: robot, which have joints", "the loose bodies table"]),
        ("cell.usda", ["left out: /robot, which have joints", "the loose bodies /table"]),
    ],
)
def test_what_is_left_out_is_said(tmp_path, name, words):
    if name.endswith("xml"):
        pytest.importorskip("mujoco")
    (tmp_path / name).write_text(FILES[name])
    notes = " | ".join(read_scene(tmp_path / name).notes)
    assert all(word in notes for word in words), notes


def test_meshes_and_included_models_come_along(tmp_path):
    (tmp_path / "models" / "post").mkdir(parents=True)
    (tmp_path / "models" / "post" / "model.sdf").write_text(
        '<sdf version="1.6"><model name="post"><pose>0 0 3 0 0 0</pose><link name="l"><collision name="c"><geometry>'
        "<mesh><uri>model://post/post.obj</uri><scale>2 2 2</scale></mesh></geometry></collision></link></model></sdf>"
    )
    tetrahedron = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    (tmp_path / "models" / "post" / "post.obj").write_text(tetrahedron)
    include = "<include><uri>model://post</uri><name>{}</name>{}</include>"
    places = include.format("a", "") + include.format("b", "<pose>0 0.5 3 0 0 0</pose>")
    (tmp_path / "w.sdf").write_text(f'<sdf version="1.6"><world name="w">{places}</world></sdf>')
    problem = op.import_scene(tmp_path / "w.sdf", tmp_path / "made" / "w.yaml", "planar2r")
    assert [obstacle.name for obstacle in problem.scene.obstacles] == ["a::l", "b::l"]
    stated = [body["pose"]["position"] for body in problem.source["scene"]["obstacles"]]
    assert stated == [[0, 0, 3], [0, 0.5, 3]]
    vertices = [
        line.split()[1:] for line in (tmp_path / "made" / "a__l.obj").read_text().splitlines() if line[0] == "v"
    ]
    np.testing.assert_allclose(np.ptp(np.array(vertices, float), axis=0), 0.2, atol=1e-9)


def test_a_placement_frame_stands_where_the_model_is_put(tmp_path):
    """The frame `f` is 5 m above the origin of the model, a quarter turn about z; its link stands at the origin."""
    box = "<geometry><box><size>0.1 0.2 0.3</size></box></geometry>"
    shape = f'<link name="l"><collision name="c">{box}</collision></link>'
    inside = f'<pose>1 0 0 0 0 0</pose><frame name="f"><pose degrees="true">0 0 5 0 0 90</pose></frame>{shape}'
    model = '<model name="{}" placement_frame="{}">' + inside + "</model>"
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.9">{model.format("m", "l")}</sdf>')
    include = "<include><uri>m.sdf</uri><name>{}</name>{}</include>"
    placed = "<placement_frame>f</placement_frame><pose>0 2 0 0 0 0</pose>"
    models = model.format("a", "f") + model.format("b", "__model__")
    below = '<model name="d"><pose relative_to="a">0 0 1 0 0 0</pose>' + shape + "</model>"
    includes = include.format("e", "") + include.format("g", placed)
    state = '<state world_name="w"><model name="a"><pose>2 0 0 0 0 0</pose></model></state>'
    text = f'<sdf version="1.9"><world name="w">{models}{below}{includes}{state}</world></sdf>'
    (tmp_path / "w.sdf").write_text(text)
    scene = read_scene(tmp_path / "w.sdf")
    found = {body["name"].partition("::")[0]: pose_from_data(body["pose"]) for body in scene.obstacles}
    places = {"a": [1, 0, -5], "b": [1, 0, 0], "d": [1, 0, -4], "e": [1, 0, 0], "g": [0, 2, -5]}
    for name, place in places.items():
        np.testing.assert_allclose(found[name].translation, place, atol=1e-9)
    np.testing.assert_allclose(found["g"].rotation[:2, :2], [[0, 1], [-1, 0]], atol=1e-9)
    assert any("left out: <state>" in note for note in scene.notes)
    (tmp_path / "w.sdf").write_text(text.replace('placement_frame="f"', 'placement_frame="h"'))
    with pytest.raises(op.InputError, match=r"a: the frame 'h'; expected one of: f, l"):
        read_scene(tmp_path / "w.sdf")


def test_poses_may_be_relative_to_included_models_and_to_what_is_inside_a_model(tmp_path):
    shape = '<collision name="c"><geometry><box><size>0.1 0.2 0.3</size></box></geometry></collision>'
    top = f'<frame name="top"><pose>0 0 1 0 0 0</pose></frame><link name="l">{shape}</link>'
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.9"><model name="m">{top}</model></sdf>')
    table = "<include><uri>m.sdf</uri><name>table</name><pose>2 0 0 0 0 0</pose></include>"
    near = f'<model name="near"><pose>0 3 0 0 0 0</pose>{top}</model>'
    on = {"cup": "table", "dish": "table::top", "fork": "near::top", "plate": "near"}
    models = "".join(
        f'<model name="{name}"><pose relative_to="{frame}">0 0 0.1 0 0 0</pose><link name="l">{shape}</link></model>'
        for name, frame in on.items()
    )
    text = f'<sdf version="1.9"><world name="w">{models}{near}{table}</world></sdf>'
    (tmp_path / "w.sdf").write_text(text)
    found = {
        body["name"].partition("::")[0]: body["pose"]["position"] for body in read_scene(tmp_path / "w.sdf").obstacles
    }
    places = {"cup": [2, 0, 0.1], "dish": [2, 0, 1.1], "fork": [0, 3, 1.1], "plate": [0, 3, 0.1], "table": [2, 0, 0]}
    assert {name: found[name] for name in places} == {name: pytest.approx(at) for name, at in places.items()}
    (tmp_path / "w.sdf").write_text(text.replace('"table::top"', '"chair::top"'))
    with pytest.raises(op.InputError, match=r"the frame 'chair::top'; expected one of: cup, .*, table"):
        read_scene(tmp_path / "w.sdf")


def test_geoms_that_cannot_touch_are_obstacles_only_where_none_can(tmp_path):
    """A picture of a post beside a robot, then where a keyframe puts it, then with a table that can touch."""
    pytest.importorskip("mujoco")
    ghost = 'contype="0" conaffinity="0"'
    post = f'<body name="post"><freejoint/><geom size="0.1" {ghost}/><geom size="0.2" group="3" {ghost}/></body>'
    robot = '<body name="robot"><joint axis="0 0 1"/><geom size="0.1"/></body>'
    text = "<mujoco><worldbody>{}" + post + robot + "</worldbody>{}</mujoco>"
    (tmp_path / "m.xml").write_text(text.format("", ""))
    scene = read_scene(tmp_path / "m.xml")
    assert [body["shape"] for body in scene.obstacles] == [{"sphere": 0.1}]
    assert "no geom outside of robots can touch another: all that the file shows are obstacles" in scene.notes
    key = '<keyframe><key name="far" qpos="1 2 3 1 0 0 0 0"/></keyframe>'
    (tmp_path / "m.xml").write_text(text.format("", key))
    scene = read_scene(tmp_path / "m.xml")
    assert scene.obstacles[0]["pose"]["position"] == pytest.approx([1, 2, 3])
    assert "loose bodies stand as in the keyframe far" in scene.notes
    (tmp_path / "m.xml").write_text(text.format('<geom type="box" size="1 1 1"/>', ""))
    scene = read_scene(tmp_path / "m.xml")
    assert [body["name"] for body in scene.obstacles] == ["world"]
    assert "left out, since they cannot touch: geoms of post" in scene.notes
    (tmp_path / "m.xml").write_text(text.format('<geom type="box" size="1 1 1" pos="9 0 0"/>', ""))
    problem = op.import_scene(tmp_path / "m.xml", tmp_path / "m.yaml", "ur5")
    assert [body.name for body in problem.scene.obstacles] == ["world_"]
    assert "# obstacle world is called world_, since the world is called so" in (tmp_path / "m.yaml").read_text()


def test_obstacles_are_not_called_like_links(tmp_path):
    text = MOVEIT.replace("* table", "* base_link").replace("0.5 0 0.2", "9 0 0.2").replace("0 0 -0.5", "0 0 -9")
    (tmp_path / "m.scene").write_text(text)
    problem = op.import_scene(tmp_path / "m.scene", tmp_path / "m.yaml", "ur5")
    assert [body.name for body in problem.scene.obstacles] == ["base_link_", "base_link_2", "floor"]
    assert "# obstacle base_link is called base_link_, since a link" in (tmp_path / "m.yaml").read_text()


def test_only_the_refusal_of_files_that_are_there_names_the_call(tmp_path):
    (tmp_path / "m.scene").write_text(MOVEIT)
    (tmp_path / "m.yaml").write_text("mine")
    with pytest.raises(op.InputError, match=r"op.import_scene: .*m.yaml: import scene: .*replace_files=True"):
        op.import_scene(tmp_path / "m.scene", tmp_path / "m.yaml", "ur5")
    (tmp_path / "m.scene").write_text(MOVEIT.replace("0.4 0.6 0.02", "0.4 -0.6 0.02"))
    with pytest.raises(op.InputError) as caught:
        op.import_scene(tmp_path / "m.scene", tmp_path / "n.yaml", "ur5")
    assert "op.import_scene" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("cell.scene", "0.4 0.6 0.02", "0.4 -0.6 0.02", ":7: scene: the sizes 0.4 -0.6 0.02 of table, a box; expected"),
        ("cell.scene", "0 0 1 0\n", "0 0 0 1\n", ":22: scene: the plane 0 0 0 1 of floor; expected a normal"),
        ("cell.scene", "0 0 1 0\n", "0 0 1e-200 1\n", ":22: scene: the plane 0 0 1e-200 1 of floor; expected a normal"),
        (
            "cell.scene",
            "0.4 0.6 0.02",
            "0.4 0.6",
            ":7: scene: '0.4 0.6'; expected the sizes of a box: 3 numbers",
        ),
        ("cell.scene", "cylinder", "prism", ":11: scene: the shape 'prism'; expected one of: box"),
        (
            "cell.scene",
            "cylinder\n0.03 0.3",
            "mesh\n3 1\n0 0 0\n1 0 0\n0 1 0\n0 1 1.5",
            ":16: scene: 0 1 1.5; expected a triangle: whole numbers",
        ),
        ("cell.scene", "\n.\n", "\n", "the end of the file"),
        ("cell.sdf", "0.4 0.6 0.02", "0.4 0.6 0", "table::c: <size> '0.4 0.6 0' of a <box>; expected 3 numbers > 0"),
        ("cell.sdf", 'relative_to="top"', 'relative_to="side"', "the frame 'side'; expected one of: board"),
        ("cell.sdf", "<pose>0 0 0.1 0 0 0</pose>", '<pose relative_to="top"/>', "which depends on itself"),
        ("cell.sdf", 'relative_to="top"', 'relative_to="world"', "the frame 'world'; expected one of: board"),
        (
            "cell.sdf",
            "<box><size>0.4 0.6 0.02</size></box>",
            "<mesh><uri>cell.obj</uri><submesh><name>s</name><center>true</center></submesh></mesh>",
            "<center> of the submesh of table::board; expected a submesh where its file has it",
        ),
        ("cell.sdf", "</sdf>", "", "cell.sdf:"),
        ("cell.usda", "height = 3", "height = -3", "cell.usda: /table/leg.height: -3.0; expected a number > 0"),
        ("cell.usda", "0.2)", "0)", "cell.usda: /table/board: a transform that flattens"),
        ("cell.usda", 'Cube "board"', 'Points "board"', "cell.usda: /table/board: a collider of type Points"),
        ("cell.usda", 'token axis = "Y"', "token axis = Y", "cell.usda:23: usd: "),
        ("cell.usda", '"xformOp:rotateY"]', '"xformOp:turnY"]', "cell.usda: usd: "),
        ("cell.usda", "rel physics:body1", "token physics:body1", "cell.usda: usd: "),
        ("cell.sdf", "sdf", "urdf", "XML of <urdf>; expected a .scene of MoveIt"),
    ],
)
def test_bad_files_are_named(tmp_path, name, old, new, words):
    (tmp_path / "cell.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    (tmp_path / name).write_text(FILES[name].replace(old, new))
    with pytest.raises(op.InputError) as caught:
        read_scene(tmp_path / name)
    assert words in str(caught.value)


@pytest.mark.parametrize("yes", ["true", "1", " True "])
def test_truth_is_written_in_several_ways_in_sdf(tmp_path, yes):
    turned = SDF.replace('<pose degrees="true">0.1 0 0 0 0 0</pose>', f'<pose degrees="{yes}">0.1 0 0 0 0 90</pose>')
    (tmp_path / "cell.sdf").write_text(turned)
    leg = next(body for body in read_scene(tmp_path / "cell.sdf").obstacles if body["name"] == "table::leg")
    assert leg["pose"]["quaternion"] == pytest.approx([0, 0, np.sin(3 * np.pi / 8), np.cos(3 * np.pi / 8)])
