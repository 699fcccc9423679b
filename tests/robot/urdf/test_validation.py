"""What the URDF parser would drop without a word must be refused: a link without its shape is never checked."""

import pytest

from optiplan.errors import InputError
from optiplan.robot.robot import Robot, load_robot

URDF = """<robot name="x"><link name="a"/>
<link name="b"><collision><origin xyz="0 0 0"/><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("old", "new", "name", "found"),
    [
        ('size="1 1 1"', 'size="nan 1 1"', "b", "nan 1 1"),
        ('size="1 1 1"', 'size="-1 1 1"', "b", "-1 1 1"),
        ('size="1 1 1"', 'size="1 1"', "b", "1 1"),
        ('<box size="1 1 1"/>', "", "b", "0 shapes"),
        ('<box size="1 1 1"/>', '<sphere radius="abc"/>', "b", "abc"),
        ('<origin xyz="0 0 0"/>', '<origin xyz="nan 0 0"/>', "b", "<origin> with xyz='nan 0 0'"),
        ('xyz="0 0 1"', 'xyz="0 0 0"', "j", "0 0 0"),
        ('<link name="a"/>', '<link name="a"/><link name="%s"/>' % ("x" * 300), "x" * 300, "a name of 300 characters"),
        ('<link name="a"/>', '<link name="a"/><link name="a"/>', "a", "2 links called 'a'"),
        ('type="revolute"', 'type="turning"', "j", "a joint of type 'turning'"),
        ('effort="1"', 'effort="1,5"', "j", "<limit> with effort='1,5'"),
        ('velocity="1"', 'velocity="-1"', "j", "<limit> with velocity='-1'"),
        ('effort="1"', 'effort="1" jerk="x"', "j", "<limit> with jerk='x'"),
        ('upper="1"', 'upper="inf"', "j", "<limit> with upper='inf'"),
        ('xyz="0 0 0"', 'xyz="0 0 0" quat_xyzw="x 0 0 1"', "b", "<origin> with quat_xyzw='x 0 0 1'"),
        ('xyz="0 0 0"', 'rpy="0 0 0" quat_xyzw="0 0 0 1"', "b", "<origin> with rpy and quat_xyzw"),
        ("</joint>", '<dynamics damping="x"/></joint>', "j", "<dynamics> with damping='x'"),
        ("</joint>", '<dynamics friction="-1"/></joint>', "j", "<dynamics> with friction='-1'"),
        ('name="x"', 'name="x" version="2.0"', "x", "version '2.0'"),
        ("</robot>", '<joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint></robot>', "b", "two"),
        ('<parent link="a"/>', '<parent link="b"/>', "b", "in a circle"),
        ('xyz="0 0 0"', 'rpy="0 90 0"', "b", "<origin> with rpy='0 90 0'"),
        ('<origin xyz="0 0 0"/>', '<orgin xyz="1 0 0"/>', "b", "<orgin> in a <collision>"),
        ('xyz="0 0 0"', 'xzy="1 0 0"', "b", "<origin> with xzy='1 0 0'"),
        ('xyz="0 0 0"', 'rpy_deg="90 0 0"', "b", "<origin> with rpy_deg='90 0 0'"),
        ('xyz="0 0 1"', 'Xyz="0 0 1"', "j", "<axis> with Xyz='0 0 1'"),
        ("</joint>", '<Mimic joint="k"/></joint>', "j", "<Mimic> in a <joint>"),
        ('<link name="a"/>', '<link name="a"><colision/></link>', "a", "<colision> in a <link>"),
        ('<box size="1 1 1"/>', '<mesh filename="m.obj" Scale="1 1 1"/>', "b", "<mesh> with Scale='1 1 1'"),
    ],
)
def test_what_the_parser_would_drop_is_refused(tmp_path, old, new, name, found):
    assert old in URDF
    (tmp_path / "x.urdf").write_text(URDF.replace(old, new))
    (tmp_path / "robot.yaml").write_text("version: 1\nname: x\nurdf: x.urdf\n")
    with pytest.raises(InputError) as caught:
        load_robot(str(tmp_path / "robot.yaml"))
    (issue,) = caught.value.issues
    assert issue.field == name
    assert found in issue.found


def test_a_mesh_with_nan_is_refused_whatever_stands_for_it(tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    (tmp_path / "x.urdf").write_text(URDF.replace('<box size="1 1 1"/>', '<mesh filename="m.obj"/>'))
    for kind in ("hull", "mesh"):
        (tmp_path / "robot.yaml").write_text(f"version: 1\nname: x\nurdf: x.urdf\ncollision: {kind}\n")
        with pytest.raises(InputError, match="finite"):
            load_robot(str(tmp_path / "robot.yaml"))


def test_the_line_is_that_of_the_link_or_joint(tmp_path):
    """A material of the same name comes first here."""
    text = '<robot name="x">\n<material name="b"/>\n' + URDF.removeprefix('<robot name="x">').replace("1 1 1", "1 x 1")
    (tmp_path / "x.urdf").write_text(text)
    (tmp_path / "robot.yaml").write_text("version: 1\nname: x\nurdf: x.urdf\n")
    with pytest.raises(InputError) as caught:
        load_robot(str(tmp_path / "robot.yaml"))
    (issue,) = caught.value.issues
    assert text.splitlines()[issue.line - 1].startswith('<link name="b">')


BODY = '<visual><geometry><box size="1 1 1"/></geometry></visual></link>'


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [
        (BODY, "<visual/></link>", "link b: a <visual> with 0 shapes, not shown"),
        (BODY, BODY.replace("1 1 1", "1 1"), "link b: <box> with size '1 1', not shown"),
        (BODY, BODY.replace("</visual>", '<material><color rgba="1 0 0 1"/></material></visual>'), ""),
        (BODY, BODY.replace("</visual>", '<material name="red"><color rgba="1 x"/></material></visual>'), ""),
        (BODY, BODY.replace('<box size="1 1 1"/>', '<capsule radius="1" length="1"/>'), ""),
        ("</robot>", '<material name="red"/><material name="red"/></robot>', ""),
        ("</robot>", '<material><color rgba="1 1 1 1"/></material></robot>', ""),
        ("</joint>", "<dynamics/></joint>", ""),
        ("</joint>", '<safety_controller soft_upper_limit="a"/></joint>', ""),
        (
            "</joint>",
            '<safety_controller soft_lower_limit="-0.8" soft_upper_limit="0.8"/></joint>',
            "soft limits of position, narrower than <limit>, are not read: those of j",
        ),
        ("</joint>", '<calibration rising="x"/></joint>', ""),
        ('<robot name="x">', "<robot>", ""),
        (
            'lower="-1" upper="1"',
            'lower="-170" upper="90"',
            "limits of position that look like degrees, where a URDF has radians: those of j (170 rad)",
        ),
    ],
)
def test_what_no_plan_needs_stops_no_robot(tmp_path, capfd, old, new, note):
    whole = URDF.replace("</geometry></collision></link>", f"</geometry></collision>{BODY}")
    assert old in whole
    (tmp_path / "x.urdf").write_text(whole.replace(old, new))
    (tmp_path / "robot.yaml").write_text("version: 1\nname: x\nurdf: x.urdf\n")
    robot = load_robot(str(tmp_path / "robot.yaml"))
    assert robot.joint_names == ("j",)
    assert not note or note in robot.notes
    assert capfd.readouterr().err == ""


def test_a_urdf_without_links_is_refused_by_us(tmp_path, capfd):
    (tmp_path / "x.urdf").write_text('<robot name="x"/>')
    with pytest.raises(InputError, match=r"x.urdf: robot: <robot> without a <link>; expected a URDF"):
        Robot.from_urdf(tmp_path / "x.urdf")
    assert capfd.readouterr().err == ""
