"""MoveIt configuration folders: groups, states, pairs and limits; bad files are named with their lines."""

from xml.etree import ElementTree

import pytest

import optiplan as op
from optiplan.importers.robots.describe import describe

URDF = """<robot name="two">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0 0 0.2"/><geometry><box size=".05 .05 .2"/></geometry></collision></link>
  <link name="fore"><collision><origin xyz="0 0 0.2"/><geometry><box size=".05 .05 .2"/></geometry></collision></link>
  <link name="tip"/>
  <link name="jaw"><collision><origin xyz="0 0.03 0"/><geometry><sphere radius="0.01"/></geometry></collision></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="50"/></joint>
  <joint name="j2" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.35"/>
    <axis xyz="0 1 0"/><limit velocity="3" effort="50"/></joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="0 0 0.35"/></joint>
  <joint name="slide" type="prismatic"><parent link="tip"/><child link="jaw"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.02" velocity="1" effort="5"/></joint>
</robot>
"""
SRDF = """<robot name="cell">
  <group name="arm"><chain base_link="base" tip_link="tip"/></group>
  <group name="hand"><link name="jaw"/></group>
  <group name="all"><group name="arm"/><group name="hand"/></group>
  <group_state name="ready" group="arm"><joint name="j1" value="0.3"/><joint name="j2" value="-0.4"/></group_state>
  <end_effector name="gripper" parent_link="tip" group="hand"/>
  <virtual_joint name="world_joint" type="floating" parent_frame="odom" child_link="base"/>
  <disable_collisions link1="base" link2="upper" reason="Adjacent"/>
</robot>
"""
LIMITS = """joint_limits:
  j1: {has_velocity_limits: true, max_velocity: 1.5, has_acceleration_limits: true, max_acceleration: 4.0,
       has_position_limits: true, min_position: -1.0, max_position: 1.25}
  j2: {has_velocity_limits: false, max_velocity: 0, has_jerk_limits: true, max_jerk: 70.0}
  gone: {has_velocity_limits: true, max_velocity: 1.0}
"""
SETUP = """moveit_setup_assistant_config:
  URDF: {package: cell_description, relative_path: urdf/two.urdf}
  SRDF: {relative_path: config/cell.srdf}
"""


def config(root, **replaced):
    """A configuration folder beside the package that has the URDF."""
    files = {
        "description/package.xml": "<package><name>cell_description</name></package>",
        "description/urdf/two.urdf": URDF,
        "cell_config/.setup_assistant": SETUP,
        "cell_config/config/cell.srdf": SRDF,
        "cell_config/config/joint_limits.yaml": LIMITS,
        "cell_config/config/kinematics.yaml": "arm: {kinematics_solver: x}",
        "cell_config/config/ompl_planning.yaml": "{}",
        **replaced,
    }
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root / "cell_config"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    root = tmp_path_factory.mktemp("moveit")
    return op.init_robot(config(root), root / "made")


def test_groups_states_and_tool_frames(robot):
    assert robot.name == "cell"
    assert (robot.group, robot.joint_names, robot.tool_frame) == ("arm", ("j1", "j2"), "tip")
    assert dict(robot.groups) == {"arm": ["j1", "j2"], "hand": ["slide"], "all": ["j1", "j2", "slide"]}
    assert robot.configurations["ready"].tolist() == [0.3, -0.4]
    assert op.load_robot(robot.source, group="hand").joint_names == ("slide",)


def test_limits_of_the_yaml_go_before_those_of_the_urdf(robot):
    limits = robot.limits
    assert (limits.lower[0], limits.upper[0]) == (-1.0, 1.25)
    assert limits.velocity.tolist() == [1.5, 3.0]
    assert limits.acceleration.tolist() == [4.0, 10.0]
    assert limits.jerk.tolist() == [500.0, 70.0]
    assert robot.endless.tolist() == [False, True]


def test_only_disabled_pairs_go_unchecked(robot):
    assert {pair: why for pair, why in robot.allowed.items() if why.startswith("SRDF")} == {
        ("base", "upper"): "SRDF: Adjacent"
    }


def test_limits_of_joints_in_no_group_are_noted(tmp_path):
    srdf = SRDF.replace('<group name="hand"><link name="jaw"/></group>', "").replace('<group name="hand"/>', "")
    limits = LIMITS + "  slide: {has_velocity_limits: true, max_velocity: 0.1}\n"
    files = {"cell_config/config/cell.srdf": srdf, "cell_config/config/joint_limits.yaml": limits}
    robot = op.init_robot(config(tmp_path, **files), tmp_path / "made")
    assert "left out: limits of rates of joints in no group, slide" in robot.source.read_text()


def test_what_is_left_out_is_said(robot):
    head = robot.source.read_text()
    for words in ("limits of gone", "kinematics.yaml", "ompl_planning.yaml", "floating virtual joint", "gripper"):
        assert words in head


def test_a_plan_is_verified(robot):
    problem = op.Problem(robot, start="ready", goal=[-0.5, 0.6])
    assert op.plan(problem, budget=20.0).verified


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("cell_config/config/cell.srdf", SRDF.replace('tip_link="tip"', 'tip_link="top"'), "unknown link 'top'"),
        ("cell_config/config/cell.srdf", SRDF[:-9], "cell.srdf:9: srdf: "),
        ("cell_config/config/cell.srdf", SRDF.replace('<link name="jaw"', '<group name="all"'), "contains itself"),
        ("cell_config/config/joint_limits.yaml", LIMITS.replace("4.0", "-4.0"), "joint_limits.yaml:2: j1.max_acc"),
        (
            "cell_config/config/joint_limits.yaml",
            LIMITS.replace("-1.0", "1.5"),
            "joint_limits.yaml:2: j1.min_position: ",
        ),
        ("cell_config/config/joint_limits.yaml", "joint_limits: [", "joint_limits.yaml:"),
        ("cell_config/config/joint_limits.yaml", f"joint_limits: {'9' * 5000}", "joint_limits.yaml: yaml: Exceeds the"),
        ("cell_config/config/joint_limits.yaml", "[" * 600 + "]" * 600, "joint_limits.yaml: yaml: "),
        ("cell_config/config/joint_limits.yaml", "joint_limits: [j1]", "joint_limits.yaml:1: joint_limits: "),
        ("cell_config/config/joint_limits.yaml", "joint_limits:\n  j1: [1]", "joint_limits.yaml:2: j1: "),
        ("cell_config/.setup_assistant", "moveit_setup_assistant_config: [1]", ".setup_assistant:1: moveit_setup"),
        ("cell_config/.setup_assistant", SETUP.replace("two.urdf", "one.urdf"), "no URDF"),
    ],
)
def test_bad_files_are_named(tmp_path, file, text, words):
    with pytest.raises(op.InputError) as caught:
        describe(config(tmp_path, **{file: text}))
    assert words in str(caught.value)


@pytest.mark.parametrize(("upper", "kind"), [(", max_position: 2.5", "revolute"), ("", "continuous")])
def test_a_joint_that_turns_without_end_gets_limits_of_both_ends(tmp_path, upper, kind):
    text = f"joint_limits:\n  j2: {{has_position_limits: true, min_position: -0.5{upper}}}\n"
    described = describe(config(tmp_path, **{"cell_config/config/joint_limits.yaml": text}))
    joint = ElementTree.fromstring(described.text).find("joint[@name='j2']")
    assert joint.get("type") == kind
    assert joint.find("limit").get("upper") == ("2.5" if upper else None)
    assert any("left out: the position limit of j2" in note for note in described.notes) == (not upper)


def test_what_says_nothing_of_limits_is_no_fault(tmp_path):
    text = "default_velocity_scaling_factor: slow\njoint_limits:\n  j1:\n"
    described = describe(config(tmp_path, **{"cell_config/config/joint_limits.yaml": text}))
    assert not described.limits
    assert any("left out: default_velocity_scaling_factor" in note for note in described.notes)


def test_xacro_is_expanded_without_ros(tmp_path):
    pytest.importorskip("xacro")
    macros = '<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="top" value="${1+1}"/>'
    part = URDF.replace('<robot name="two">', '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">')
    top = f'{macros}<xacro:include filename="$(find cell_description)/urdf/part.xacro"/></robot>'
    files = {
        "description/urdf/part.xacro": part.replace('upper="2"', 'upper="${top}"'),
        "description/urdf/two.urdf.xacro": top,
        "cell_config/.setup_assistant": SETUP.replace("two.urdf", "two.urdf.xacro"),
    }
    folder = config(tmp_path, **files)
    plain, expanded = describe(tmp_path / "description/urdf/two.urdf"), describe(folder)
    assert plain.urdf is not None
    assert 'upper="1.25"' in expanded.text  # by joint_limits.yaml
    assert 'upper="2"' in describe(tmp_path / "description/urdf/two.urdf.xacro").text
    (tmp_path / "description/urdf/part.xacro").write_text(part.replace('upper="2"', 'upper="${bottom}"'))
    with pytest.raises(op.InputError, match=r": name 'bottom' is not defined when evaluating expression 'bottom';"):
        describe(folder)


def test_arguments_of_xacro(tmp_path):
    pytest.importorskip("xacro")
    macros = '<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="top" default="2"/>'
    path = tmp_path / "two.urdf.xacro"
    path.write_text(macros + URDF.replace('upper="2"', 'upper="$(arg top)"').partition(">")[2])
    described = describe(path, {"top": "1.5"})
    assert 'upper="1.5"' in described.text
    assert described.notes[0] == "expanded by xacro, with top=1.5 and the other defaults of two.urdf.xacro"
    with pytest.raises(op.InputError, match=r"unknown argument 'tip'; expected one of: top"):
        describe(path, {"tip": "1.5"})
    with pytest.raises(op.InputError, match=r"arguments \(top\); expected none, since this is no xacro file"):
        describe(config(tmp_path), {"top": "1.5"})
    path.write_text(path.read_text().replace('<xacro:arg name="top" default="2"/>', ""))
    with pytest.raises(op.InputError, match=r"op.init_robot: .*no value of the argument 'top'; expected one \(`arg"):
        op.init_robot(path, tmp_path / "out")
    path.write_text(macros + '<xacro:include filename="$(find arm)/x"/></robot>')
    with pytest.raises(op.InputError, match=r"no package 'arm' \(found near the file: \w+"):
        describe(path)
    (tmp_path / "part.xacro").write_text("<robot>\n<link></robot>")
    path.write_text(macros + '<xacro:include filename="part.xacro"/></robot>')
    with pytest.raises(op.InputError, match=r"part.xacro:2: xacro: mismatched tag"):
        describe(path)
