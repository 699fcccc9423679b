"""Denavit–Hartenberg tables: against matrices typed here, against the source reports, against the URDF made of them."""

import json

import coal
import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.geometry.scene import Scene
from optiplan.robot.dh.table import DhRow, DhTable, forward, frames
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf.export import export_urdf

SHIPPED = ("srra", "puma560", "delbot")


def rz(t):
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, t), np.zeros(3)).homogeneous


def rx(t):
    return pin.SE3(pin.rpy.rpyToMatrix(t, 0.0, 0.0), np.zeros(3)).homogeneous


def shift(x, z):
    return pin.SE3(np.eye(3), np.array([x, 0.0, z])).homogeneous


def table(convention, *rows):
    return DhTable(convention, tuple(DhRow(*row) for row in rows))


ROWS = ((0.3, 0.7, 0.2, 0.1, "revolute"), (0.1, -0.4, 0.5, 0.3, None), (-0.2, 1.1, 0.4, -0.6, "prismatic"))


def test_the_standard_row_is_its_four_factors():
    q = np.array([0.9, 0.25])
    expected = np.eye(4)
    for (a, alpha, d, theta, _), turn, slide in zip(ROWS, (0.9, 0.0, 0.0), (0.0, 0.0, 0.25), strict=True):
        expected = expected @ rz(theta + turn) @ shift(0, d + slide) @ shift(a, 0) @ rx(alpha)
    assert np.allclose(forward(table("standard", *ROWS), q), expected, atol=1e-15)


def test_the_modified_row_is_its_four_factors():
    q = np.array([0.9, 0.25])
    expected = np.eye(4)
    for (a, alpha, d, theta, _), turn, slide in zip(ROWS, (0.9, 0.0, 0.0), (0.0, 0.0, 0.25), strict=True):
        expected = expected @ rx(alpha) @ shift(a, 0) @ rz(theta + turn) @ shift(0, d + slide)
    assert np.allclose(forward(table("modified", *ROWS), q), expected, atol=1e-15)


def test_many_configurations_at_once_are_each_alone():
    Q = np.random.default_rng(1).uniform(-3, 3, (5, 2))
    chain = table("standard", *ROWS)
    assert frames(chain, Q).shape == (5, 4, 4, 4)
    assert np.array_equal(forward(chain, Q), [forward(chain, q) for q in Q])
    with pytest.raises(ValueError, match="found 3 joint values; expected 2"):
        forward(chain, np.zeros(3))


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_a_table_loads_as_the_chain_it_says(tmp_path, convention):
    """With prismatic and fixed rows, offsets, a pose of the first frame, and degrees."""
    text = f"""
dh:
  convention: {convention}
  unit: deg
  position: [0.1, 0.2, 0.3]
  rpy: [10, 20, 30]
  radius: 0.02
  rows:
    - {{joint: revolute, a: 0.3, alpha: 40, d: 0.2, theta: 5, limits: [-180, 90]}}
    - {{a: 0.1, alpha: -25, d: 0.5, theta: 17}}
    - {{joint: prismatic, a: -0.2, alpha: 63, d: 0.4, theta: -35, limits: [-0.1, 0.6]}}
    - {{joint: revolute}}
tool_frame: link_4
"""
    robot = load_robot(str(write(tmp_path, text)))
    assert robot.joint_names == ("joint_1", "joint_2", "joint_3")
    assert np.allclose(robot.limits.lower, [-np.pi, -0.1, -np.inf], atol=1e-15)
    assert np.allclose(robot.limits.upper, [np.pi / 2, 0.6, np.inf], atol=1e-15)
    assert robot.dh.rows[1] == DhRow(0.1, np.radians(-25), 0.5, np.radians(17), None, "link_2")
    base = pin.SE3(pin.rpy.rpyToMatrix(*np.radians([10, 20, 30])), np.array([0.1, 0.2, 0.3])).homogeneous
    data = robot.model.createData()
    for q in np.random.default_rng(2).uniform(-0.1, 0.6, (100, 3)):
        pin.framesForwardKinematics(robot.model, data, q)
        for X, name in zip(frames(robot.dh, q)[1:], ("link_1", "link_2", "link_3", "link_4"), strict=True):
            assert np.allclose(data.oMf[robot.model.getFrameId(name)].homogeneous, base @ X, rtol=0, atol=1e-12)


def write(folder, text):
    folder.mkdir(exist_ok=True)
    (folder / "robot.yaml").write_text(f"version: 1\nname: r\n{text}")
    return folder / "robot.yaml"


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_capsules_stand_along_the_offsets_of_links_without_bodies(tmp_path, convention):
    """Their axes run from joint axis to joint axis, whatever alpha: here from frame 0 to the last, without a gap."""
    text = (
        f"dh:\n  convention: {convention}\n  unit: deg\n  radius: 0.02\n  rows:\n"
        "    - {joint: revolute, a: 0.3, alpha: 40, d: 0.2, theta: 5}\n"
        "    - {joint: revolute, a: 0.1, alpha: -25, d: 0.5}\n    - {joint: revolute, d: 0.15}\n"
    )
    robot = load_robot(str(write(tmp_path, text)))
    data, q = robot.model.createData(), np.array([0.4, -0.8, 0.2])
    pin.framesForwardKinematics(robot.model, data, q)
    ends = []
    for item in robot.geometry.geometryObjects:
        assert isinstance(item.geometry, coal.Capsule)
        assert item.geometry.radius == 0.02
        X = data.oMi[item.parentJoint] * item.placement
        ends += [X * np.array([0.0, 0.0, s * item.geometry.halfLength]) for s in (-1.0, 1.0)]
    lengths = sorted(2 * item.geometry.halfLength for item in robot.geometry.geometryObjects)
    shown = [0.1, 0.15, 0.2, 0.3, 0.5]
    points = frames(robot.dh, q)[:, :3, 3]
    if convention == "modified":  # the first a lies on the base, which has no body by default
        shown.remove(0.3)
        points = points[1:]
        ends.append(points[0])
    assert np.allclose(lengths, shown)
    for end in (*points[1:], points[0]):
        assert min(np.linalg.norm(end - other) for other in ends) < 1e-12


def test_inertia_follows_from_bodies_and_mass(tmp_path):
    text = (
        "dh:\n  convention: standard\n  unit: rad\n  rows:\n    - joint: revolute\n      mass: 3\n      geometry:\n"
        "        - {box: [0.1, 0.2, 0.5], position: [0, 0, 0.25]}\n"
        "        - {box: [0.1, 0.2, 1.0], position: [0, 0, 1.0]}\n"
    )
    inertia = load_robot(str(write(tmp_path, text))).model.inertias[1]
    whole = pin.Inertia.FromBox(3.0, 0.1, 0.2, 1.5)
    assert inertia.mass == pytest.approx(3.0, abs=1e-12)
    assert np.allclose(inertia.lever, [0, 0, 0.75], atol=1e-12)
    assert np.allclose(inertia.inertia, whole.inertia, atol=1e-12)


def test_inertia_of_round_bodies_is_that_of_points_inside(tmp_path):
    """Against a sum over random points, which no formula of the program is made of."""
    text = (
        "dh:\n  convention: standard\n  unit: deg\n  rows:\n    - joint: revolute\n      mass: 2\n      geometry:\n"
        "        - {capsule: {radius: 0.1, length: 0.3}, position: [0.2, 0, 0.1], rpy: [30, 40, 50]}\n"
    )
    inertia = load_robot(str(write(tmp_path, text))).model.inertias[1]
    points = np.random.default_rng(3).uniform(-0.25, 0.25, (400_000, 3))
    beyond = np.maximum(np.abs(points[:, 2]) - 0.15, 0.0)
    points = points[np.hypot(np.hypot(points[:, 0], points[:, 1]), beyond) <= 0.1]
    points = points @ pin.rpy.rpyToMatrix(*np.radians([30, 40, 50])).T
    expected = 2.0 * (np.eye(3) * (points**2).sum(1).mean() - points.T @ points / len(points))
    assert np.allclose(inertia.lever, [0.2, 0, 0.1], atol=1e-12)
    assert np.allclose(inertia.inertia, expected, atol=2e-4)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("urdf: a.urdf\ndh: {convention: standard, unit: rad, rows: [{}]}\n", None, "exactly one of: urdf, dh"),
        ("tool_frame: a\n", None, "neither urdf nor dh; expected exactly one of: urdf, dh"),
        ("dh:\n  convention: craig\n  unit: rad\n  rows: [{}]\n", 4, "dh.convention: 'craig'; expected 'standard' or"),
        ("dh:\n  convention: standard\n  rows: [{}]\n", 3, "dh.unit: nothing"),
        ("ROWS    - {}\n    - {joint: revolute, alpa: 1}\n", 8, "dh.rows[1].alpa: unknown key 'alpa'; expected one of"),
        ("ROWS    - {joint: revolute}\n    - {a: x}\n", 8, "dh.rows[1].a: 'x'; expected a number"),
        ("ROWS    - {joint: sliding}\n", 7, "dh.rows[0].joint: 'sliding'; expected 'revolute' or 'prismatic'"),
        ("ROWS    - {joint: prismatic}\n", 7, "dh.rows[0]: a prismatic joint without limits"),
        ("ROWS    - {joint: revolute, limits: [2, 1]}\n", 7, "limits [2, 1]; expected lower <= upper"),
        ("ROWS    - {limits: [1, 2]}\n", 7, "without a joint"),
        ("ROWS    - {joint: revolute, alpha: 90}\n", 3, "dh: 90; expected angles in rad, within a turn (6.2832); for"),
        ("ROWS    - {name: x, joint: revolute}\n    - {name: x}\n", 7, "the name 'x', which comes 2 times"),
        ("ROWS    - {joint: revolute, mass: 2}\n", 7, "dh.rows[0].mass: a mass of 2 kg without a body"),
        ("ROWS    - {joint: revolute, mass: 2, geometry: [{sphere: 1.0e-200}]}\n", 7, "bodies enclose no volume"),
        ("ROWS    - {joint: revolute, geometry: [{sphere: 1.0e9}]}\n", None, "expected a number ≤ 1000000"),
        ("ROWS    - {joint: revolute, mass: 2, centre: [0, 0, 0]}\n", 7, "mass alone, or all three"),
        (
            "ROWS    - {joint: revolute, mass: 2, centre: [0, 0, 0], inertia: [1, -1, 1]}\n",
            7,
            "dh.rows[0].inertia[1]: -1; expected a number ≥ 0",
        ),
        ("ROWS    - {joint: revolute, geometry: [{}]}\n", 7, "no shape; expected exactly one of: box, sphere"),
        ("ROWS    - {joint: revolute, geometry: [{sphere: 1, box: [1, 1, 1]}]}\n", 7, "found box and sphere"),
        ("ROWS    - {joint: revolute}\n  parent: post\n", 8, "dh.parent: unknown link 'post'; expected one of"),
        ("ROWS    - {joint: revolute}\n  parent: link_1\n", 8, "'link_1', a row of the table itself"),
        ("ROWS    - {joint: revolute}\n  links: [{name: a, parent: b}]\n", 8, "dh.links[0].parent: unknown link 'b'"),
        (
            "ROWS    - {joint: revolute}\n  links:\n    - {name: a, parent: b}\n    - {name: b, parent: link_1}\n",
            9,
            "'b', which comes later; expected a link above",
        ),
        ("ROWS    - {joint: revolute}\n  links: [{name: a, parent: link_1, axis: [0, 0, 0]}]\n", 8, "axis of length 0"),
    ],
)
def test_what_is_wrong_is_said_with_line_and_row(tmp_path, text, line, words):
    text = text.replace("ROWS", "dh:\n  convention: standard\n  unit: rad\n  rows:\n")
    with pytest.raises(InputError) as caught:
        load_robot(str(write(tmp_path, text)))
    told = str(caught.value)
    assert words.removeprefix("found ") in told
    assert line is None or any(issue.line == line for issue in caught.value.issues), told


def test_what_is_wrong_in_a_table_without_a_file_is_reported(tmp_path):
    """Found in the URDF that is made of it, which has no file either."""
    dh = {"convention": "standard", "unit": "rad", "rows": [{"joint": "revolute", "a": 2e5, "limits": [-1, 1]}]}
    words = "link_1_fixed: <origin> with xyz='200000.0 "
    with pytest.raises(InputError, match=f"<robot>: dh: {words}"):
        load_robot({"dh": dh, "collision": "none"})
    text = f"version: 1\nstart: {{joints: [0]}}\ngoal: {{joints: [0.5]}}\nrobot:\n  dh: {json.dumps(dh)}\n"
    (tmp_path / "p.yaml").write_text(text)
    found = [(issue.line, issue.field) for issue in op.check(tmp_path / "p.yaml") if issue.found.startswith(words)]
    assert found == [(5, "robot.dh")]


@pytest.mark.parametrize("name", SHIPPED)
def test_the_exported_urdf_is_the_same_robot(tmp_path, name):
    robot = load_robot(name)
    (tmp_path / "r.urdf").write_text(export_urdf(robot))
    group = "group: [" + ", ".join(robot.joint_names) + "]\n"
    locked = "locked: {" + ", ".join(f"{joint}: {value!r}" for joint, value in robot.locked.items()) + "}\n"
    again = load_robot(str(write(tmp_path, f"urdf: r.urdf\n{group}{locked}tool_frame: {robot.tool_frame}\n")))
    assert_same(robot, again)


@pytest.mark.parametrize("name", ["planar2r", "ur3"])
def test_a_robot_of_a_urdf_is_exported_too(tmp_path, name):
    robot = load_robot(name)
    (tmp_path / "r.urdf").write_text(export_urdf(robot))
    assert_same(robot, load_robot(str(write(tmp_path, f"urdf: r.urdf\ntool_frame: {robot.tool_frame}\n"))))


def assert_same(robot, again):
    for key in ("lower", "upper", "velocity", "torque"):
        assert np.allclose(getattr(robot.limits, key), getattr(again.limits, key), rtol=0, atol=1e-12), key
    one, two = robot.model.createData(), again.model.createData()
    lower, upper = np.maximum(robot.limits.lower, -9.0), np.minimum(robot.limits.upper, 9.0)
    for q in np.random.default_rng(4).uniform(lower, upper, (100, robot.n)):
        pin.framesForwardKinematics(robot.model, one, q)
        pin.framesForwardKinematics(again.model, two, q)
        for i, frame in enumerate(robot.model.frames):
            other = two.oMf[again.model.getFrameId(frame.name, frame.type)]
            assert np.allclose(one.oMf[i].homogeneous, other.homogeneous, rtol=0, atol=1e-12)
    for a, b in zip(robot.geometry.geometryObjects, again.geometry.geometryObjects, strict=True):
        assert type(a.geometry) is type(b.geometry)
        assert a.geometry == b.geometry
        assert np.allclose(a.placement.homogeneous, b.placement.homogeneous, rtol=0, atol=1e-12)
    for a, b in zip(robot.model.inertias, again.model.inertias, strict=True):
        assert np.allclose(a.matrix(), b.matrix(), rtol=0, atol=1e-12)


def pose_of(robot, q, frame=None):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array(q, dtype=float))
    return data.oMf[robot.model.getFrameId(frame or robot.tool_frame)].homogeneous


def test_srra_home_and_alternate():
    """Reference srra.fk.home and srra.fk.alternate, to their 1e-12."""
    robot = load_robot("srra")
    home = [[0, 0, 1, 0.8899], [0, -1, 0, 0], [1, 0, 0, 1.1309], [0, 0, 0, 1]]
    alternate = [[0, -1, 0, 0], [1, 0, 0, -1.1309], [0, 0, 1, 0.8899], [0, 0, 0, 1]]
    for name, expected in (("home", home), ("alternate", alternate)):
        q = robot.configurations[name]
        assert np.allclose(pose_of(robot, q), expected, rtol=0, atol=1e-12)
        assert np.allclose(forward(robot.dh, q), expected, rtol=0, atol=1e-12)


def test_srra_has_eight_rows_for_six_joints():
    """Reference srra.dh.rows, tolerance 0."""
    half = np.pi / 2
    rows = [(0, -half, 0, 0), (0, 0, 0, -half), (0.975, 0, 0, 0), (0.1559, -half, 0, 0)]
    rows += [(0, 0, 0.74492, 0), (0, half, 0, 0), (0, -half, 0, 0), (0, 0, 0.14498, 0)]
    dh = load_robot("srra").dh
    assert [(row.a, row.alpha, row.d, row.theta) for row in dh.rows] == rows
    assert [row.joint is None for row in dh.rows] == [False, False, True, False, True, False, False, False]
    assert dh.convention == "standard"


FULL_TURNS = [(q1, q3) for q3 in (-90, -60, -30, 0, 30, 60) for q1 in (-40, -20, 0, 20, 40)] + [(-70, 0), (70, 0)]


@pytest.mark.parametrize(("q1", "q3"), FULL_TURNS)
def test_joint_2_of_srra_turns_full_circle_past_the_base(q1, q3):
    """What the published meshes do not allow: srra.urdf.joint2_full_turn."""
    robot = load_robot("srra")
    model = CollisionModel(robot, Scene())
    assert ("base_link", "link_2") in [tuple(sorted((p.name_a, p.name_b))) for p in model.pairs]
    for q2 in range(-360, 360, 3):
        assert not model.collides(np.radians([q1, q2, q3, 0, 0, 0])), q2


def test_srra_has_room_for_the_query_of_the_report():
    """Both states of srra.moveit.states and the line between them are free, as with the bodies of the report."""
    model = CollisionModel(load_robot("srra"), Scene())
    home, goal = np.array([0.0, 0.0, 0.0, -0.0269, 0.0, 0.0]), np.array([-3.1415, -2.8638, 0.2256, -1.3017, 0.0, 0.0])
    assert not [s for s in np.linspace(0.0, 1.0, 501) if model.collides(home + s * (goal - home))]


def test_joint_5_of_srra_turns_full_circle():
    """What the published meshes do not allow: srra.urdf.joint4_clash. Link 6 passes link 4, checked link by link."""
    robot = load_robot("srra")
    data, results = robot.model.createData(), robot.geometry.createData()
    geometry = robot.geometry.copy()
    geometry.removeAllCollisionPairs()
    links = [robot.link_of(i) for i in range(len(geometry.geometryObjects))]
    for i, a in enumerate(links):
        for j, b in enumerate(links[i + 1 :], i + 1):
            if {a, b} in ({"link_4", "link_6"}, {"link_3", "link_6"}, {"link_3", "link_5"}):
                geometry.addCollisionPair(pin.CollisionPair(i, j))
    results = geometry.createData()
    for q5 in range(-180, 180, 2):
        q = np.radians([0, 0, 0, 0, q5, 0])
        assert not pin.computeCollisions(robot.model, data, geometry, results, q, True), q5


def test_puma_reaches_the_lectures_poses_from_both_base_conventions():
    """Reference lecture.puma560.dh, lecture.example3.poses and .ik (branch run), the joints to their nine decimals."""
    q1 = [0.805806906, 1.062491618, -3.646824915, 0.0, -0.557259356, -2.335785748]
    q2 = [-0.121488312, 1.062491618, -3.646824915, -1.674046209, -1.506659724, -2.124740557]
    T1 = np.array([[1, 0, 0, 0.4], [0, -1, 0, 0.2], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    T2 = np.array([[1, 0, 0, 0.4], [0, 0, -1, -0.2], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    robot = load_robot("puma560")
    pedestal = np.zeros((4, 4))
    pedestal[2, 3] = 0.67183
    low = DhTable("standard", (DhRow(0, np.pi / 2, 0, 0, "revolute"), *robot.dh.rows[1:]))
    for q, T in ((q1, T1), (q2, T2)):
        assert np.allclose(pose_of(robot, q), T + pedestal, rtol=0, atol=3e-9)
        assert np.allclose(forward(low, np.array(q)), T, rtol=0, atol=3e-9)
        assert (np.array(q) > robot.limits.lower).all()
        assert (np.array(q) < robot.limits.upper).all()


def test_delbots_matrix_points_and_mount():
    """Reference delbot.dh, delbot.T0eff.home, delbot.Tbeff.home, delbot.points, to their tolerances."""
    robot = load_robot("delbot", group="arm")
    T0eff = np.array([[1, 0, 0, -0.4569], [0, 0, -1, -0.19425], [0, 1, 0, 0.06655], [0, 0, 0, 1]])
    assert np.allclose(forward(robot.dh, np.zeros(6)), T0eff, rtol=0, atol=1e-12)
    mount = pose_of(robot, np.zeros(6), "arm_base")
    assert np.allclose(np.linalg.inv(mount) @ pose_of(robot, np.zeros(6), "wrist_3"), T0eff, rtol=0, atol=1e-12)
    assert np.allclose(mount, [[1, 0, 0, 0.163], [0, 1, 0, 0], [0, 0, 1, 0.279], [0, 0, 0, 1]], rtol=0, atol=1e-12)
    printed = np.array([[1, 0, 0, 0.163], [0, -1, 0, 0], [0, 0, -1, 0.279], [0, 0, 0, 1]])
    figure_7 = [[1, 0, 0, -0.2939], [0, 0, 1, 0.19425], [0, -1, 0, 0.21245], [0, 0, 0, 1]]
    assert np.allclose(printed @ T0eff, figure_7, rtol=0, atol=1e-12)
    final = forward(robot.dh, np.array([0, np.pi / 2, np.pi / 2, np.pi / 3, 0, 0]))[:3, 3]
    assert np.allclose(final, [0.1393347317869982, -0.19425, -0.049075], rtol=0, atol=1e-9)
    assert np.linalg.norm(final - T0eff[:3, 3]) == pytest.approx(0.6073425689132, abs=1e-9)


def test_delbot_weighs_what_the_report_says():
    assert sum(inertia.mass for inertia in load_robot("delbot").model.inertias) == pytest.approx(46.233, abs=0.01)
