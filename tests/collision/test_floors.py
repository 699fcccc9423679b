"""Floors of pairs: their formula, pairs that are built nearer, and the core's distances above them."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan._core import variants
from optiplan.collision import floors
from optiplan.collision.bodies_and_pairs import with_asked_checked
from optiplan.collision.floors import KEPT, floors_of, with_built
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.robot.robot import load_robot
from optiplan.trajectory.trajectory import Trajectory

native = pytest.mark.skipif(variants() == ("none",), reason="the native core is not built")


@pytest.fixture(scope="module")
def panda():
    return load_robot("panda")


@pytest.fixture(scope="module")
def ready(panda):
    return np.array(panda.configurations["ready"], float)


@pytest.fixture(scope="module")
def scene(panda, ready):
    """A box 2 mm below the hand, as it stands ready, and a wall far off."""
    data = panda.model.createData()
    pin.framesForwardKinematics(panda.model, data, ready)
    low = data.oMf[panda.frame_id("panda_hand_tcp")].translation
    box, wall = Box((0.3, 0.3, 0.1)), Box((0.1, 1.0, 1.0))
    bodies = [Obstacle("box", box, pin.SE3(np.eye(3), low)), Obstacle("wall", wall, pin.SE3(np.eye(3), np.ones(3)))]
    model = CollisionModel(panda, Scene(bodies[:1]))
    lift = next(dz for dz in np.arange(0.0, 0.2, 5e-4) if _apart(model, bodies[0], ready, dz) > 0.002)
    return Scene(bodies).moved("box", z=-float(lift))


def _apart(model, box, q, dz):
    moved = model.with_obstacles_moved(Scene([box]).moved("box", z=-float(dz)))
    return moved.clearance(q).distance


def test_links_that_are_built_nearer_are_kept_on_disk_to_the_last_bit(panda, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    safety, robot = op.Safety(own=0.005), panda.with_proved_checked()
    made = floors._kept_built(safety, robot)
    assert made == floors._built(safety, robot) != ()
    monkeypatch.setattr(floors, "_built", None)
    assert floors._kept_built(safety, robot) == made
    for other in ((op.Safety(own=0.006), robot), (safety, panda)):  # of which nothing is kept
        with pytest.raises(TypeError):
            floors._kept_built(*other)


def test_a_nearer_pair_begins_at_a_share_of_its_distance_and_grows(panda, ready, scene):
    model = CollisionModel(panda, scene)
    safety = op.Safety(0.01, own=0.004, within=0.4).ending_at([ready])
    floors = floors_of(model, safety)
    assert {one.end for one in floors.near} == {0}
    found = {(model.pairs[one.pair].name_a, model.pairs[one.pair].name_b): one for one in floors.near}
    assert {name for pair in found for name in pair} <= {"box", "panda_hand", "panda_leftfinger", "panda_rightfinger"}
    one = min(floors.near, key=lambda one: one.distance)
    assert one.distance == model.distance(ready, one.pair).distance < 0.003
    assert one.base == KEPT * one.distance
    pairs = np.array([one.pair])

    def floor(q, reach):
        return float(floors.over(pairs, q[None], np.full((1, 7), reach))[0])

    away = ready + np.array([0.1, -0.05, 0, 0, 0, 0, 0.05])
    assert floor(ready, 0.0) == pytest.approx(one.base)
    assert floor(away, 0.0) == pytest.approx(one.base + (0.01 - one.base) * 0.2 / 0.4)
    assert floor(ready + 0.1, 0.0) == pytest.approx(0.01)
    assert floor(away, 0.01) == pytest.approx(one.base + (0.01 - one.base) * (0.2 + 0.07) / 0.4)
    rng = np.random.default_rng(0)
    near = rng.uniform(-0.01, 0.01, (100, 7))
    assert all(floor(away + d, 0.0) <= floor(away, 0.01) + 1e-15 for d in near)  # an upper bound of the interval
    assert set(floors.asked[[pair.index for pair in model.pairs if pair.name_b in ("box", "wall")]]) == {0.01}
    assert (floors.asked[[pair.index for pair in model.pairs if pair.name_b.startswith("panda")]] <= 0.004).all()


def test_what_a_robot_is_built_like_needs_no_more_than_it_has(panda):
    """With all pairs checked, links 0 and 1 pass each other at a millimetre wherever the joint between them stands."""
    robot = panda.with_proved_checked()
    safety = with_built(op.Safety(own=0.005), robot)
    model = CollisionModel(robot, Scene())
    floors = floors_of(model, safety)
    built = {frozenset((model.pairs[one.pair].name_a, model.pairs[one.pair].name_b)): one for one in floors.near}
    one = built[frozenset(("panda_link0", "panda_link1"))]
    assert one.end == -1
    assert 0.0 < one.base == floors.asked[one.pair] < one.distance < 0.005
    assert frozenset(("panda_link5", "panda_link7")) not in built  # these can meet
    assert with_built(op.Safety(0.005), robot).built == ()


def test_links_that_are_often_nearer_keep_from_touching():
    """Baxter's forearm turns in the shell of its elbow; it is nearer than 5 mm in a third of all configurations."""
    problem = op.load_problem("11_baxter").with_parts(clearance=0.005)
    (one,) = problem.safety.built
    assert one.links == ("left_upper_elbow_visual", "left_upper_forearm")
    assert one.floor == 0.0 < one.distance < 0.005
    model = CollisionModel(problem.robot, problem.scene)
    floors = floors_of(model, problem.safety)
    held = {floors.asked[pair.index] for pair in model.pairs if {pair.name_a, pair.name_b} == set(one.links)}
    assert held == {0.0}


def test_a_first_link_that_is_near_its_table_wherever_it_turns_needs_no_more(panda):
    table = Obstacle("table", Box((1.0, 1.0, 0.02)), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.05])))
    scene = Scene([table], allowed=[("table", "panda_link0")])
    model = CollisionModel(panda, scene)
    (pair,) = (pair for pair in model.pairs if {pair.name_a, pair.name_b} == {"table", "panda_link1"})
    least = min(model.distance(np.array([q, 0, 0, 0, 0, 0, 0]), pair.index).distance for q in np.linspace(-2.8, 2.8, 9))
    moved = scene.moved("table", z=least - 0.002)
    floors = floors_of(CollisionModel(panda, moved), op.Safety(0.005))
    (one,) = floors.near
    assert one.end == -1
    assert one.distance == pytest.approx(0.002, abs=2e-4)
    assert floors.asked[pair.index] == one.base == KEPT * one.distance


def test_what_is_held_needs_no_more_from_the_tool_that_holds_it(panda, ready):
    tool = op.Box("tool", size=(0.02, 0.02, 0.1), position=(0, 0, 0.2)).attached_to("panda_hand")
    part = op.Box("part", size=(0.04, 0.04, 0.04), position=(0, 0, 0.272)).attached_to("panda_hand")  # 2 mm beyond it
    model = CollisionModel(panda, Scene([], [tool, part]))
    (pair,) = (pair for pair in model.pairs if {pair.name_a, pair.name_b} == {"tool", "part"})
    safety = with_built(op.Safety(0.005, own=0.005), panda)
    floors = floors_of(model, safety)
    (one,) = (one for one in floors.near if one.pair == pair.index)
    assert one.end == -1
    assert one.distance == pytest.approx(0.002, abs=1e-9)
    assert floors.asked[pair.index] == one.base == KEPT * one.distance
    assert all(model.bounds.depends[near.pair].any() for near in floors.near if near is not one)


def test_only_joints_that_move_a_pair_count_and_none_that_is_on_its_way(panda, ready, scene):
    model = CollisionModel(panda, scene)
    safety = op.Safety(0.3, own=0.004, within=2.0)
    floors = floors_of(model, safety.ending_at([ready]))
    fewer = {one.pair: one for one in floors.at_ends if not model.bounds.depends[one.pair].all()}
    assert fewer
    rng = np.random.default_rng(3)
    for pair, one in fewer.items():
        moved = model.bounds.depends[pair]
        q = ready + rng.uniform(0.0, 0.05, 7)
        wanted = one.base + (one.asked - one.base) * np.abs(q - ready)[moved].sum() / 2.0
        near, far = np.where(moved, q, ready), np.where(moved, q, q + 0.7)
        for at in (near, far):
            assert floors.over(np.array([pair]), at[None], np.zeros((1, 7)))[0] == pytest.approx(wanted, rel=1e-9)
    turning = ready.copy()
    turning[3] = np.nan
    kept = {one.pair for one in floors_of(model, safety.ending_at([turning])).at_ends}
    assert kept == {one.pair for one in floors.at_ends if not model.bounds.depends[one.pair, 3]}
    assert kept < {one.pair for one in floors.at_ends}


@native
def test_the_core_tells_what_is_left_above_the_floors(panda, ready, scene):
    safety = op.Safety(0.03, own=0.01, within=0.4).ending_at([ready])
    model = CollisionModel(panda, scene)
    asked = planning_model(panda, Scene(scene.obstacles, safety=safety))
    assert not asked.collides(ready)
    assert planning_model(panda, Scene(scene.obstacles, safety=op.Safety(0.03))).collides(ready)
    rng = np.random.default_rng(1)
    Q = ready + rng.uniform(-0.06, 0.06, (60, 7))
    plain, found = (one.near(Q, 0.05) for one in (planning_model(panda, scene), asked))
    distances = {(row, pair): d for row, pair, d in zip(plain.rows, plain.pairs, plain.distance, strict=True)}
    checked = 0
    for row, pair, left in zip(found.rows.tolist(), found.pairs.tolist(), found.distance, strict=True):
        whole = distances.get((row, pair), 1.0)
        if whole < 0.0 or whole == 1.0:
            continue  # depths of meshes are those of their hulls; beyond the cutoff
        floor = asked.floors.over(np.array([pair]), Q[row][None], np.zeros((1, 7)))[0]
        assert left == pytest.approx(whole - floor, abs=3e-6)
        checked += 1
    assert checked > 50
    colliding = [asked.collides(q) for q in Q]
    assert 5 < sum(colliding) < 55
    for q, touches in zip(Q, colliding, strict=True):
        pairs = np.arange(len(model.pairs))
        floor = asked.floors.over(pairs, np.tile(q, (len(pairs), 1)), np.zeros((len(pairs), 7)))
        least = min(model.distance(q, p).distance - floor[p] for p in np.flatnonzero(floor > 0).tolist())
        assert touches == (least < 0.0) or abs(least) < 1e-5


@native
def test_edges_and_sweeps_that_the_core_proves_keep_the_floors(panda, ready, scene):
    safety = op.Safety(0.03, own=0.01, within=0.4).ending_at([ready])
    asked = planning_model(panda, Scene(scene.obstacles, safety=safety))
    model, check = CollisionModel(panda, scene), MotionCheck(asked, panda.limits)
    rng = np.random.default_rng(2)
    verdicts = []
    for _ in range(30):
        end = ready + rng.uniform(-0.12, 0.12, 7)
        line = Trajectory(panda.joint_names, np.array([0.0, 1.0]), np.array([[ready, end - ready]]))
        free, swept = check.free(ready, end), first_contact(asked, line) is None
        assert free == swept
        verdicts.append(free)
        if not free:
            continue
        for q in line(np.linspace(0.0, 1.0, 21)):
            near = [contact for contact in model.contacts(q, 0.03) if contact.distance < 0.03]
            pairs = np.array([contact.pair.index for contact in near], dtype=int)
            floor = asked.floors.over(pairs, np.tile(q, (len(near), 1)), np.zeros((len(near), 7)))
            assert all(contact.distance > least for contact, least in zip(near, floor, strict=True))
    assert 2 < sum(verdicts) < 28


def test_links_of_two_arms_that_are_proved_apart_are_checked_where_more_than_that_is_asked():
    arms = {"left": {"use": "planar2r", "base": op.Pose((0, 3.0, 0))}, "right": "planar2r"}
    robot = op.Robot.side_by_side(arms)
    between = {pair for pair, why in robot.allowed.items() if why == "proved" and pair[0][:4] != pair[1][:4]}
    assert between
    checked = with_asked_checked(op.Safety(own=0.005), robot)
    assert robot.allowed.keys() - checked.allowed.keys() == between
    assert with_asked_checked(op.Safety(0.005, own=0.005), robot) is checked
    assert with_asked_checked(op.Safety(0.005), robot) is robot
    assert with_asked_checked(None, robot) is robot
