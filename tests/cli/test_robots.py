from xml.etree import ElementTree

from optiplan.model.robot import robot_names


def test_list_names_every_robot(optiplan, optiplan_json):
    code, out, _ = optiplan("robots")
    assert code == 0
    for name in robot_names():
        assert name in out
    assert set(optiplan_json("robots")[1]["robots"]) == set(robot_names())


def test_show_tells_joints_limits_frames_and_pairs(optiplan, optiplan_json):
    code, out, _ = optiplan("robots", "show", "planar2r")
    assert code == 0
    for text in (
        "shoulder",
        "-3.1",
        "tool frame tool",
        "upper_arm",
        "pairs of links:",
        "configuration ready: [0.5, 1]",
    ):
        assert text in out
    code, data = optiplan_json("robots", "show", "planar2r")
    assert code == 0
    assert [joint["name"] for joint in data["joints"]] == ["shoulder", "elbow"]
    assert data["joints"][0]["velocity"] == 2.0
    assert data["links"]["forearm"] == "primitive"
    assert {"links": ["base", "upper_arm"], "reason": "Adjacent"} in data["allowed_pairs"]
    assert data["checked_pairs"] == []


def test_show_takes_the_path_of_a_robot_file(optiplan, tmp_path):
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit velocity="1" effort="1"/></joint></robot>'
    )
    (tmp_path / "robot.yaml").write_text("version: 1\nname: arm\nurdf: arm.urdf\n")
    code, out, _ = optiplan("robots", "show", tmp_path / "robot.yaml")
    assert code == 0
    assert "endless" in out
    assert "note:" in out


def test_unknown_robot_lists_the_known(optiplan):
    code, out, err = optiplan("robots", "show", "pandda")
    assert (code, out) == (2, "")
    assert "planar2r" in err


def test_srdf_can_be_read_again(optiplan, tmp_path):
    code, out, _ = optiplan("robots", "srdf", "panda", tmp_path / "panda.srdf")
    assert code == 0
    assert "pairs that need no check" in out
    pairs = ElementTree.parse(tmp_path / "panda.srdf").getroot().findall("disable_collisions")
    assert {"link1": "panda_link0", "link2": "panda_link1", "reason": "Adjacent"} in [pair.attrib for pair in pairs]
