"""Paths: what is read from YAML, CSV and Python, and what is refused, with its line."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.load import load_problem, problem_from_dict

HEAD = "version: 1\nname: p\nrobot: ur5\nstart: {configuration: ready}\ntask:\n  - path:\n"
POINTS = "      points:\n        - {position: [0.4, -0.1, 0.3]}\n        - {position: [0.4, 0.1, 0.3]}\n"
POSITIONS = [[0.4, -0.1, 0.3], [0.4, 0.1, 0.3]]


@pytest.fixture(scope="module", autouse=True)
def robot():
    return op.load_robot("ur5")


def read(tmp_path, body):
    (tmp_path / "p.yaml").write_text(HEAD + body)
    return load_problem(tmp_path / "p.yaml")


def path(points=POSITIONS, **keys):
    return op.Problem("ur5", "ready", task=op.Path(points, 0.1, axis=[0, 0, -1], **keys), name="p")


def test_file_csv_and_python_are_one_problem(tmp_path):
    said = read(tmp_path, POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n      at: {path: 0.12, do: glue_on}\n")
    (tmp_path / "p.csv").write_text("x,y,z\n0.4,-0.1,0.3\n0.4,0.1,0.3\n")
    rest = "      axis: [0, 0, -1]\n      speed: 0.1\n      at: [{path: 0.12, do: glue_on}]\n"
    assert read(tmp_path, "      points: p.csv\n" + rest).hash == said.hash
    for points in (POSITIONS, np.array(POSITIONS), tmp_path / "p.csv", [op.Pose(p).to_data() for p in POSITIONS]):
        assert path(points, at=[{"path": 0.12, "do": "glue_on"}]).hash == said.hash
    assert problem_from_dict(said.source).hash == said.hash
    action = said.task[0].action
    assert (action.speed, action.within, action.cone, action.ramp) == (0.1, 0.01, 0.0, 0.0)
    assert action.parts() == [(0.0, 0.12), (0.12, pytest.approx(0.2))]
    assert action.count == 6


def test_points_stand_in_frames():
    tray = {"in": "world", "position": [0.4, 0.1, 0.2], "rpy_deg": [0, 0, 90]}
    points = [
        {"in": "tray", "position": [0, 0, 0]},
        {"in": "tray", "position": [0.1, 0, 0], "through": [0.05, 0.05, 0], "axis": [0.6, 0, -0.8]},
    ]
    file = {
        "version": 1,
        "robot": "ur5",
        "start": {"configuration": "ready"},
        "frames": {"tray": tray},
        "task": [{"path": {"points": points, "axis": [0, 0, -1], "speed": 0.1}}],
    }
    curve = problem_from_dict(file).task[0].action.curve
    ends = curve.points(np.array([0.0, 0.5 * curve.length, curve.length]))
    assert np.allclose(ends, [[0.4, 0.1, 0.2], [0.35, 0.15, 0.2], [0.4, 0.2, 0.2]], atol=1e-6)
    assert np.allclose(curve.directions(np.array([0.0, curve.length])), [[0, 0, -1], [0, 0.6, -0.8]], atol=1e-6)
    assert curve.heading is None


def test_rotations_fix_the_turn_unless_it_is_free():
    poses = [op.Pose(p, rpy=(np.pi, 0, 0)) for p in POSITIONS]
    assert op.Problem("ur5", "ready", task=op.Path(poses, 0.1)).task[0].action.curve.heading is not None
    free = op.Problem("ur5", "ready", task=op.Path(poses, 0.1, free_axis="z")).task[0].action.curve
    assert free.heading is None
    assert np.allclose(free.directions(np.array([0.1])), [[0, 0, -1]])


CORNER = [[0.4, -0.1, 0.3], [0.5, 0.0, 0.3], [0.4, 0.1, 0.3]]


def test_corners_are_rounded_or_need_a_ramp():
    with pytest.raises(InputError, match=r"1 exact corners.*`blend: …`, m, which rounds them, or `ramp: …`"):
        path(CORNER)
    assert path(CORNER, ramp=0.01).task[0].action.slow_parts()[1] == pytest.approx((0.1314, 0.1514), abs=1e-4)
    assert path(CORNER, blend=0.01).task[0].action.curve.corners == ()
    with pytest.raises(InputError, match="lead or side with exact corners"):
        path(CORNER, ramp=0.01, lead=0.1)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (POINTS + "      speed: 0.1\n", r"p.yaml:8: .*points\[0\].axis: nothing; expected an axis"),
        (POINTS + "      axis: [0, 0, -1]\n", r"path.speed"),
        (
            POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n      at: {path: 3, do: on}\n",
            r"p.yaml:12: .*beyond the end",
        ),
        (POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n      curve: spline\n      blend: 0.1\n", "no corners"),
        (POINTS + "      axis: [0, 1, 0]\n      speed: 0.1\n      lead: 0.1\n", "an axis along the path"),
        (POINTS + "      free_axis: x\n      speed: 0.1\n", "expected z"),
        (POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n      speed_within: 1.0\n", "speed_within"),
        (POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n      colour: red\n", "colour"),
        ("      speed: 0.1\n", "none of them; expected exactly one of: points, cover"),
        ("      points: none.csv\n      speed: 0.1\n", "no such file"),
        ("      points:\n        - {position: [0, 0, 0]}\n      speed: 0.1\n", "points"),
        ("      cover: {mesh: none.stl, spacing: 0.02}\n      speed: 0.1\n", "path.cover.*none.stl"),
        ("      cover: {mesh: m.stl, spacing: 0.02}\n      speed: 0.1\n      blend: 0.01\n", "blend beside cover"),
        ("      cover: {mesh: m.stl, spacing: 0.02}\n      speed: 0.1\n      curve: line\n", "curve beside cover"),
    ],
)
def test_bad_paths_are_refused_with_their_line(tmp_path, body, words):
    with pytest.raises(InputError, match=words):
        read(tmp_path, body)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,z,speed\n0.4,0,0.3,1\n0.5,0,0.3,1\n", r"p.csv:1: column 4: 'speed'; expected one of x, y, z, nx"),
        ("x,y\n0.4,0\n0.5,0\n", "no column z"),
        ("x,y,z\n0.4,0,0.3\n0.5,zero,0.3\n", r"p.csv:3: x, y, z: '0.5', 'zero', '0.3'; expected numbers"),
        ("x,y,z\n0.4,0,0.3\n0.4,0,0.3\n", r"p.csv:3: position: the place of point 1"),
        ("x,y,z,nx,ny,nz\n0.4,0,0.3,0,0,-1\n0.5,0,0.3,0,0,1\n", r"p.csv:3: axis: .*nearly opposite"),
        ("x,y,z\n0.4,0,0.3\n", "1 rows; expected 2 to"),
        ("x,y,z\n,,\n\n", "0 rows; expected 2 to"),
        ("x,y,z\n\n0.4,0,0.3\n,,\n0.4,0,0.3\n", r"p.csv:5: position: the place of point 1"),
    ],
)
def test_bad_files_are_refused_with_their_line(tmp_path, text, words):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read(tmp_path, "      points: p.csv\n      axis: [0, 0, -1]\n      speed: 0.1\n")


def test_no_blend_rounds_a_corner_straight_back():
    with pytest.raises(InputError, match="no curve: no blend rounds the corner at point 2, where it goes straight"):
        path([*POSITIONS, POSITIONS[0]], blend=0.01)
    assert path([*POSITIONS, POSITIONS[0]], ramp=0.02).task[0].action.curve.corners == (pytest.approx(0.2),)


def test_arcs_need_a_point_before_them():
    points = [{"position": [0.4, -0.1, 0.3], "through": [0.4, 0.0, 0.3]}, {"position": [0.4, 0.1, 0.3]}]
    with pytest.raises(InputError, match="an arc to this point"):
        path(points)
    with pytest.raises(InputError, match="points of no curve"):
        path([points[1], {"position": [0.4, -0.1, 0.3], "through": [0.4, 0.3, 0.3]}])


def test_a_constraint_on_a_part_of_a_path_with_events_is_refused(tmp_path):
    """Between the events the path is several motions, and nobody could tell whose part is meant."""
    keep = "    path_constraints:\n      - tool_speed: {linear: 0.2, during: [0.2, 0.8]}\n"
    body = POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n"
    assert read(tmp_path, body + keep).task[0].constraints[0].during == (0.2, 0.8)
    event = "      at: {path: 0.12, do: glue_on}\n"
    with pytest.raises(InputError) as caught:
        read(tmp_path, body + event + keep)
    (issue,) = caught.value.issues
    assert (issue.line, issue.field) == (14, "task[0].path_constraints[0].tool_speed.during")
    assert "[0.2, 0.8] of a path with events" in issue.found
    assert "the whole step" in issue.expected
    assert read(tmp_path, body + event + keep.replace(", during: [0.2, 0.8]", "")).task[0].constraints


def test_an_event_at_an_end_or_a_corner_but_for_rounding_is_there(tmp_path):
    corner = [[0.4, -0.1, 0.3], [0.4, 0.1, 0.3], [0.5, 0.1, 0.3]]
    places = [4e-7, 0.2 - 8e-7, 0.25, 0.3 + 5e-7]
    said = path(corner, ramp=0.02, at=[{"path": at, "do": f"e{k}"} for k, at in enumerate(places)])
    action = said.task[0].action
    assert [event.at for event in action.events] == [0.0, action.curve.corners[0], 0.25, action.curve.length]
    assert min(high - low for low, high in action.parts() if high > low) > 0.04
    with pytest.raises(InputError, match="beyond the end"):
        path(corner, ramp=0.02, at=[{"path": 0.30001, "do": "late"}])


def test_a_swing_wider_than_long_is_refused(tmp_path):
    body = POINTS + "      axis: [0, 0, -1]\n      speed: 0.1\n      weave: {amplitude: 0.02, length: 0.01}\n"
    words = r"p.yaml:12: task\[0\].path.weave: an amplitude of 0.02 m with a length of 0.01 m"
    with pytest.raises(InputError, match=words):
        read(tmp_path, body)
    assert read(tmp_path, body.replace("0.02,", "0.01,")).task[0].action.curve.length > 0.2
