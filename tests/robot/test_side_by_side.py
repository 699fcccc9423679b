"""Several robots as one."""

import pickle
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.errors import InputError, UnknownChoiceError
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf.export import export_urdf
from tests.robot.robots import chain, joint, write_robot

FAR = {"use": "two_links", "base": op.Pose((0, 5.0, 0))}
THROUGH = {"use": "planar2r", "base": op.Pose((-0.263, -0.11, 0))}
"""In its first configuration its upper arm goes through the base of an arm at the origin."""
TURNED = op.Pose((0.1, -0.6, 0.2), rpy=(0.1, 0.2, 2.0))


@pytest.fixture(scope="module")
def arms():
    """A Panda with its hand and a turned planar arm."""
    robots = {"right": {"use": "panda", "base": TURNED}, "left": {"use": "planar2r", "base": op.Pose((0, 1.5, 0))}}
    return op.Robot.side_by_side(robots, group="all+right/hand")


def test_names_and_limits_are_those_of_the_arms_in_the_order_of_their_names(arms):
    panda, planar = load_robot("panda", group="arm+hand"), load_robot("planar2r")
    names = [f"left/{name}" for name in planar.joint_names] + [f"right/{name}" for name in panda.joint_names]
    assert list(arms.joint_names) == names
    for quantity in ("lower", "upper", "velocity", "acceleration", "jerk", "torque"):
        own = np.concatenate([getattr(planar.limits, quantity), getattr(panda.limits, quantity)])
        np.testing.assert_array_equal(getattr(arms.limits, quantity), own)
    np.testing.assert_array_equal(
        arms.configurations["ready"], np.concatenate([planar.configurations["ready"], panda.configurations["ready"]])
    )
    assert arms.tool_frames["right"] == "right/panda_hand_tcp"
    assert arms.name == "planar2r+panda"


def test_every_frame_is_where_the_arm_alone_has_it_at_its_base(arms):
    rng = np.random.default_rng(3)
    q = rng.uniform(arms.limits.lower, arms.limits.upper)
    bases = {"left": pin.SE3(np.eye(3), np.array([0, 1.5, 0])), "right": pin.SE3(*_parts(TURNED))}
    for name, own, at in (
        ("left", load_robot("planar2r"), q[:2]),
        ("right", load_robot("panda", group="arm+hand"), q[2:]),
    ):
        frames = [str(frame.name) for frame in own.model.frames[1:]]
        assert "panda_rightfinger" in frames or name == "left"  # a follower
        for frame in frames:
            expected = bases[name].homogeneous @ own.fk(at, frame).matrix
            np.testing.assert_allclose(arms.fk(q, f"{name}/{frame}").matrix, expected, atol=1e-12)


def _parts(pose):
    return pose.matrix[:3, :3], pose.matrix[:3, 3]


def test_torques_are_those_of_the_arms(arms):
    rng = np.random.default_rng(4)
    q, v, a = rng.uniform(-0.03, 0.03, (3, arms.n))
    tau = pin.rnea(arms.model, arms.model.createData(), q, v, a)
    own = load_robot("planar2r").model
    np.testing.assert_allclose(tau[:2], pin.rnea(own, own.createData(), q[:2], v[:2], a[:2]), atol=1e-12)


def test_pairs_of_two_arms_are_checked_unless_they_are_fixed_or_proved_apart(arms):
    assert ("left/base", "right/panda_link0") in arms.allowed
    checked = {
        tuple(sorted((arms.link_of(pair.first), arms.link_of(pair.second)))) for pair in arms.geometry.collisionPairs
    }
    assert any(a.startswith("left/") and b.startswith("right/panda_hand") for a, b in checked)
    panda = load_robot("panda", group="arm+hand")
    own = {(f"right/{a}", f"right/{b}") for a, b in panda.allowed}
    assert own == {pair for pair in arms.allowed if all(link.startswith("right/") for link in pair)}
    assert not checked & set(arms.allowed)


def test_an_arm_that_is_not_planned_stands_in_its_first_configuration_or_where_locked_says():
    robots = {"a": "planar2r", "b": {"use": "planar2r", "base": op.Pose((0, 2.0, 0))}}
    one = op.Robot.side_by_side(robots, group="a", locked={"b/elbow": 0.25})
    assert one.joint_names == ("a/shoulder", "a/elbow")
    assert one.locked == {"b/shoulder": 0.5, "b/elbow": 0.25}
    both = op.Robot.side_by_side(robots)
    np.testing.assert_allclose(one.fk([0.1, 0.2], "b/tool").matrix, both.fk([0, 0, 0.5, 0.25], "b/tool").matrix)
    again = pickle.loads(pickle.dumps(one))
    assert (again.fingerprint, again.locked, again.joint_names) == (one.fingerprint, one.locked, one.joint_names)


def test_the_urdf_holds_the_same_robot(arms, tmp_path):
    (tmp_path / "arms.urdf").write_text(export_urdf(arms))
    urdf = ET.parse(tmp_path / "arms.urdf").getroot()
    assert {link.get("name") for link in urdf.findall("link")} >= {"common_base", "right/panda_hand", "left/tool"}
    again = op.Robot.from_urdf(tmp_path / "arms.urdf", group=list(arms.joint_names), limits={"jerk": 1.0})
    q = arms.configurations["ready"]
    np.testing.assert_allclose(
        again.fk(q, "right/panda_rightfinger").matrix, arms.fk(q, "right/panda_rightfinger").matrix, atol=1e-9
    )


def test_a_joint_of_an_arm_may_be_called_base(tmp_path):
    path = write_robot(tmp_path, chain(joint("base", "a", "b")))
    arms = op.Robot.side_by_side({"x": str(path), "y": {"use": str(path), "base": op.Pose((0, 2.0, 0))}})
    (tmp_path / "arms.urdf").write_text(export_urdf(arms))
    assert op.Robot.from_urdf(tmp_path / "arms.urdf", group=["x/base", "y/base"]).n == 2


def test_the_urdf_has_the_materials_of_all_arms(tmp_path):
    colours = []
    for name, rgba in (("a", "1 0 0 1"), ("b", "0 0 1 1")):
        parts = chain(joint("j1", "a", "b"))
        visual = '<visual><geometry><sphere radius="0.1"/></geometry><material name="paint"/></visual>'
        parts[0] = parts[0].replace("</link>", f"{visual}</link>")
        material = f'<material name="paint"><color rgba="{rgba}"/></material>'
        path = write_robot(tmp_path / name, [material, *parts])
        colours.append(({"use": str(path), "base": op.Pose((0, 2.0 * len(colours), 0))}, rgba))
    arms = op.Robot.side_by_side({name: one for name, (one, _) in zip("ab", colours, strict=True)})
    root = ET.fromstring(export_urdf(arms))
    stated = {one.get("name"): one.find("color").get("rgba") for one in root.findall("material")}
    used = [
        link.find("visual/material").get("name") for link in root.findall("link") if link.find("visual") is not None
    ]
    assert [stated[name] for name in used] == [rgba for _, rgba in colours]


def test_up_to_eight_arms():
    robots = {f"arm{k}": {"use": "planar2r", "base": op.Pose((0, 2.0 * k, 0))} for k in range(8)}
    assert op.Robot.side_by_side(robots).n == 16
    with pytest.raises(InputError, match="at most 8"):
        op.Robot.side_by_side({**robots, "one_more": "planar2r"})


@pytest.mark.parametrize(
    ("robots", "keys", "words"),
    [
        ({"a": "planar2r"}, {}, "robots: .*at least 2"),
        ({"a": "planar2r", "b": "planar2r"}, {}, "robots.b.base: an arm that stands in a: a/base_0 and b/base_0"),
        ({"a": "planar2r", "b": THROUGH}, {"group": "a"}, "robots.b.base: an arm that stands in a: a/base_0 and b/"),
        ({"a": THROUGH, "b": "planar2r", "c": FAR}, {"group": "c"}, "b.base: an arm that stands in a: a/.*apart"),
        ({"a": "planar2r", "b": "planar3r"}, {}, "robots.b.use: unknown robot 'planar3r'.*did you mean 'planar2r'"),
        ({"a": "planar2r", "b/c": "ur5"}, {}, "b/c"),
        ({"a": "planar2r", "b": {"use": "ur5", "bse": 1}}, {}, "robots.b.bse: unknown key"),
        ({"a": "planar2r", "b": 3}, {}, r"robots\['b'\]: found the int 3.*robot.yaml"),
        (["planar2r", "ur5"], {}, "robots: .*arms by name"),
        ({"a": "planar2r", "b": {"use": {"urdf": "no.urdf"}}}, {}, "robots.b.use.urdf: .*no file"),
        ({"all": "planar2r", "b": FAR}, {}, "robots.all: an arm called 'all'.*group of all arms"),
        ({"a": load_robot("planar2r").holding({"elbow": 0.1}), "b": FAR}, {}, "locked joints or tool of its own"),
        ({"a": "planar2r", "b": FAR}, {"group": "c"}, "group: found 'c'.*one of: a"),
        ({"a": "planar2r", "b": FAR}, {"locked": {"a/elbow": 0.0}}, "locked.a/elbow: the planned joint"),
        ({"a": "planar2r", "b": FAR}, {"locked": {"elbow": 0.0}}, "locked.elbow: unknown"),
        ({"a": "planar2r", "b": FAR}, {"group": "a", "locked": {"c/elbow": 0.0}}, "locked.c/elbow: unknown"),
    ],
)
def test_wrong_arms_are_named(robots, keys, words):
    with pytest.raises(InputError, match=words):
        op.Robot.side_by_side(robots, **keys)


def test_a_robot_with_a_group_of_its_own_is_refused():
    with pytest.raises(InputError, match="`group` is of the whole"):
        op.Robot.side_by_side({"a": load_robot("panda", group="hand"), "b": "planar2r"})
    with pytest.raises(UnknownChoiceError):
        load_robot({"robots": {"a": "planar2r"}}, group="x") if False else load_robot("no_such_robot")
