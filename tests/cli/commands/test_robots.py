from xml.etree import ElementTree

from optiplan.robot.robot import robot_names


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
    assert {"links": ["base", "upper_arm"], "reason": "proved", "collision_rate": 0.0} in data["allowed_pairs"]
    assert data["links_without_geometry"] == ["tool"]
    assert data["checked_pairs"] == []


def test_show_takes_the_path_of_a_robot_file(optiplan, tmp_path):
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit velocity="1" effort="1"/></joint></robot>'
    )
    (tmp_path / "robot.yaml").write_text("version: 1\nname: arm\nurdf: arm.urdf\ncollision: none\n")
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
    assert {"link1": "panda_link1", "link2": "panda_link2", "reason": "Adjacent"} in [pair.attrib for pair in pairs]


def test_show_prints_the_denavit_hartenberg_table(optiplan, optiplan_json):
    code, out, _ = optiplan("robots", "show", "srra")
    assert code == 0
    assert "standard convention" in out
    rows = [line.split() for line in out.splitlines()]
    assert ["link_2", "revolute", "q", "-", "90", "0", "0", "0"] in rows
    assert ["elbow", "fixed", "0", "0", "0.975", "0"] in rows
    data = optiplan_json("robots", "show", "srra")[1]
    assert len(data["dh"]["rows"]) == 8
    assert optiplan_json("robots", "show", "ur5")[1]["dh"] is None


def test_show_takes_a_group(optiplan, optiplan_json):
    data = optiplan_json("robots", "show", "delbot", "--group", "base")[1]
    assert [joint["name"] for joint in data["joints"]] == ["base_x", "base_y", "base_yaw"]
    assert (data["group"], sorted(data["groups"])) == ("base", ["all", "arm", "base", "hand"])
    assert "group base (planned)" in optiplan("robots", "show", "delbot", "--group", "base")[1]
    code, out, err = optiplan("robots", "show", "delbot", "--group", "legs")
    assert (code, out) == (2, "")
    assert "all, arm, base" in err


def test_export_writes_a_urdf_to_a_file_or_to_stdout(optiplan, tmp_path):
    code, out, _ = optiplan("robots", "export", "puma560", "--to", "urdf", tmp_path / "p.urdf")
    assert code == 0
    assert "puma560 written to" in out
    code, printed, _ = optiplan("robots", "export", "puma560")
    assert (code, printed) == (0, (tmp_path / "p.urdf").read_text())
    root = ElementTree.fromstring(printed.encode())
    limit = root.find("joint[@name='joint_2']/limit").attrib
    assert (float(limit["velocity"]), float(limit["effort"])) == (0.94, 186.4)
    code, out, err = optiplan("robots", "export", "puma560", "--to", "mjcf")
    assert (code, out) == (2, "")
    assert "choose from: urdf" in err
