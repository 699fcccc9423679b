import json

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError
from optiplan.model import cache
from optiplan.model.pairs import MARGIN, joined_links
from optiplan.model.robot import load_robot, write_srdf
from optiplan.model.srdf import read_srdf
from tests.model.robots import TWO, chain, joint, write_robot

FREE = '<limit lower="-3" upper="3" velocity="3" effort="4"/>'
FOLDING = chain(*(joint(f"j{i}", a, b, inside=FREE) for i, (a, b) in enumerate(["ab", "bc", "cd"])))
"""Boxes of 0.1 m on joints 0.5 m apart: the last comes back to the first ones, its neighbours never touch."""


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache/optiplan"


def checked(robot):
    return {frozenset((robot.link_of(p.first), robot.link_of(p.second))) for p in robot.geometry.collisionPairs}


def test_reasons_of_pairs(tmp_path):
    robot = load_robot(str(write_robot(tmp_path / "r", FOLDING)))
    assert checked(robot) == {frozenset("ac"), frozenset("ad"), frozenset("bd")}
    assert robot.allowed == {("a", "b"): "Adjacent", ("b", "c"): "Adjacent", ("c", "d"): "Adjacent"}


def test_pairs_that_cannot_reach_each_other_are_never_checked(tmp_path):
    stiff = '<limit lower="-0.3" upper="0.3" velocity="3" effort="4"/>'
    parts = chain(joint("j1", "a", "b", inside=stiff), joint("j2", "b", "c", inside=stiff))
    robot = load_robot(str(write_robot(tmp_path / "r", parts)))
    assert robot.allowed[("a", "c")] == "Never"
    assert checked(robot) == set()


def folded_back(folder, gap, yaml=""):
    """Boxes a, b, c of 0.1 m that hardly move: b stands 0.5 m from a, and c between them at `gap` from a."""
    still = '<limit lower="-1e-4" upper="1e-4" velocity="3" effort="4"/>'
    parts = chain(joint("j1", "a", "b", inside=still), joint("j2", "b", "c", inside=still, x=gap - 0.4))
    return load_robot(str(write_robot(folder, parts, yaml)))


def test_a_pair_nearer_than_the_margin_is_checked(tmp_path):
    assert checked(folded_back(tmp_path / "near", 0.5 * MARGIN)) == {frozenset("ac")}
    assert folded_back(tmp_path / "far", 3 * MARGIN).allowed[("a", "c")] == "Never"


def test_pairs_that_touch_where_the_robot_is_known_to_stand(tmp_path):
    robot = folded_back(tmp_path / "r", -0.02)
    assert robot.allowed[("a", "c")] == "Default"
    assert "not checked since they touch in the default configuration: a-c" in robot.notes


def test_pairs_that_touch_always(tmp_path):
    robot = folded_back(tmp_path / "r", -0.02, "configurations: {home: [3, 1]}\n")
    assert robot.allowed[("a", "c")] == "Always"
    assert "not checked since they touch in every sample: a-c" in robot.notes


def test_links_of_one_body_are_rigid(tmp_path):
    parts = chain(joint("j1", "a", "b"), joint("f", "b", "c", "fixed", inside=""))
    assert load_robot(str(write_robot(tmp_path / "r", parts))).allowed[("b", "c")] == "Rigid"


def test_sampling_is_repeatable_and_kept(tmp_path, own_cache):
    path = str(write_robot(tmp_path / "r", FOLDING))
    first = load_robot(path)
    (kept,) = own_cache.glob("pairs/*.json")
    name = str(kept.relative_to(own_cache))
    assert {(a, b): reason for a, b, reason in json.loads(cache.load(name))} == first.allowed
    cache.store(name, json.dumps([["a", "d", "User"]]).encode())
    assert load_robot(path).allowed == {("a", "d"): "User"}  # read from the cache
    kept.unlink()
    assert load_robot(path).allowed == first.allowed


def test_a_cache_that_cannot_be_written_is_no_hindrance(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert load_robot(str(write_robot(tmp_path / "r", FOLDING))).allowed


def test_written_srdf_gives_the_same_pairs(tmp_path):
    path = write_robot(tmp_path / "r", FOLDING)
    robot = load_robot(str(path))
    write_srdf(robot, path.parent / "r.srdf")
    path.write_text(path.read_text() + "srdf: r.srdf\n")
    again = load_robot(str(path))
    assert again.allowed == robot.allowed
    assert checked(again) == checked(robot)


def test_only_what_the_srdf_names_is_left_out(tmp_path):
    path = write_robot(tmp_path / "r", TWO, "srdf: r.srdf\nconfigurations: {home: [0, 0]}\n")
    states = (
        '<group_state name="home"><joint name="j1" value="1"/><joint name="j2" value="1"/></group_state>'
        '<group_state name="away"><joint name="j2" value="0.5"/><joint name="j1" value="1"/></group_state>'
        '<group_state name="part"><joint name="j1" value="1"/></group_state>'
        '<group_state name="odd"><joint name="j1" value="1 2"/></group_state>'
    )
    (path.parent / "r.srdf").write_text(f'<robot name="r"><disable_collisions link1="c" link2="a"/>{states}</robot>')
    robot = load_robot(str(path))
    assert checked(robot) == {frozenset("ab"), frozenset("bc")}
    assert robot.allowed == {("a", "c"): "User"}
    assert {name: q.tolist() for name, q in robot.configurations.items()} == {"home": [0, 0], "away": [1, 0.5]}


def test_a_broken_srdf(tmp_path):
    (tmp_path / "r.srdf").write_text("<robot>\n<oops")
    with pytest.raises(InputError, match=r"r\.srdf:2: srdf: .*expected well-formed XML"):
        read_srdf(tmp_path / "r.srdf", {})


def test_links_without_geometry_join_their_neighbours():
    edges = [("a", "x"), ("x", "b"), ("b", "c"), ("x", "y")]
    assert joined_links(edges, frozenset("abc")) == {("a", "b"), ("b", "c")}


@pytest.mark.parametrize("name", ["panda", "ur5", "ur3", "baxter_left"])
def test_pairs_never_checked_do_not_touch_in_fresh_samples(name):
    """Samples of another seed than the one that the shipped SRDF was made with."""
    robot = load_robot(name)
    never = [pair for pair, reason in robot.allowed.items() if reason == "Never"]
    index = {}
    for i in range(robot.geometry.ngeoms):
        index.setdefault(robot.link_of(i), []).append(i)
    robot.geometry.removeAllCollisionPairs()
    for a, b in never:
        for i in index.get(a, []):
            for j in index.get(b, []):
                robot.geometry.addCollisionPair(pin.CollisionPair(i, j))
    model_data, data = robot.model.createData(), robot.geometry.createData()
    samples = np.random.default_rng(7).uniform(robot.limits.lower, robot.limits.upper, (2000, robot.n))
    assert not any(pin.computeCollisions(robot.model, model_data, robot.geometry, data, q, True) for q in samples)
