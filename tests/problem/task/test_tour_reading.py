"""Tours: what is read from YAML, CSV and Python, and what is refused before any search."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.geometry.poses import pose_error
from optiplan.problem.load import load_problem, problem_from_dict

DOWN = {"axis": [0, 0, -1]}
A, B = {"name": "a", "position": [0.4, 0.2, 0.3], **DOWN}, {"name": "b", "position": [0.4, -0.2, 0.3], **DOWN}


def problem(*targets, **tour):
    return op.Problem("ur5", "ready", task=op.Tour(list(targets), **tour))


@pytest.fixture(scope="module", autouse=True)
def robot():
    return op.load_robot("ur5")


def test_a_target_is_a_region_about_its_axis():
    tour = problem(A, {**B, "axis": [0.6, 0, -0.8]}, standoff=0.02, closed=True).task[0].action
    assert (tour.free, tour.closed, tour.dwelling, tour.count) == (True, True, 0.0, 3)
    goal = tour.targets[1].goal
    assert goal.free == (2,)
    assert np.allclose(goal.X_WR.rotation[:, 2], [0.6, 0, -0.8])
    assert np.allclose(goal.X_WR.translation, np.array([0.4, -0.2, 0.3]) - 0.02 * np.array([0.6, 0, -0.8]))


@pytest.mark.parametrize("turned", [{"axis": [0.6, 0, -0.8]}, {"rpy": [0.2, 0.1, 0.3]}])
def test_no_corner_of_a_target_is_farther_off_than_its_tolerance(turned):
    target = {"position": [0.4, 0.2, 0.3], **turned}
    tour = problem(target, tolerance={"position": 1e-3, "orientation": 1e-2}).task[0].action
    goal = tour.targets[0].goal
    corner = pose_error(goal.X_WR, goal.pose(np.where(np.isfinite(goal.high), goal.high, 0.0)))
    assert corner == pytest.approx((1e-3, 1e-2), rel=1e-3)


def test_file_csv_and_python_are_one_problem(tmp_path):
    (tmp_path / "t.csv").write_text("name,x,y,z,nx,ny,nz\na,0.4,0.2,0.3,0,0,-1\nb,0.4,-0.2,0.3,0,0,-1\n")
    text = "version: 1\nname: t\nrobot: ur5\nstart: {configuration: ready}\ntask: [{tour: {targets: t.csv}}]\n"
    (tmp_path / "t.yaml").write_text(text)
    read = load_problem(tmp_path / "t.yaml")
    assert read.hash == op.Problem("ur5", "ready", task=op.Tour([A, B]), name="t").hash
    assert read.hash == op.Problem("ur5", "ready", task=op.Tour(tmp_path / "t.csv"), name="t").hash
    rows = np.array([[0.4, 0.2, 0.3, 0, 0, -1], [0.4, -0.2, 0.3, 0, 0, -1]])
    assert [one.name for one in op.Problem("ur5", "ready", task=op.Tour(rows)).task[0].action.targets] == [
        "target 1",
        "target 2",
    ]
    assert problem_from_dict(read.source).hash == read.hash  # the source holds the targets themselves


def test_a_target_of_a_file_is_reported_on_its_line(tmp_path):
    (tmp_path / "t.csv").write_text("x,y,z,nx,ny,nz\n0.4,0,0.3,0,0,-1\n\n,,,,,\n0.4,0,0.3,0,0,-1\n")
    with pytest.raises(InputError) as error:
        op.Problem("ur5", "ready", task=op.Tour(tmp_path / "t.csv"))
    assert error.value.issues[0].line == 5


def test_targets_stand_in_frames():
    """An axis and a place `in` a frame that is turned by a quarter about z."""
    tray = {"in": "world", "position": [0.4, 0.1, 0.2], "rpy_deg": [0, 0, 90]}
    targets = [
        {"in": "tray", "position": [0.1, 0, 0.1], "axis": [1, 0, 0]},
        {"in": "tray", "position": [0, 0, 0.2], "rpy": [0, 0, 0]},
    ]
    data = {"version": 1, "robot": "ur5", "start": {"configuration": "ready"}, "frames": {"tray": tray}}
    read = problem_from_dict({**data, "task": [{"tour": {"targets": targets}}]})
    first, second = (target.goal.X_WR for target in read.task[0].action.targets)
    assert np.allclose(first.translation, [0.4, 0.2, 0.3])
    assert np.allclose(first.rotation[:, 2], [0, 1, 0])
    assert np.allclose(second.translation, [0.4, 0.1, 0.4])
    assert np.allclose(second.rotation[:, 0], [0, 1, 0])


@pytest.mark.parametrize(
    ("kind", "one", "more", "found"),
    [
        ("tour", {"axis": [0, 0, "down"]}, {}, r"targets\[0\]\.axis\[2\]: 'down'; expected a number"),
        ("tour", {"axis": [0, 0, "-1"]}, {}, r"targets\[0\]\.axis\[2\]: '-1'; expected a number"),
        ("tour", {"axis": [0, 0, -1], "rpy": [0, 0, 0]}, {}, "both an axis and a rotation"),
        ("tour", DOWN, {"carried_by": "wrist_3_link"}, r"\[0\]\.in: 'tray' beside `carried_by`; expected a pose in"),
        ("path", {"axis": [0, 0, -1], "quaternion": [0, 0, 0, 1]}, {"speed": 0.1}, "both an axis and a rotation"),
        ("path", {"through": [0, "a", 1]}, {"speed": 0.1}, r"points\[0\]\.through\[1\]: 'a'; expected a number"),
    ],
)
def test_targets_and_points_in_frames_are_checked_as_they_are_written(kind, one, more, found):
    several = [{"in": "tray", "position": [0.4, 0.1 * k, 0.3], **(one if k == 0 else {})} for k in range(2)]
    step = {kind: {"targets" if kind == "tour" else "points": several, **more}}
    data = {"version": 1, "robot": "ur5", "start": {"configuration": "ready"}, "frames": {"tray": {}}}
    with pytest.raises(InputError, match=found):
        problem_from_dict({**data, "task": [step]})


@pytest.mark.parametrize(
    ("targets", "tour", "found"),
    [
        ([A, {**B, "name": "a"}], {}, r"targets\[1\].name: 'a', the name of target 1"),
        ([A, {**A, "name": "b"}], {}, r"targets\[1\].position: the place of 'a'"),
        ([A, {**B, "after": "c"}], {}, r"targets\[1\].after: unknown target 'c'"),
        ([A, {**B, "after": "b"}], {}, r"targets\[1\].after: 'b' itself"),
        ([{**A, "after": "b"}, {**B, "after": "a"}], {}, "in a circle: 'b' before 'a' before 'b'"),
        ([A, {**B, "after": "a"}], {"first": "b"}, "in a circle"),
        ([{**A, "after": "b"}, B], {"order": "given"}, "in a circle"),
        ([A, B], {"last": "z"}, "unknown target 'z'"),
        ([A, B], {"free_axis": "x"}, "an axis with `free_axis: x`"),
        ([{**A, "window": [3, 1]}, B], {}, "window"),
        ([{**A, "rpy": [0, 0, 0]}, B], {}, "both an axis and a rotation"),
        ([A, B], {"at_each": [{"do": "weld"}]}, "dwell"),
        ([A, B], {"order": "random"}, "order"),
        ([], {}, "targets"),
        ([A, B], {"frame": "nowhere"}, "unknown frame 'nowhere'"),
    ],
)
def test_what_no_order_can_hold_is_refused(targets, tour, found):
    with pytest.raises(InputError, match=found):
        problem(*targets, **tour)


def test_clusters_with_members_before_each_other_are_refused():
    far = [{"name": n, "position": [0.4, 0.1 * k, 0.3], **DOWN} for k, n in enumerate("pqrs")]
    clustered = [{**one, "cluster": "one" if one["name"] in "pq" else "two"} for one in far]
    clustered[0]["after"], clustered[3]["after"] = "r", "q"  # p after r, s after q: neither cluster is first
    with pytest.raises(InputError, match="in a circle"):
        problem(*clustered)


def test_arguments_of_another_kind_are_refused():
    for wrong in (3, {"a": 1}, [1], [op.Pose((0.4, 0, 0.3), frame="tool0")]):
        with pytest.raises(InputError, match=r"op\.Tour: targets"):
            op.Tour(wrong)
