"""A safety distance as a value: which bodies a name means, which of several distances holds, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.geometry.safety import BuiltNear, named_by


@pytest.mark.parametrize(
    ("pattern", "meant", "others"),
    [
        ("table", ["table"], ["tables", "a table", ""]),
        ("panda_*", ["panda_", "panda_link3"], ["my_panda_link3", "panda"]),
        ("*finger", ["panda_leftfinger", "finger"], ["fingers"]),
        ("panda_*finger", ["panda_leftfinger", "panda_finger"], ["panda_leftfingertip"]),
        ("a*b*a", ["aba", "a_b_a"], ["ab", "ba"]),
        ("aa*aa", ["aaaa", "aa.aa"], ["aaa"]),
        ("*", ["", "any"], []),
    ],
)
def test_a_star_stands_for_any_text(pattern, meant, others):
    assert all(named_by(pattern, name) for name in meant)
    assert not any(named_by(pattern, name) for name in others)


def test_the_last_group_that_holds_a_pair_decides():
    near, nearer = op.SafePairs(("hand*",), ("shelf*",), 0.002), op.SafePairs(("hand",), ("shelf_2",), 0.0)
    safety = op.Safety(0.01, own=0.003, pairs=(near, nearer))
    assert safety.asked("arm", "shelf_1", obstacle=True) == 0.01
    assert safety.asked("arm", "hand", obstacle=False) == 0.003
    assert safety.asked("shelf_1", "hand_camera", obstacle=True) == 0.002  # in either order
    assert safety.asked("hand", "shelf_2", obstacle=True) == 0.0
    assert safety.most == 0.01
    assert op.SafePairs("hand*", ["shelf*"], 0.002) == near  # a name, not its letters
    with pytest.raises(op.InputError, match=r"op\.SafePairs: others"):
        op.SafePairs("hand", 3, 0.002)


def test_data_without_pairs_is_read():
    safety = op.Safety(0.01, own=0.003)
    assert "pairs" not in safety.to_data()
    assert op.Safety.from_data(safety.to_data()).same_as(safety)


def test_nothing_asked_is_no_safety():
    assert op.Scene(safety=0).safety is None
    assert op.Scene(safety=op.Safety()).safety is None
    assert op.Scene(safety=0.005).safety.to_data() == {"scene": 0.005, "self": 0.005, "within": 0.5}


def test_every_scene_that_is_made_of_one_keeps_its_safety():
    box, ball = (kind(name, *size) for kind, name, size in ((op.Box, "box", [(1, 1, 1)]), (op.Sphere, "ball", [0.1])))
    scene = op.Scene([box, ball], safety=0.005)
    others = [scene.moved("box", x=1.0), scene.without("ball"), scene.with_(op.Sphere("two", 0.1)), scene.later(1.0)]
    others += [scene.with_attached(ball.attached_to("hand")), scene.standing]
    assert all(one.safety.same_as(scene.safety) for one in others)
    assert not scene.unwished
    none = op.Scene([box, ball], safety=0)
    others = [none.moved("box", x=1.0), none.without("ball"), none.with_(op.Sphere("two", 0.1)), none.later(1.0)]
    assert all(one.safety is None and one.unwished for one in [none, *others, none.standing])


def test_ends_tell_safeties_apart():
    safety = op.Safety(0.005)
    there = safety.ending_at([np.zeros(2)])
    assert there.same_as(safety.ending_at([np.zeros(2)]))
    assert not there.same_as(safety)
    assert not there.same_as(safety.ending_at([np.ones(2)]))
    assert not safety.same_as(None)
    assert not safety.same_as(replace(safety, built=(BuiltNear(("a", "b"), 0.001, 0.0),)))


@pytest.mark.parametrize("value", [-0.001, 1.5, float("nan"), "5 mm", True])
def test_what_is_no_distance_is_refused(value):
    with pytest.raises(op.InputError, match=r"op.Scene: safety: .*expected a distance in \[0, 1\] m"):
        op.Scene(safety=value)


def test_a_way_must_be_positive():
    with pytest.raises(op.InputError, match="within: found the int 0; expected a number > 0"):
        op.Safety(0.005, within=0)
