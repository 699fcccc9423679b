import pickle
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.config.document import Document
from optiplan.errors import InputError, UnknownChoiceError
from optiplan.problem.from_data import planned_robot
from optiplan.robot import loaded_robots
from optiplan.robot import robot as robot_module
from optiplan.robot.frames import with_tool_of
from optiplan.robot.loaded_robots import LoadedRobots
from optiplan.robot.robot import load_robot, robot_file, robot_names
from tests.robot.robots import TWO, chain, joint, write_robot

SHIPPED = {
    "baxter": 14,
    "baxter_left": 7,
    "baxter_report": 7,
    "delbot": 9,
    "panda": 7,
    "planar2r": 2,
    "puma560": 6,
    "srra": 6,
    "two_links": 2,
    "ur3": 6,
    "ur5": 6,
}
OWN = {"baxter_report", "delbot", "planar2r", "puma560", "srra", "two_links"}
"""Robots whose files were all written here."""


def touching(robot, q):
    data, results = robot.model.createData(), robot.geometry.createData()
    pin.computeCollisions(robot.model, data, robot.geometry, results, q, False)
    hits = [
        pair
        for pair, result in zip(robot.geometry.collisionPairs, results.collisionResults, strict=False)
        if result.isCollision()
    ]
    return [(robot.link_of(pair.first), robot.link_of(pair.second)) for pair in hits]


def issues_of(path, **options):
    with pytest.raises(InputError) as caught:
        load_robot(str(path), **options)
    return "\n".join(str(issue) for issue in caught.value.issues)


def test_the_shipped_robots_are_listed():
    assert robot_names() == sorted(SHIPPED)


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_shipped_robots_are_ready_to_plan(name):
    robot = load_robot(name)
    assert robot.n == SHIPPED[name] == robot.model.nq == robot.model.nv
    assert list(robot.model.names)[1:] == list(robot.joint_names)
    assert not [note for note in robot.notes if "limit" in note]
    for q in robot.configurations.values():
        assert (q >= robot.limits.lower).all()
        assert (q <= robot.limits.upper).all()
        assert touching(robot, q) == []
    assert robot.model.existFrame(robot.tool_frame)
    assert (robot.source.parent / "LICENSE").is_file() == (name not in OWN)


def test_panda_has_the_makers_limits_and_tool():
    robot = load_robot("panda")
    assert robot.limits.velocity.tolist() == [2.175] * 4 + [2.61] * 3
    assert robot.limits.acceleration.tolist() == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert robot.limits.jerk.tolist() == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
    assert robot.limits.torque.tolist() == [87] * 4 + [12] * 3
    frames = robot.model.frames
    hand, tool = (frames[robot.model.getFrameId(name)] for name in ("panda_hand", "panda_hand_tcp"))
    assert np.allclose((hand.placement.inverse() * tool.placement).translation, [0, 0, 0.1034])


def test_planar2r_reaches_where_its_drawing_says():
    robot = load_robot("planar2r")
    data = robot.model.createData()
    q = np.array([0.3, -1.1])
    pin.framesForwardKinematics(robot.model, data, q)
    tool = data.oMf[robot.model.getFrameId("tool")].translation
    expected = [0.5 * np.cos(0.3) + 0.6 * np.cos(-0.8), 0.18, 0.5 - 0.5 * np.sin(0.3) - 0.6 * np.sin(-0.8)]
    assert np.allclose(tool, expected)


def test_visuals_are_read_when_asked_for(monkeypatch):
    monkeypatch.setattr(robot_module, "_loaded", LoadedRobots())  # another test may have asked the one of this process
    robot = load_robot("panda")
    assert "visual" not in vars(robot)
    assert robot.visual.ngeoms == 11
    assert all(item.parentJoint < robot.model.njoints for item in robot.visual.geometryObjects)


def test_a_pickled_robot_is_the_same_robot(tmp_path):
    path = write_robot(tmp_path, TWO, "group: [j1]\n")
    robot = load_robot(str(path), locked={"j2": 0.7})
    again = pickle.loads(pickle.dumps(robot))
    assert again.locked == {"j2": 0.7}
    assert again.fingerprint == robot.fingerprint
    q = np.array([0.4])
    tools = []
    for each in (robot, again):
        data = each.model.createData()
        pin.framesForwardKinematics(each.model, data, q)
        tools.append(data.oMf[each.model.getFrameId("c")].translation)
    assert np.array_equal(*tools)


def test_the_fingerprint_follows_the_contents_not_the_place(tmp_path):
    first = load_robot(str(write_robot(tmp_path / "a", TWO)))
    second = load_robot(str(write_robot(tmp_path / "b", TWO)))
    third = load_robot(str(write_robot(tmp_path / "c", TWO, "tool_frame: c\n")))
    assert first.fingerprint == second.fingerprint != third.fingerprint


def test_three_lines_are_enough(tmp_path):
    robot = load_robot("robot.yaml", write_robot(tmp_path, TWO).parent)
    assert robot.joint_names == ("j1", "j2")
    assert robot.limits.velocity.tolist() == [3, 3]
    assert robot.limits.torque.tolist() == [4, 4]
    assert robot.limits.acceleration.tolist() == [10, 10]
    assert robot.limits.jerk.tolist() == [500, 500]
    assert robot.tool_frame == "c"
    assert [note for note in robot.notes if "10 rad/s²" in note]
    assert [note for note in robot.notes if "500 rad/s³" in note]


def test_joints_outside_the_group_stand_still(tmp_path):
    path = write_robot(tmp_path, TWO, "group: [j2]\nlocked: {j1: 9}\n")
    robot = load_robot(str(path))
    assert robot.locked == {"j1": 9}
    assert [note for note in robot.notes if "beyond its own limits" in note]
    assert robot.allowed[("a", "b")] == "fixed"
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.zeros(1))
    turned = data.oMf[robot.model.getFrameId("c")].translation
    assert np.allclose(turned, [0.5 + 0.5 * np.cos(9), 0.5 * np.sin(9), 0])


def test_without_a_value_a_locked_joint_stands_in_its_limits(tmp_path):
    parts = chain(
        joint("j1", "a", "b", inside='<limit lower="0.5" upper="1" velocity="1" effort="1"/>'), joint("j2", "b", "c")
    )
    assert load_robot(str(write_robot(tmp_path, parts, "group: [j2]\n"))).locked == {"j1": 0.5}


def test_named_groups(tmp_path):
    text = "groups: {front: [j1], back: [j2]}\n"
    assert load_robot(str(write_robot(tmp_path, TWO, text + "group: back\n"))).joint_names == ("j2",)
    assert load_robot(str(write_robot(tmp_path, TWO, text))).joint_names == ("j1",)
    assert "unknown group 'bakc'; expected one of: front, back (did you mean 'back'?)" in issues_of(
        write_robot(tmp_path, TWO, text + "group: bakc\n")
    )
    named = load_robot(str(write_robot(tmp_path, TWO, "groups: {None: [j1], back: [j2]}\ntool_frames: {None: a}\n")))
    assert with_tool_of(named, "None", ["j2"]).tool_frame == "a"
    assert with_tool_of(named, None, ["j2"]) is named
    data = {"robot": str(named.source), "group": "back", "task": [{"move": {"joints": [0.5]}}]}
    assert planned_robot(Document(tmp_path / "p.yaml", data, {}), tmp_path).joint_names == ("j2",)


@pytest.mark.parametrize(
    ("yaml", "line", "words"),
    [
        ("group: [j2, j1]\n", 4, "base-to-tip order: [j1, j2]"),
        ("group: [j1, j3]\n", 4, "group[1]: unknown joint 'j3'; expected one of: j1, j2"),
        ("group: []\n", 4, "at least one joint"),
        ("group: [j1, j1]\n", 4, "base-to-tip order: [j1]"),
        ("tool_frame: tip\n", 4, "unknown frame 'tip'; expected one of: "),
        ("limits: {velocity: [1, 2, 3]}\n", 4, "a list of 3 values; expected 2"),
        ("limits:\n  jerk: -1\n", 5, "limits.jerk: -1; expected a number > 0"),
        ("limits: {jerk: [1, .nan]}\n", 4, "limits.jerk[1]: NaN; expected a finite number"),
        ("configurations: {home: [0, 0, 0]}\n", 4, "configurations.home: a list of 3 values; expected 2"),
        ("locked: {j9: 1}\n", 4, "locked.j9: unknown joint 'j9'; expected none, since"),
        ("locked: {j1: 1}\n", 4, "the planned joint 'j1'"),
        ("collision: box\n", 4, "collision: 'box'; expected 'auto', 'hull', 'mesh' or 'convex_pieces'"),
        ("collision: {mesh: [z]}\n", 4, "collision.mesh[0]: unknown link 'z'; expected one of: a, b, c"),
        ("collision: {mesh: [a], hull: [a]}\n", 4, "link 'a', which is under hull too"),
        ("speed: 3\n", 4, "unknown key 'speed'; expected one of: version, name, urdf"),
        ("srdf: none.srdf\n", None, "expected a readable SRDF file"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, yaml, line, words):
    text = issues_of(write_robot(tmp_path, TWO, yaml))
    assert words in text
    assert line is None or f"robot.yaml:{line}:" in text


def test_several_issues_come_together(tmp_path):
    text = issues_of(write_robot(tmp_path, TWO, "limits: {velocity: 0, jerk: [1]}\n"))
    assert "limits.velocity: 0" in text
    assert "limits.jerk: a list of 1 value" in text


def test_locked_joints_given_by_a_problem_are_checked(tmp_path):
    path = write_robot(tmp_path, TWO, "group: [j1]\n")
    assert "locked.j7: unknown joint 'j7'" in issues_of(path, locked={"j7": 0.0})


@pytest.mark.parametrize(
    ("line", "instead", "words"),
    [
        ("version: 1", "version: 2", "version: 2; expected 1"),
        ("name: r", r'name: "a\x1b[2J"', "expected text of one line without control characters"),
        ("name: r", 'name: r\nconfigurations: {"a\\x1b[2J": [0, 0]}', r"configurations.a\x1b[2J"),
    ],
)
def test_the_version_is_1_and_names_are_printable(tmp_path, line, instead, words):
    path = write_robot(tmp_path, TWO)
    path.write_text(path.read_text().replace(line, instead))
    assert words in issues_of(path)


def test_references(tmp_path):
    path = write_robot(tmp_path, TWO)
    assert robot_file(".", tmp_path) == path
    assert robot_file("robot.yaml", tmp_path) == path
    with pytest.raises(UnknownChoiceError, match=r"unknown robot .pamda.; choose from: .*panda"):
        robot_file("pamda")
    assert "No such file" in issues_of(tmp_path / "other.yaml")


def test_a_robot_is_read_once_wherever_it_is_referred_to_from(tmp_path, monkeypatch):
    monkeypatch.setattr(loaded_robots, "_SETTLED", -1e9)  # else files written just now are read again
    path = write_robot(tmp_path / "arm", TWO)
    write_robot(tmp_path / "other/arm", TWO, "group: [j1]\n")
    robot = load_robot(str(path))
    assert load_robot("arm", tmp_path) is robot
    assert load_robot("../arm/robot.yaml", tmp_path / "other") is robot
    assert load_robot("arm", tmp_path / "other").joint_names == ("j1",)
    assert load_robot("panda", tmp_path) is load_robot("panda")


def test_the_foreign_panda_keeps_its_fingers(shared):
    robot = load_robot(str(shared / "robots/mbm_panda/robot.yaml"))
    assert robot.n == 7
    assert len([note for note in robot.notes if "is fixed in the URDF" in note]) == 2
    assert set(robot.link_geometry.values()) == {"hull"}
    assert robot.configurations["ready"].tolist() == [0, -0.785, 0, -2.356, 0, 1.571, 0.785]
    assert robot.configurations["extended"].tolist() == [0, 0, 0, 0, 0, 1.571, 0.785]  # from the SRDF
    assert touching(robot, robot.configurations["ready"]) == []


def test_a_messy_arm_of_three_lines(shared, tmp_path):
    urdf = shared / "robots/srra_report/urdf/robot_2.urdf"
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: messy\nurdf: {urdf}\ncollision: hull\n")
    robot = load_robot(str(tmp_path))
    assert robot.n == 6
    assert robot.geometry.ngeoms == 7
    assert set(robot.link_geometry.values()) == {"hull"}


@pytest.mark.parametrize("name", ["vehicle_assembly", "vehicle_assembly_moveit"])
def test_a_messy_vehicle(shared, tmp_path, name):
    urdf = shared / f"robots/delbot_report/urdf/{name}.urdf"
    srdf = tmp_path / "none.srdf"  # spares the sampling, which test_pairs tests
    srdf.write_text("<robot name='messy'/>")
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: messy\nurdf: {urdf}\nsrdf: none.srdf\ncollision: hull\n")
    robot = load_robot(str(tmp_path))
    assert robot.joint_names == ("ur3_joint_1", "ur3_joint_2", "ur3_joint_5", "ur3_joint_8", "ur3_joint_9", "ee_joint")
    assert any("planned is the longest chain of joints, ur3_joint_1" in note for note in robot.notes)
    assert robot.geometry.ngeoms == 50
    assert np.isfinite(robot.limits.velocity).all()


def test_a_pickled_robot_keeps_what_was_replaced():
    robot = load_robot("planar2r")
    changed = replace(robot.with_tool("forearm"), limits=replace(robot.limits, velocity=0.5 * robot.limits.velocity))
    again = pickle.loads(pickle.dumps(changed))
    assert again.tool_frame == "forearm"
    np.testing.assert_array_equal(again.limits.velocity, changed.limits.velocity)


def test_unknown_frames_are_told_with_the_valid_ones():
    with pytest.raises(UnknownChoiceError, match=r"unknown frame 'nose'.*forearm"):
        load_robot("planar2r").with_tool("nose")
