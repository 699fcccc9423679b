"""Neighbours are proved once for all angles: rings about the axis, boxes of angles, the cache, the certificate."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from optiplan import cache
from optiplan.collision.model import CollisionModel
from optiplan.geometry.coal_queries import coal_mesh
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.geometry.shapes import Sphere
from optiplan.robot.robot import Robot, load_robot
from optiplan.verify.collision_check import collision
from optiplan.verify.continuous import kept_clearance
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.kept_clearance import prove_kept_clearances
from optiplan.verify.continuous.rings import near_rings
from optiplan.verify.report import VerifyPolicy
from tests.verify.motions import problem_of, quintic

GAP = 2e-4
"""m, between the two discs of the robot, wherever its first joint stands."""

STOP = 1.0
"""rad: around where the arm meets the stop."""

ROBOT = """<robot name="discs"><link name="base"><collision><geometry><mesh filename="base.obj"/></geometry></collision>
</link><link name="disc"><collision><geometry><mesh filename="disc.obj"/></geometry></collision></link>
<link name="tip"><collision><origin xyz="0.3 0 0"/><geometry><mesh filename="tip.obj"/></geometry></collision></link>
<joint name="turn" type="{kind}"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="2" effort="9"/></joint>
<joint name="lift" type="revolute"><origin xyz="0 0 0.03"/><parent link="disc"/><child link="tip"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="0.1" velocity="2" effort="9"/></joint></robot>"""


STAND = """<robot name="discs"><link name="base"/>
<link name="disc"><collision><geometry><mesh filename="disc.obj"/></geometry></collision></link>
<link name="stand"><collision><geometry><mesh filename="base.obj"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="2" effort="9"/></joint>
<joint name="{mount}" type="fixed"><parent link="base"/><child link="stand"/></joint></robot>"""
"""The lower disc on a link of its own, whose place among the bodies the name of its joint decides."""


def box(size: tuple[float, float, float], at: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


def disc(z: float) -> trimesh.Trimesh:
    made = trimesh.creation.cylinder(0.05, 0.02, sections=16)
    return made.apply_translation((0.0, 0.0, z))


def robot_in(folder: Path, kind: str = "revolute", stop: bool = True, urdf: str = ROBOT) -> Robot:
    """A disc that turns above another one, with an arm that may meet a stop; and a tip that is lifted."""
    folder.mkdir(exist_ok=True)
    place = (0.065 * np.cos(STOP), 0.065 * np.sin(STOP), 0.01)
    base = [disc(-0.01 - GAP)] + [box((0.01, 0.01, 0.04), place)] * stop
    trimesh.util.concatenate(base).export(folder / "base.obj")
    trimesh.util.concatenate([disc(0.01), box((0.05, 0.01, 0.01), (0.05, 0.0, 0.012))]).export(folder / "disc.obj")
    box((0.4, 0.02, 0.02), (0.0, 0.0, 0.0)).export(folder / "tip.obj")
    (folder / "robot.urdf").write_text(urdf.format(kind=kind))
    (folder / "robot.yaml").write_text("version: 1\nname: discs\nurdf: robot.urdf\ncollision: mesh\n")
    return load_robot(str(folder))


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_in(tmp_path_factory.mktemp("discs"))


def moving(robot: Robot, begin: float, end: float, lift: float = -0.5):
    return quintic(robot.joint_names, [begin, -0.4], [end, lift], 3.0)


BALL = Obstacle("ball", Sphere(0.12), pin.SE3(np.eye(3), np.array([0.0, -0.35, 0.35])))


def test_the_gap_of_neighbours_takes_one_query_a_motion(robot: Robot) -> None:
    model, motion = CollisionModel(robot, Scene((BALL,))), moving(robot, -2.0, 0.2)
    proof = certify(model, motion, VerifyPolicy())
    assert proof.proved
    assert {model.pairs[k].name_a + model.pairs[k].name_b for k in proof.kept} >= {"basedisc"}
    assert proof.queries < 100  # thousands without what is kept: the discs are 0.2 mm apart
    assert 0.8 * GAP < proof.clearance <= GAP
    assert proof.nearest is not None
    assert proof.nearest.distance == pytest.approx(GAP, abs=1e-6)


def test_the_scene_is_told_apart_from_the_robot_itself(robot: Robot) -> None:
    scene, motion = Scene((BALL,)), moving(robot, -2.0, 0.2)
    check = collision(problem_of(robot, motion, scene), motion, VerifyPolicy())
    times = np.linspace(0.0, motion.duration, 100)
    model = CollisionModel(robot, scene)
    true = min(
        model.distance(q, k).distance for q in motion(times) for k, p in enumerate(model.pairs) if "ball" in p.name_b
    )
    witness = check.witness
    assert check.passed
    assert true > 10.0 * GAP
    assert 0.75 * min(true, 0.1) <= witness["scene_clearance"] <= true + 1e-6
    assert witness["self_clearance"] == witness["proved_clearance"] <= GAP
    assert witness["proved_by_robot"] >= 1
    assert "from the scene" in check.detail
    assert "proved once for this robot" in check.detail


def test_no_more_is_proved_of_a_pair_than_its_distance(robot: Robot) -> None:
    tables, model, rng = prove_kept_clearances(robot), CollisionModel(robot, Scene()), np.random.default_rng(3)
    assert tables
    pairs = {(pair.a, pair.b): k for k, pair in enumerate(model.pairs)}
    for pair, table in tables.items():
        Q = rng.uniform(robot.limits.lower, robot.limits.upper, (100, robot.n))
        reach = rng.uniform(0.0, 0.05, Q.shape)
        least = table.least(Q, reach)
        for q, d, bound in zip(Q, reach, least, strict=True):
            inside = np.clip(q + rng.uniform(-1.0, 1.0, robot.n) * d, robot.limits.lower, robot.limits.upper)
            assert bound <= model.distance(inside, pairs[pair]).distance + 1e-9
    turn = tables[0, 1]
    touching = np.array([[STOP, 0.0]])
    assert turn.least(touching, np.zeros((1, 2)))[0] == -np.inf  # the arm stands in the stop
    beyond = np.array([[3.1, 0.0], [2.9, 0.0]])
    assert np.isinf(turn.least(beyond, np.array([[0.0, 0.0], [0.2, 0.0]]))).all()  # past the limits nothing is known


def test_the_arm_that_meets_the_stop_is_refused(robot: Robot) -> None:
    proof = certify(CollisionModel(robot, Scene()), moving(robot, 0.0, 1.5), VerifyPolicy())
    assert not proof.proved
    assert proof.contact


def test_more_clearance_than_is_kept_is_not_proved(robot: Robot) -> None:
    model, motion = CollisionModel(robot, Scene()), moving(robot, -2.0, 0.0)
    assert certify(model, motion, VerifyPolicy(clearance=0.5 * GAP)).proved
    proof = certify(model, motion, VerifyPolicy(clearance=1.5 * GAP))
    assert not proof.proved
    assert proof.contact
    assert proof.nearest is not None
    assert proof.nearest.distance == pytest.approx(GAP, abs=1e-6)


def test_turns_of_an_endless_joint_are_one(tmp_path: Path) -> None:
    robot = robot_in(tmp_path, "continuous", stop=False)
    model = CollisionModel(robot, Scene())
    proof = certify(model, moving(robot, 2.0, 9.0), VerifyPolicy())
    assert proof.proved
    assert proof.queries < 100
    table = prove_kept_clearances(robot)[0, 1]
    Q = np.array([[0.3, 0.0], [0.3 + 4.0 * np.pi, 0.0]])
    assert np.ptp(table.least(Q, np.full((2, 2), 1e-3))) == 0.0


def test_what_is_kept_is_read_again_and_made_again_where_it_is_damaged(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    said: list[str] = []
    made = prove_kept_clearances(robot, lambda words, share: said.append(words))
    assert "base – disc" in said
    said.clear()
    again = prove_kept_clearances(robot, lambda words, share: said.append(words))
    assert not said
    assert made.keys() == again.keys()
    assert all((made[pair].clearance == again[pair].clearance).all() for pair in made)
    (kept,) = (cache.cache_dir() / "clearances").iterdir()
    content = kept.read_bytes()
    kept.write_bytes(content[:100] + bytes([content[100] ^ 1]) + content[101:])
    prove_kept_clearances(robot, lambda words, share: said.append(words))
    assert "base – disc" in said


def test_another_body_is_another_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot whose stop is gone must not be judged by what was proved with it, nor the other way round."""
    free, stopped = robot_in(tmp_path / "free", stop=False), robot_in(tmp_path / "stopped")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # not before: loading surveys pairs, for seconds
    at = np.array([[STOP, 0.0]]), np.zeros((1, 2))
    assert prove_kept_clearances(free)[0, 1].least(*at)[0] > 0.0
    assert prove_kept_clearances(stopped)[0, 1].least(*at)[0] == -np.inf


def test_pairs_of_two_joints_share_the_boxes_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Links that are many meshes make many pairs; the work is that of a few."""
    robot = robot_in(tmp_path / "robot", stop=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    looked: list[int] = []
    own = kept_clearance._Maker._bounds

    def counted(maker, pair, joints, middle, half):  # type: ignore[no-untyped-def]
        looked.extend([len(middle)] * (len(joints) == 2))
        return own(maker, pair, joints, middle, half)

    monkeypatch.setattr(kept_clearance._Maker, "_bounds", counted)
    monkeypatch.setattr(kept_clearance, "_IN_ALL", 4)
    prove_kept_clearances(robot)
    assert 1 <= sum(looked) <= 8  # the boxes that pass the bound are those of the last halving


@pytest.mark.parametrize("mount", ["a_mount", "z_mount"])
def test_whichever_body_of_a_pair_the_joint_turns(mount: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_in(tmp_path / "robot", urdf=STAND.replace("{mount}", mount))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    model = CollisionModel(robot, Scene())
    (names,) = [(pair.name_a, pair.name_b) for pair in model.pairs]
    assert names == (("stand", "disc") if mount == "a_mount" else ("disc", "stand"))
    table = prove_kept_clearances(robot)[0, 1]
    Q = np.linspace(-2.9, 2.9, 117)[:, None]
    kept = table.least(Q, np.zeros_like(Q))
    true = np.array([model.distance(q, 0).distance for q in Q])
    assert (kept <= true + 1e-9).all()
    assert kept.max() > 0.8 * GAP
    assert not certify(model, quintic(robot.joint_names, [0.0], [1.5], 3.0), VerifyPolicy()).proved
    assert certify(model, quintic(robot.joint_names, [0.0], [-1.5], 3.0), VerifyPolicy()).proved


def test_a_body_inside_another_is_not_proved_clear_of_it(tmp_path: Path) -> None:
    """Rings of surfaces stay apart where one body turns inside the other."""
    robot_in(tmp_path)
    trimesh.creation.icosphere(3, 0.02).apply_translation((0.0, 0.0, 0.0)).export(tmp_path / "disc.obj")
    trimesh.creation.icosphere(3, 0.2).export(tmp_path / "base.obj")
    (tmp_path / "robot.yaml").write_text(
        "version: 1\nname: discs\nurdf: robot.urdf\ncollision: {hull: [base], mesh: [disc, tip]}\n"
    )
    robot = load_robot(str(tmp_path))
    assert (0, 1) not in prove_kept_clearances(robot)
    assert not certify(CollisionModel(robot, Scene()), moving(robot, 0.0, 0.5), VerifyPolicy()).proved


@pytest.mark.parametrize("seed", range(8))
def test_triangles_not_flagged_stay_apart_at_every_angle(seed: int) -> None:
    """Of random triangles, against distances at many angles of the pairs of which not both are flagged."""
    rng = np.random.default_rng(seed)
    one = rng.uniform(-1.0, 1.0, (6, 1, 3)) + rng.uniform(-0.3, 0.3, (6, 3, 3))
    other = rng.uniform(-1.0, 1.0, (6, 1, 3)) + rng.uniform(-0.3, 0.3, (6, 3, 3))
    gap = 0.15
    near = near_rings(one, other, gap)
    open_pairs = 0
    for i in range(6):
        for j in range(6):
            least = np.inf
            for angle in np.linspace(0.0, 2.0 * np.pi, 90):
                turned = other[j] @ pin.utils.rotate("z", angle).T
                a, b = (coal_mesh(corners) for corners in (one[i], turned))
                still, result = coal.Transform3s(), coal.DistanceResult()
                least = min(least, coal.distance(a, still, b, still, coal.DistanceRequest(), result))
            if near[0][i] and near[1][j]:
                open_pairs += 1
            else:
                assert least >= gap - 1e-6
    assert 0 < open_pairs < 36
