"""Which pairs of links go unchecked, and why."""

import pytest

from optiplan.errors import InputError
from optiplan.robot.robot import load_robot
from optiplan.robot.self_collision import pair_survey
from optiplan.robot.self_collision.pair_proof import GAP
from optiplan.robot.self_collision.pairs import (
    ADJACENT,
    FILE,
    FIXED,
    PROVED,
    count_reasons,
    reasons_in_words,
    srdf_words,
)
from optiplan.robot.urdf.srdf import read_srdf, srdf_text
from tests.robot.robots import BARE, LINK, TWO, chain, joint, write_robot

FREE = '<limit lower="-3" upper="3" velocity="3" effort="4"/>'
FOLDING = chain(*(joint(f"j{i}", a, b, inside=FREE) for i, (a, b) in enumerate(["ab", "bc", "cd"])))
"""Boxes of 0.1 m on joints 0.5 m apart: the last comes back to the first ones, its neighbours never touch."""


pytestmark = pytest.mark.usefixtures("own_cache")


def checked(robot):
    return {frozenset((robot.link_of(p.first), robot.link_of(p.second))) for p in robot.geometry.collisionPairs}


def test_reasons_of_pairs(tmp_path):
    robot = load_robot(str(write_robot(tmp_path / "r", FOLDING)))
    assert checked(robot) == {frozenset("ac"), frozenset("ad"), frozenset("bd")}
    assert robot.allowed == dict.fromkeys([("a", "b"), ("b", "c"), ("c", "d")], PROVED)  # neighbours keep 0.4 m
    assert 0.0 < robot.survey.rates[("a", "c")] < 0.2


BAR = '<box size="{0} 0.1"/>'
STIFF = '<limit lower="-0.3" upper="0.3" velocity="3" effort="4"/>'


def test_pairs_proved_never_to_meet_go_unchecked(tmp_path):
    parts = chain(joint("j1", "a", "b", inside=STIFF), joint("j2", "b", "c", inside=STIFF))
    robot = load_robot(str(write_robot(tmp_path / "r", parts)))
    assert robot.allowed[("a", "c")] == PROVED
    assert checked(robot) == set()


def folded_back(folder, gap, yaml=""):
    """Boxes a, b, c of 0.1 m that hardly move: b stands 0.5 m from a, and c between them at `gap` from a."""
    still = '<limit lower="-1e-4" upper="1e-4" velocity="3" effort="4"/>'
    parts = chain(joint("j1", "a", "b", inside=still), joint("j2", "b", "c", inside=still, x=gap - 0.4))
    return load_robot(str(write_robot(folder, parts, yaml)))


def test_touching_where_the_robot_stands_is_no_reason(tmp_path):
    robot = folded_back(tmp_path / "r", -0.02)
    assert frozenset("ac") in checked(robot)
    assert robot.survey.rates[("a", "c")] == 1.0
    assert any("touch in nearly every configuration: a-c" in note for note in robot.notes)


def test_a_narrow_gap_is_proved_or_checked(tmp_path):
    assert folded_back(tmp_path / "far", 0.005).allowed[("a", "c")] == PROVED
    assert checked(folded_back(tmp_path / "near", 0.5 * GAP)) == {frozenset("ac")}


def test_pairs_of_the_robot_file(tmp_path):
    robot = folded_back(tmp_path / "r", -0.02, "allowed_collisions: [[c, a]]\n")
    assert robot.allowed[("a", "c")] == FILE
    assert not any("nearly every" in note for note in robot.notes)
    with pytest.raises(InputError, match=r"robot.yaml:4: allowed_collisions\[0\]\[1\]: unknown link 'x'"):
        folded_back(tmp_path / "wrong", -0.02, "allowed_collisions: [[c, x]]\n")


@pytest.mark.parametrize(("share", "reason"), [(1.0, ADJACENT), (0.6, None), (0.0, PROVED)])
def test_neighbours_go_unchecked_only_where_they_touch_all_along(tmp_path, share, reason):
    """A bar of 0.3 m turns about the middle of a box that reaches under it over part of its turn, or all of it."""
    lower, upper = {1.0: (-1.0, 1.0), 0.6: (-1.0, 3.0), 0.0: (2.0, 3.0)}[share]
    bodies = [
        f'<link name="{name}"><collision><origin xyz="{x} 0 0"/><geometry>{size}</geometry></collision></link>'
        for name, x, size in (("a", 0.3, BAR.format("0.2 1")), ("b", 0.2, BAR.format("0.4 0.1")))
    ]
    limit = f'<limit lower="{lower}" upper="{upper}" velocity="3" effort="4"/>'
    robot = load_robot(str(write_robot(tmp_path / "r", [*bodies, joint("j", "a", "b", inside=limit, x=0)])))
    assert robot.allowed.get(("a", "b")) == reason
    assert robot.survey.rates[("a", "b")] == pytest.approx(share, abs=0.1)


def test_links_without_bodies_do_not_make_neighbours(tmp_path):
    """Two joints with a bare link between: the pair is moved by both, so touching is no excuse."""
    parts = [LINK.format("a"), BARE.format("x"), LINK.format("b")]
    joints = [joint("j1", "a", "x", inside=STIFF, x=0.04), joint("j2", "x", "b", inside=STIFF, x=0.04)]
    robot = load_robot(str(write_robot(tmp_path / "r", [*parts, *joints])))
    assert checked(robot) == {frozenset("ab")}
    assert robot.bare_links == ("x",)


def test_locked_joints_make_neighbours(tmp_path):
    parts = [LINK.format("a"), BARE.format("x"), LINK.format("b")]
    joints = [joint("j1", "a", "x", inside=STIFF, x=0.04), joint("j2", "x", "b", inside=STIFF, x=0.04)]
    robot = load_robot(str(write_robot(tmp_path / "r", [*parts, *joints], "group: [j1]\n")))
    assert robot.allowed == {("a", "b"): ADJACENT}


def test_links_that_a_locked_joint_folds_into_each_other_are_no_neighbours(tmp_path):
    """c is bent back into a, beside b; the joint that is planned turns about an axis that c crosses."""
    body = '<link name="{}"><collision><origin xyz="{} 0 {}"/><geometry>{}</geometry></collision></link>'
    sizes = (("a", 0, 0, "0.2 0.2"), ("b", 0.4, 0.3, "0.1 0.1"), ("c", 0.25, 0.05, "0.5 0.1"))
    bodies = [body.format(name, x, z, BAR.format(size)) for name, x, z, size in sizes]
    joints = [joint("j1", "a", "b", inside=FREE, x=0), joint("j2", "b", "c", inside=FREE)]
    lock = "group: [j1]\nlocked: {{j2: {0}}}\n"
    robot = load_robot(str(write_robot(tmp_path / "bent", [*bodies, *joints], lock.format(3.0))))
    assert ("a", "c") not in robot.allowed
    assert robot.survey.rates[("a", "c")] == 1.0
    straight = load_robot(str(write_robot(tmp_path / "straight", [*bodies, *joints], lock.format(0.0))))
    assert straight.allowed[("a", "c")] == PROVED


def test_a_slide_without_end_is_never_proved(tmp_path):
    limit = '<limit lower="-1e30" upper="1e30" velocity="3" effort="4"/>'
    parts = chain(joint("j", "a", "b", "prismatic", inside=limit))
    robot = load_robot(str(write_robot(tmp_path / "r", parts)))
    assert checked(robot) == {frozenset("ab")}


def test_a_joint_without_end_is_proved_over_one_turn(tmp_path):
    robot = load_robot(str(write_robot(tmp_path / "r", chain(joint("j", "a", "b", "continuous", inside="")))))
    assert robot.allowed == {("a", "b"): PROVED}


def test_links_that_nothing_moves_against_each_other_are_fixed(tmp_path):
    parts = chain(joint("j1", "a", "b"), joint("f", "b", "c", "fixed", inside=""))
    assert load_robot(str(write_robot(tmp_path / "r", parts))).allowed[("b", "c")] == FIXED


def test_reasons_are_counted_in_words():
    allowed = {("a", "b"): ADJACENT, ("a", "c"): PROVED, ("a", "d"): PROVED, ("b", "c"): "SRDF: Never"}
    words = "4 pairs of links not checked: 1 adjacent, 2 proved never to meet, 1 disabled by the SRDF"
    assert reasons_in_words(count_reasons(allowed)) == words
    assert reasons_in_words({}) == "0 pairs of links not checked"


def test_surveys_are_repeatable_and_kept(tmp_path, own_cache, monkeypatch):
    path = write_robot(tmp_path / "r", FOLDING)
    first = load_robot(str(path))
    (kept,) = own_cache.glob("pairs/*.json")
    with monkeypatch.context() as patch:
        patch.setattr(pair_survey, "_Survey", None)  # neither loading nor showing makes it again
        again = load_robot(str(path))
        assert again.allowed == first.allowed
        assert again.survey == first.survey
    kept.unlink()
    assert load_robot(str(path)).survey == first.survey
    path.with_name("robot.urdf").write_text(
        path.with_name("robot.urdf").read_text().replace('lower="-3"', 'lower="-2"')
    )
    load_robot(str(path))
    assert len(list(own_cache.glob("pairs/*.json"))) == 2  # other limits, another box


def test_a_survey_of_some_pairs_says_of_them_what_one_of_all_says(tmp_path, own_cache):
    robot = load_robot(str(write_robot(tmp_path / "r", FOLDING)))
    limits = robot.limits.lower, robot.limits.upper
    among = pair_survey.survey_pairs(robot.model, robot.geometry, limits, {("a", "c"), ("c", "d")})
    assert dict(among.rates) == {pair: robot.survey.rates[pair] for pair in (("a", "c"), ("c", "d"))}
    assert among.proved == robot.survey.proved & {("a", "c"), ("c", "d")} == {("c", "d")}
    assert len(list(own_cache.glob("pairs/*.json"))) == 2


def test_a_survey_in_parts_says_the_same(tmp_path, own_cache, monkeypatch):
    robot = load_robot(str(write_robot(tmp_path / "r", FOLDING)))
    monkeypatch.setattr(pair_survey, "_ROWS", 50)
    limits = robot.limits.lower, robot.limits.upper
    assert pair_survey._Survey(robot.model, robot.geometry, limits, None).make() == robot.survey


def test_without_geometry_there_is_nothing_to_prove(tmp_path):
    parts = [BARE.format("a"), BARE.format("b"), joint("j", "a", "b")]
    with pytest.raises(InputError, match=r"robot.yaml:3: urdf: .*without any collision geometry.*`collision: none`"):
        load_robot(str(write_robot(tmp_path / "r", parts)))
    robot = load_robot(str(write_robot(tmp_path / "none", parts, "collision: none\n")))
    assert robot.geometry.ngeoms == 0
    assert any("no contact of it is checked" in note for note in robot.notes)


def test_a_cache_that_cannot_be_written_is_no_hindrance(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert load_robot(str(write_robot(tmp_path / "r", FOLDING))).allowed


def test_written_srdf_gives_the_same_pairs(tmp_path):
    path = write_robot(tmp_path / "r", FOLDING)
    robot = load_robot(str(path))
    (path.parent / "r.srdf").write_text(srdf_text(robot.name, srdf_words(robot.allowed)))
    path.write_text(path.read_text() + "srdf: r.srdf\n")
    again = load_robot(str(path))
    assert again.allowed.keys() == robot.allowed.keys()
    assert checked(again) == checked(robot)


def test_only_what_the_srdf_names_is_left_out(tmp_path):
    path = write_robot(tmp_path / "r", TWO, "srdf: r.srdf\nconfigurations: {home: [0, 0]}\n")
    states = (
        '<group_state name="home"><joint name="j1" value="1"/><joint name="j2" value="1"/></group_state>'
        '<group_state name="away"><joint name="j2" value="0.5"/><joint name="j1" value="1"/></group_state>'
        '<group_state name="part"><joint name="j1" value="1"/></group_state>'
        '<group_state name="odd"><joint name="j1" value="1 2"/></group_state>'
        '<group_state name="away"><joint name="j1" value="0.1"/></group_state>'
        '<group_state name="nan"><joint name="j1" value="nan"/><joint name="j2" value="0"/></group_state>'
        '<group_state name="comma"><joint name="j1" value="0"/><joint name="j2" value="1,57"/></group_state>'
        '<group_state name="a&#x9b;2J"><joint name="j1" value="1"/><joint name="j2" value="0"/></group_state>'
    )
    (path.parent / "r.srdf").write_text(f'<robot name="r"><disable_collisions link1="c" link2="a"/>{states}</robot>')
    robot = load_robot(str(path))
    assert checked(robot) == {frozenset("ab"), frozenset("bc")}
    assert robot.allowed == {("a", "c"): "SRDF: User"}
    assert {name: q.tolist() for name, q in robot.configurations.items()} == {"home": [0, 0], "away": [1, 0.5]}
    assert "left out: state nan of the SRDF, in which 'nan' of j1 is not finite" in robot.notes
    assert "left out: state comma of the SRDF, in which '1,57' of j2 is no number" in robot.notes
    assert r"left out: state a\x9b2J of the SRDF, a name with characters that are not printable" in robot.notes
    assert not any("state odd" in note for note in robot.notes)


def test_a_broken_srdf(tmp_path):
    (tmp_path / "r.srdf").write_text("<robot>\n<oops")
    with pytest.raises(InputError, match=r"r\.srdf:2: srdf: .*expected well-formed XML"):
        read_srdf(tmp_path / "r.srdf", {})
