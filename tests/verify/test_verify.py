"""What the verifier must refuse, each beside a twin that it must pass."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import optiplan as op
from optiplan.collision.kept_models import collision_model
from optiplan.errors import InputError
from optiplan.geometry.scene import Attachment, Box, Capsule, HalfSpace, Obstacle, Scene, Sphere
from optiplan.problem.problem import JointGoal, PoseGoal, derived
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import collision_check
from optiplan.verify.continuous.proof import Moment, Proof
from optiplan.verify.report import VerifyPolicy, jsonable
from optiplan.verify.verify import verify
from tests.checks import failed, named
from tests.verify.motions import problem_of, quintic, smooth, unchecked, within_limits

AXIS = np.array([0.0, 0.18, 0.5])  # the planar arm's outer plane of motion, at the height of its shoulder


@pytest.fixture
def swing(planar):
    """The arm stretched out, from 1 rad below to 1 rad above the horizontal, at full speed in the middle."""
    return within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)


def test_a_free_motion_is_verified(planar, swing):
    report = verify(problem_of(planar, swing, Scene()), swing)
    assert report.verified, report.failures
    assert {check.kind for check in report.checks} == {"exact", "continuous"}
    assert report.link_geometry["upper_arm"] == "primitive"
    assert named(report, "collision").detail == "no two bodies can meet"


@pytest.mark.parametrize(("depth", "verdict"), [(50e-6, False), (-50e-6, True), (1e-7, False), (-1e-7, True)])
def test_a_ball_of_2_mm_grazed_for_half_a_millisecond(planar, swing, depth, verdict):
    """A fingertip of 2 mm at 2.2 m/s passes a ball of 2 mm: shorter than any sampling step."""
    tip = Attachment("finger", Sphere(0.001), "tip", pin.SE3(np.eye(3), np.array([0.12, 0, 0])), frozenset({"forearm"}))
    ball = Obstacle("ball", Sphere(0.001), pin.SE3(np.eye(3), np.add(AXIS, [1.12 + 0.002 - depth, 0, 0])))
    report = verify(problem_of(planar, swing, Scene((ball,), (tip,))), swing)
    assert report.verified is verdict, report.failures
    check = named(report, "collision")
    assert check.place == "finger – ball"
    assert check.time == pytest.approx(swing.duration / 2, abs=1e-3)
    if not verdict:
        assert check.witness["contact"]
        assert -depth <= check.worst <= 1e-9
        np.testing.assert_allclose(check.witness["points"], [ball.X_WO.translation] * 2, atol=2e-3)


def test_a_contact_is_told_with_the_deepest_pair_of_its_moment(planar, swing, monkeypatch):
    """The certificate ends at a first contact; of many bodies behind one hull that need not be the deepest."""
    shallow = Obstacle("shallow", Sphere(0.05), pin.SE3(np.eye(3), np.add(AXIS, [0.75, 0.0, 0.06])))
    deep = Obstacle("deep", Sphere(0.05), pin.SE3(np.eye(3), np.add(AXIS, [0.95, 0.0, 0.0])))
    problem = problem_of(planar, swing, Scene((shallow, deep)))
    model, q = collision_model(planar, problem.scene), np.zeros(2)
    met, *_, deepest = sorted(model.contacts(q, 0.0), key=lambda contact: -contact.distance)
    assert (met.pair.name_b, deepest.pair.name_b) == ("shallow", "deep")
    names, points = (met.pair.name_a, met.pair.name_b), np.array([met.point_a, met.point_b])
    first = Proof(False, "bodies touch", met=(None, Moment(met.distance, 0.5, names, points, q)), contact=True)
    monkeypatch.setattr(collision_check, "certify", lambda *_, **__: first)
    check = named(verify(problem, swing), "collision")
    assert check.place == f"{deepest.pair.name_a} – deep"
    assert check.worst == check.witness["met_clearance"] == deepest.distance
    assert check.witness["points"] == [deepest.point_a.tolist(), deepest.point_b.tolist()]
    assert check.time == 0.5


@pytest.mark.parametrize(("reach", "verdict"), [(1e-5, False), (-1e-5, True)])
def test_a_thin_tool_crossing_a_plate_of_10_um(planar, swing, reach, verdict):
    """The needle, 0.2 mm thick, is within the plate for 0.1 ms; or passes its edge at 10 um."""
    turn = pin.exp3(np.array([0.0, np.pi / 2, 0.0]))
    needle = Attachment("needle", Capsule(1e-4, 0.05), "tip", pin.SE3(turn, np.array([0.125, 0, 0])))
    edge = 1.0 + 0.125 + 0.025 + 1e-4 - reach
    plate = Obstacle("plate", Box((0.1, 0.3, 1e-5)), pin.SE3(np.eye(3), np.add(AXIS, [edge + 0.05, 0, 0])))
    report = verify(problem_of(planar, swing, Scene((plate,), (needle,))), swing)
    assert report.verified is verdict, report.failures
    assert named(report, "collision").place == "needle – plate"


@pytest.mark.parametrize(("gap", "verdict"), [(1e-4, True), (-1e-4, False)])
def test_a_floor(planar, swing, gap, verdict):
    lowest = 0.5 - 1.06 * np.sin(1.0) - 0.04  # of the ball at the tool's end; the forearm stays above
    floor = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), lowest - gap), pin.SE3.Identity())
    report = verify(problem_of(planar, swing, Scene((floor,))), swing)
    assert report.verified is verdict, report.failures


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_jump_is_refused(planar, swing, order):
    """A step in the middle, taken back before the end: only the breakpoint can show it."""
    halves = split(swing, [0.25, 0.5, 0.75])
    c = halves.coefficients.copy()
    c[1, order, 1] += 1e-3
    broken = Trajectory(halves.joint_names, halves.breakpoints, c)
    report = verify(problem_of(planar, swing, Scene()), broken)
    check = named(report, "continuity")
    assert not check.passed
    assert check.place == "elbow"
    assert check.time in (halves.breakpoints[1], halves.breakpoints[2])
    assert verify(problem_of(planar, swing, Scene()), halves).verified


@pytest.mark.parametrize("order", [0, 1])
def test_a_staircase_of_tolerated_steps_is_refused(planar, order):
    """Every step is within tolerance and every piece within the limits; together they outrun any limit."""
    heights = np.concatenate([np.arange(10_000), np.arange(10_000)[::-1] if order else []]) * 5e-8
    c = np.zeros((len(heights), 2, 2))
    c[:, order, 0] = heights
    c[1:, 0, 0] += np.cumsum(heights * 1e-7 * order)[:-1]
    report = verify_own(planar, Trajectory(planar.joint_names, np.arange(len(c) + 1) * 1e-7, c))
    assert [check.name for check in report.failures] == ["continuity"]


def verify_own(robot, trajectory):
    return verify(problem_of(robot, trajectory, Scene()), trajectory)


def split(trajectory, fractions):
    """The same motion in more pieces."""
    starts = np.concatenate([[0.0], fractions]) * trajectory.duration
    factorials = np.array([1.0, 1.0, 2.0, 6.0, 24.0, 120.0])
    c = [[trajectory(np.array([t]), k)[0] / factorials[k] for k in range(6)] for t in starts]
    return Trajectory(trajectory.joint_names, np.append(starts, trajectory.duration), np.array(c))


@pytest.mark.parametrize(("order", "name"), [(1, "velocity"), (2, "acceleration"), (3, "jerk")])
@pytest.mark.parametrize(("excess", "verdict"), [(1e-3, False), (1e-5, False), (-1e-5, True)])
def test_a_peak_inside_a_piece(planar, swing, order, name, excess, verdict):
    """One piece, so nothing shows at breakpoints; the limit is passed by a thousandth of it."""
    peak = np.abs(np.stack(swing.extrema(order))).max(axis=0) + 1e-9
    problem = problem_of(planar, swing, Scene())
    problem = derived(problem, limits=replace(problem.limits, **{name: peak / (1.0 + excess)}))
    report = verify(problem, swing)
    assert failed(report) == ([] if verdict else [name])
    assert named(report, name).worst == pytest.approx(peak[0])


def test_position_limits_hold_between_breakpoints(planar):
    bump = smooth(planar.joint_names, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), 4.0)
    problem = problem_of(planar, bump, Scene())
    peak = bump.extrema(0)[1]
    for slack, verdict in ((1e-3, True), (-1e-3, False)):
        limited = derived(problem, limits=replace(problem.limits, upper=peak + np.array([slack, 1.0])))
        assert verify(limited, bump).verified is verdict


def test_torque_is_a_limit_where_the_robot_has_one(planar, swing):
    problem = problem_of(planar, swing, Scene())
    peak = named(verify(problem, swing), "torque")
    assert peak.kind == "continuous"
    weak = derived(problem, limits=replace(problem.limits, torque=np.array([0.99 * peak.worst, 100.0])))
    assert failed(verify(weak, swing)) == ["torque"]
    none = derived(problem, limits=replace(problem.limits, torque=np.full(2, np.inf)))
    assert verify(none, swing).verified


def test_an_end_that_misses_the_goal(planar, swing):
    problem = problem_of(planar, swing, Scene())
    missed = derived(problem, goal=(JointGoal(np.add(swing.end, [0.0, 1e-4])),))
    report = verify(missed, swing)
    assert failed(report) == ["goal"]
    assert named(report, "goal").place == "elbow"
    assert verify(derived(problem, goal=(missed.goal[0], problem.goal[0])), swing).verified


@pytest.mark.parametrize(
    ("shift", "turn", "part"), [(0.9e-3, 0.9e-2, ""), (1.1e-3, 0.0, "tool position"), (0.0, 1.1e-2, "tool orientation")]
)
def test_pose_goals(planar, swing, shift, turn, part):
    data = planar.model.createData()
    pin.framesForwardKinematics(planar.model, data, swing.end)
    X_WT = data.oMf[planar.model.getFrameId("tool")]
    wanted = pin.SE3(X_WT.rotation @ pin.exp3(np.array([turn, 0, 0])), np.add(X_WT.translation, [0, shift, 0]))
    goal = PoseGoal("tool", wanted, 1e-3, 1e-2)
    report = verify(derived(problem_of(planar, swing, Scene()), goal=(goal,)), swing)
    assert report.verified is (not part)
    assert not part or named(report, "goal").place == part


def test_joints_without_end_may_arrive_a_turn_later(planar, swing):
    problem = problem_of(planar, swing, Scene())
    away = derived(problem, goal=(JointGoal(np.add(swing.end, [2 * np.pi, 0.0])),))
    assert failed(verify(away, swing)) == ["goal"]
    endless = replace(planar, limits=replace(planar.limits, lower=np.full(2, -np.inf), upper=np.full(2, np.inf)))
    assert verify(derived(away, robot=endless), swing).verified


def test_another_start(planar, swing):
    problem = problem_of(planar, swing, Scene())
    assert failed(verify(derived(problem, start=np.add(problem.start, [1e-4, 0])), swing)) == ["start"]


def test_ends_in_motion(planar):
    line = Trajectory(planar.joint_names, np.array([0.0, 1.0]), np.array([[[0.0, 0.0], [0.5, 0.0]]]))
    assert failed(verify(problem_of(planar, line, Scene()), line)) == ["rest"]


def test_wrong_joint_order(planar, swing):
    swapped = Trajectory(swing.joint_names[::-1], swing.breakpoints, swing.coefficients)
    report = verify(problem_of(planar, swing, Scene()), swapped)
    assert failed(report) == ["joints"]
    assert not report.verified
    assert "elbow, shoulder" in report.failures[0].detail


@pytest.mark.parametrize(
    "changes",
    [
        {"coefficients": np.full((1, 6, 2), np.nan)},
        {"coefficients": np.full((1, 6, 2), np.inf)},
        {"coefficients": np.zeros((2, 6, 2))},
        {"coefficients": None},
        {"coefficients": np.zeros((1, 6, 2), dtype=int)},
        {"coefficients": np.zeros((1, 6, 2), dtype=complex)},
        {"breakpoints": np.array([0.0, np.nan])},
        {"breakpoints": np.array([0.0, 0.0])},
        {"joint_names": None},
    ],
)
def test_what_is_not_a_trajectory_is_refused_without_an_exception(planar, swing, changes):
    report = verify(problem_of(planar, swing, Scene()), unchecked(swing, **changes))
    assert failed(report) == ["finite"]
    assert len(report.checks) == 1
    assert report.notes


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@pytest.mark.parametrize("scale", [1e3, 1e6, 1e100, 1e300])
def test_absurd_numbers_are_refused_without_an_exception(planar, swing, scale):
    wild = Trajectory(swing.joint_names, swing.breakpoints, swing.coefficients * scale)
    report = verify(problem_of(planar, swing, Scene()), wild)
    expected = {"start", "goal", "position", "velocity"} if scale < 1e15 else {"finite"}
    assert expected <= set(failed(report))
    json.dumps(report.to_dict(), allow_nan=False)
    slow = Trajectory(swing.joint_names, swing.breakpoints * scale, swing.coefficients * scale)
    assert not verify(problem_of(planar, swing, Scene()), slow).verified


def test_contacts_that_the_problem_allows_are_told(planar, swing):
    ball = Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.add(AXIS, [1.0, 0, 0])))
    known = [frozenset({"ball", link}) for link in ("tip", "forearm")]
    for allowed, verdict in ((known, True), (known[:1], False)):
        report = verify(problem_of(planar, swing, Scene((ball,), allowed=frozenset(allowed))), swing)
        assert report.verified is verdict
        assert "ball – tip" in report.scope[-1]


@pytest.mark.parametrize(("scale", "told"), [(0.001, 0), (1.0, 1)])
def test_a_mesh_in_millimetres_is_told(planar, swing, tmp_path, scale, told):
    trimesh.creation.box((1500, 800, 700)).export(tmp_path / "table.stl")
    table = op.Mesh("table", tmp_path / "table.stl", scale=scale, position=(0, 0, -350 * scale - 2))
    scope = verify(problem_of(planar, swing, Scene((table,))), swing).scope
    assert sum("look like millimetres: those of table (1.5e+03 m)" in said for said in scope) == told


def test_what_an_attached_object_may_touch_is_told(planar, swing):
    held = Attachment("rod", Box((0.01, 0.01, 0.5)), "tip", pin.SE3.Identity(), frozenset({"forearm"}))
    assert "forearm – rod" in verify(problem_of(planar, swing, Scene((), (held,))), swing).scope[-1]


def test_nan_in_a_file_is_an_input_error(swing):
    data = swing.to_dict()
    data["pieces"]["coefficients"][0][0][0] = float("nan")
    with pytest.raises(InputError, match=r"pieces\.coefficients"):
        Trajectory.from_dict(json.loads(json.dumps(data)))


def test_reports_are_json(planar, swing):
    ball = Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.add(AXIS, [1.0, 0, 0])))
    policy = VerifyPolicy(clearance=1e-3)
    report = verify(problem_of(planar, swing, Scene((ball,))), swing, policy)
    data = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert data["verified"] is False
    assert data["policy"]["clearance"] == 1e-3
    assert [check["name"] for check in data["checks"] if not check["passed"]] == ["collision"]
    json.dumps(verify(problem_of(planar, swing, Scene()), swing).to_dict(), allow_nan=False)


@pytest.mark.parametrize(
    ("name", "value"),
    [("min_interval", 0.0), ("max_queries", 0), ("max_queries", 1e4), ("jump_tolerance", np.nan), ("torque_rate", 0)],
)
def test_a_number_of_the_policy_out_of_its_range_is_an_input_error(name, value):
    with pytest.raises(InputError, match=name):
        VerifyPolicy(**{name: value})


def test_read_back_from_json_the_verdict_is_the_same(planar, swing):
    again = Trajectory.from_dict(json.loads(json.dumps(swing.to_dict(rate=100.0))))
    problem = problem_of(planar, swing, Scene())
    assert verify(problem, again).to_dict() == verify(problem, swing).to_dict()


def test_numbers_of_any_kind_become_json():
    mixed = {"a": np.float64(1.5), "b": np.array([1.0, np.nan]), "c": (np.int64(2), np.inf), 3: np.bool_(True)}
    assert jsonable(mixed) == {"a": 1.5, "b": [1.0, None], "c": [2, None], "3": True}
