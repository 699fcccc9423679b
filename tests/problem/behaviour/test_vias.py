"""Via points in a problem file: what is read, what is refused and where, what counts for the hash."""

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.problem.load import check_file, load_problem, problem_from_dict
from optiplan.problem.problem import JointGoal, PoseGoal

VIAS = """\
via:
  - {joints: [0.2, 0.3], velocity: [0.1, -0.2], time: 1}
  - {configuration: bent, tolerance: 0.05, time: 2.5}
  - {pose: {position: [0.5, 0.5, 0], tolerance: {position: 0.01, orientation: 3.15}}, time: 3}
  - {pose: {position: [0.5, 0.4, 0]}, time: 4}
seed: 0"""


def refusal(path):
    (issue,) = check_file(path)
    return issue


def test_all_that_a_via_can_say(write):
    first, second, third, fourth = load_problem(write("seed: 0", VIAS)).vias
    assert isinstance(first.at, JointGoal)
    assert first.at.q == pytest.approx([0.2, 0.3])
    assert first.at.tolerance == 1e-6
    assert first.velocity == pytest.approx([0.1, -0.2])
    assert second.at.tolerance == 0.05
    assert second.velocity is None
    assert isinstance(third.at, PoseGoal)
    assert (third.at.frame, third.at.position, third.at.orientation) == ("hand", 0.01, 3.15)
    assert (fourth.at.position, fourth.at.orientation) == (1e-6, 1e-6)
    assert [via.time for via in (first, second, third, fourth)] == [1, 2.5, 3, 4]


@pytest.mark.parametrize(
    ("via", "line", "field", "found", "expected"),
    [
        ("[{joints: [0]}]", 12, "via[0].joints", "1 values", "2 values, one for each of shoulder, elbow"),
        ("[{joints: [0, 9]}]", 12, "via[0].joints[1]", "elbow = 9 rad, outside its limits", "[-2.9, 2.9]"),
        ("[{configuration: bend}]", 12, "via[0].configuration", "unknown configuration 'bend'", "'bent'"),
        ("[{pose: {frame: hands, position: [1, 0, 0]}}]", 12, "via[0].pose.frame", "unknown frame 'hands'", "'hand'"),
        ("[{joints: [0, 0], configuration: bent}]", 12, "via[0]", "joints and configuration", "exactly one of"),
        ("[{time: 1}]", 12, "via[0]", "none of them", "exactly one of: joints, joints_deg, configuration, pose"),
        ("[{joints: [0, 0], tolerance: 0}]", 12, "via[0].tolerance", "0", "> 0"),
        ("[{joints: [0, 0], velocity: [1]}]", 12, "via[0].velocity", "1 values", "2 values"),
        (
            "[{joints: [0, 0], velocity: [0, 90]}]",
            12,
            "via[0].velocity[1]",
            "elbow = 90 rad/s, beyond its limit",
            "a value in",
        ),
        ("[{joints: [0, 0], when: 1}]", 12, "via[0].when", "when", "time"),
        ("[{joints: [0, 0], time: 2}, {joints: [1, 1], time: 2}]", 12, "via", "time 2 after time 2", "increasing"),
        ("[{joints: [0, 0], time: 2}, {joints: [1, 1]}]", 12, "via", "a time at 1 of 2 vias", "at each, or at none"),
        (
            "[{pose: {position: [1, 0, 0], tolerance: {position: 0.1}}, tolerance: 0.1}]",
            12,
            "via[0]",
            "a tolerance of the via and one of its pose",
            "at most one",
        ),
        ("[{joints: [1.57, 0]}]", 12, "via[0]", "the via is in collision: ", "bodies that are apart"),
    ],
)
def test_what_is_refused(write, via, line, field, found, expected):
    path = write("seed: 0", f"via: {via}\nseed: 0")
    if "collision" in found:
        path.write_text(path.read_text().replace("position: [0, 2, 0]", "position: [0, 0.9, 0]"))
    issue = refusal(path)
    assert (issue.line, issue.field) == (line, field)
    assert found in issue.found
    assert expected in issue.expected


def test_vias_count_for_the_hash_and_come_back_from_the_source(write):
    without = load_problem(write())
    problem = load_problem(write("seed: 0", VIAS))
    assert without.vias == ()
    assert problem.hash != without.hash
    again = problem_from_dict(problem.source)
    assert again.hash == problem.hash
    for one, other in zip(problem.vias, again.vias, strict=True):
        assert one.time == other.time
        if isinstance(one.at, JointGoal):
            assert np.array_equal(one.at.q, other.at.q)
        else:
            assert one.at.position == other.at.position
            assert np.array_equal(one.at.X_WG.homogeneous, other.at.X_WG.homogeneous)


def test_an_issue_elsewhere_hides_no_via(write):
    path = write("seed: 0", "via: [{joints: [0]}]\nsead: 0")
    assert [issue.field for issue in check_file(path)] == ["via[0].joints", "sead"]
    with pytest.raises(InputError, match="sead"):
        load_problem(path)
