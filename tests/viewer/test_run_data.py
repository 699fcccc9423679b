"""Figures of the page: the curves are the polynomials', the clearance band is the certificate's."""

import base64

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Obstacle, Sphere
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.report import VerifyPolicy
from optiplan.viewer import runs
from optiplan.viewer.page import render_page
from optiplan.viewer.plots.refined_extrema import PieceSamples, refined_extrema
from optiplan.viewer.run_data.attempts import found_by
from optiplan.viewer.run_data.checks import checks_of
from optiplan.viewer.run_data.clearance import clearance_of
from optiplan.viewer.run_data.closed_loop import LOG, NEEDED, read_log
from optiplan.viewer.run_data.curves import curves_of, short_names, tool_frames
from optiplan.viewer.runs import ViewedRun, stops_told
from optiplan.viewer.scene import build_scene
from tests.checks import named
from tests.viewer.conftest import at


def floats(text: str, dtype: str = "<f4") -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype)


@pytest.fixture(scope="module")
def proof() -> op.Run:
    return op.plan(op.load_problem("02_shelf"), "prm")


@pytest.fixture(scope="module")
def refused() -> op.Run:
    return op.plan(op.load_problem("02_shelf"), "quintic")


def collision(run: op.Run):
    return named(run.report, "collision")


def test_the_proved_curve_is_the_certificate_and_its_least_the_reports_figure(proof):
    shown = clearance_of(proof.problem, proof.trajectory)
    edges, proved = floats(shown["edges"], "<f8"), floats(shown["proved"], "<f8")
    witness = collision(proof).witness
    assert proved.min() == shown["proved_least"] == witness["proved_clearance"]
    assert (edges[0], edges[-1]) == (0.0, proof.trajectory.duration)
    assert (np.diff(edges) > 0.0).all()
    model = CollisionModel(proof.problem.robot, proof.problem.scene)
    t, distance = floats(shown["t"]), floats(shown["distance"])
    for k in range(0, len(t), 7):  # the band stays below what is measured, everywhere
        assert distance[k] == pytest.approx(
            model.clearance(proof.trajectory(np.array([min(float(t[k]), edges[-1])]))[0]).distance, abs=2e-5
        )
        assert proved[np.searchsorted(edges, t[k], side="right").clip(1, len(proved)) - 1] <= distance[k] + 2e-5
    assert shown["least"]["distance"] <= witness["met_clearance"] + 1e-9
    assert shown["contacts"] == []


def test_the_proved_curve_is_about_the_tracking_error_too(proof):
    problem = proof.problem.with_parts(tracking_error=2e-4)
    witness = named(op.verify(problem, proof.trajectory), "collision").witness
    assert witness["proved_clearance"] < collision(proof).witness["proved_clearance"]
    assert clearance_of(problem, proof.trajectory, even=8)["proved_least"] == witness["proved_clearance"]


def test_what_the_last_event_leaves_is_in_the_proved_curve():
    """The ball is as near the tool that has released it as nothing is on the way."""
    ball = op.Sphere("ball", 0.02, position=(0.1, 0, 0)).attached_to("tool")
    task = op.Task().move([1.0, 0.5]).detach("ball")
    run = op.plan(op.Problem("planar2r", [0.0, 0.5], scene=op.Scene(attached=[ball]), task=task), "quintic", budget=5.0)
    shown = clearance_of(run.problem, run.trajectory, even=8)
    assert shown["proved_least"] == collision(run).witness["proved_clearance"] == floats(shown["proved"], "<f8").min()
    edges, t = floats(shown["edges"], "<f8"), floats(shown["t"])
    assert edges.max() == run.trajectory.duration
    assert t.max() == pytest.approx(run.trajectory.duration)
    assert (np.diff(edges) >= 0.0).all()


def test_recording_changes_no_proof_and_covers_every_pair_at_all_times(proof):
    model, record = CollisionModel(proof.problem.robot, proof.problem.scene), ClearanceRecord()
    plain = certify(model, proof.trajectory, VerifyPolicy())
    assert certify(model, proof.trajectory, VerifyPolicy(), record).clearance == plain.clearance
    begin, end, pair, clearance = record.proved()
    assert clearance.min() == plain.clearance
    for k in range(len(model.pairs)):
        own = pair == k
        order = np.argsort(begin[own], kind="stable")
        b, e = begin[own][order], np.maximum.accumulate(end[own][order])
        assert b[0] == 0.0
        assert e[-1] == pytest.approx(proof.trajectory.duration)
        assert (b[1:] <= e[:-1] + 1e-12).all()
    half = ClearanceRecord()
    half.add(begin[:1], end[:1], pair[:1], clearance[:1])
    assert np.isneginf(
        half.bound(proof.trajectory.duration, len(model.pairs)).clearance
    ).all()  # of the others: nothing


def test_curves_and_their_extrema_are_the_polynomials(proof):
    shown = curves_of(proof.problem, proof.trajectory, 300)
    t, limits = floats(shown["t"]), proof.problem.limits
    assert (np.diff(t) > 0.0).all()
    bounds = [(limits.lower, limits.upper), *((-rate, rate) for rate in limits.rates)]
    for order, name in enumerate(("position", "velocity", "acceleration", "jerk")):
        quantity = next(one for one in shown["quantities"] if one["name"] == name)
        exact = proof.trajectory.extrema_at(order)
        marked = np.array(quantity["extrema"])
        assert np.array_equal(marked[:, 0, 1], exact.high)
        assert np.array_equal(marked[:, 1, 1], exact.low)
        assert np.array_equal(marked[:, 0, 0], exact.t_high)
        assert quantity["low"] == bounds[order][0].tolist()
        assert quantity["high"] == bounds[order][1].tolist()
        y = floats(quantity["y"]).reshape(len(t), -1)
        assert (y <= exact.high + 1e-4 * np.abs(exact.high)).all()
        if order < 3:  # the jerk jumps at breakpoints
            assert np.allclose(
                y, proof.trajectory(t.astype(float).clip(0, proof.trajectory.duration), order), atol=2e-3, rtol=2e-3
            )


def test_extrema_of_what_is_sampled_are_no_less_than_those_of_far_denser_samples(proof):
    """Torque, tool speed, turning and manipulability: at 40,000 times, no sample beats what 300 and refinement find."""
    shown = {one["name"]: one for one in curves_of(proof.problem, proof.trajectory, 300)["quantities"]}
    dense = curves_of(proof.problem, proof.trajectory, 40_000)
    for name, sides in (("torque", (1, -1)), ("tool speed", (1,)), ("tool turning", (1,)), ("manipulability", (-1,))):
        assert shown[name]["kind"] == "sampled"
        own = next(one for one in dense["quantities"] if one["name"] == name)
        y = floats(own["y"]).reshape(-1, len(own["series"]))
        for k, marked in enumerate(shown[name]["extrema"]):
            for (t, value), sign in zip(marked, sides, strict=True):
                most = (sign * y[:, k]).max()
                scale = 1e-6 * max(1.0, abs(most))
                assert sign * value >= most - scale, name
                assert 0.0 <= t <= proof.trajectory.duration
                at = np.searchsorted(floats(dense["t"]), t).clip(1, len(y) - 1)  # where it is said to be
                assert sign * value <= (sign * y[at - 1 : at + 1, k]).max() + 1e-3 * max(1.0, abs(most)), name


def test_refined_extrema_find_the_peak_between_samples_and_both_sides_of_a_jump():
    c = np.zeros((2, 3, 1))
    c[0, 1], c[1, 0], c[1, 2] = 1.0, 1.0, 3.0  # q = t, then 1 + 3 (t - 1)²: the velocity jumps from 1 to 0
    samples = PieceSamples.of(op.Trajectory(("a",), np.array([0.0, 1.0, 2.0]), c), 10)
    found = refined_extrema(samples, *(lambda of: (of(samples), of))(lambda s: np.sin(2.0 * s.states()[0])))
    assert found.high[0] == pytest.approx(1.0, abs=1e-9)
    assert found.t_high[0] == pytest.approx(np.pi / 4.0, abs=1e-4)
    assert found.low[0] == pytest.approx(-1.0, abs=1e-9)
    speed = refined_extrema(samples, samples.states()[1], lambda s: s.states()[1])
    assert (speed.low[0], speed.t_low[0]) == (0.0, 1.0)  # of the second piece, where it begins
    assert (speed.high[0], speed.t_high[0]) == (6.0, 2.0)


def test_checks_have_shares_of_their_limits(proof):
    shown = {check["name"]: check for check in checks_of(proof.problem, proof.report.to_dict())}
    assert 0.5 < shown["velocity"]["share"] <= 1.000002
    assert 0.0 < shown["position"]["share"] <= 1.0
    assert shown["velocity"]["joint"].startswith("joint")
    assert shown["collision"]["share"] is None
    assert shown["collision"]["proved"] == collision(proof).worst


def test_a_planners_refusal_holds_the_motion_that_touches(refused):
    scene = build_scene(refused.problem, [ViewedRun("quintic", None, None, refused.to_dict()["failure"])])
    (run,) = scene.runs
    (begin, end), *_ = run["clearance"]["contacts"]
    assert run["offending"]
    assert run["duration"] > 0.0
    assert begin < refused.failure.witness["t"] < end
    assert "proved" not in run["clearance"]
    assert run["witnesses"][0]["distance"] < 0.0


def test_pages_stay_small(proof, monkeypatch):
    baxter = op.load_problem("18_baxter_dual")
    goal = baxter.goal[0].q
    coefficients = np.zeros((1, 6, baxter.robot.n))
    coefficients[0, 0] = baxter.start
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        coefficients[0, power] = factor * (goal - baxter.start) / 1.5**power
    motion = op.Trajectory(baxter.robot.joint_names, np.array([0.0, 1.5]), coefficients)
    assert tool_frames(baxter.robot) == ("left_gripper", "right_gripper")
    scene = build_scene(baxter, [ViewedRun("quintic", motion)])
    assert len(scene.runs[0]["other_paths"]) == 1
    assert len(render_page(scene)) < 2.5e6
    run = ViewedRun("prm", proof.trajectory, proof.report.to_dict(), None, proof.to_dict())
    for name in ("clearance_of", "curves_of"):  # the same of all twenty
        monkeypatch.setattr(runs, name, once(getattr(runs, name)))
    assert len(render_page(build_scene(proof.problem, [run] * 20))) < 2.5e6


def once(function):
    """What the first call returned, at every call."""
    made = []
    return lambda *given: made[0] if made else made.append(function(*given)) or made[0]


@pytest.mark.parametrize(
    ("names", "short"),
    [(["panda_joint1", "panda_joint2"], ["joint1", "joint2"]), (["a", "b"], ["a", "b"]), (["left_s0"], ["left_s0"])],
)
def test_short_names_leave_out_what_is_common(names, short):
    assert short_names(names) == short


def test_how_a_run_was_found(proof):
    """Attempts in words with the columns of their iterations; what a damaged record says of them is left out."""
    columns = {"duration": [1.0, 0.8], "merit": [2, 1], "violation": [0.1, 0], "radius": [0.1, 0.2], "accepted": [1, 0]}
    straight = {
        "seed": "straight",
        "free": True,
        "iterations": 3,
        "duration": 0.8,
        "ended": "converged",
        "log": columns,
    }
    refused = {
        "seed": "bump",
        "free": False,
        "iterations": 2,
        "touches": ["link5", "board"],
        "log": {"duration": [1.0]},
    }
    torn = {**straight, "log": {**columns, "radius": [0.1]}}
    wrong = {**straight, "iterations": "", "duration": "0.8", "touches": 3, "log": {**columns, "merit": [[2], 1]}}
    record = {"improvements": [[0.03, 0.8]], "info": {"attempts": [straight, refused, torn, wrong, 3]}}
    found = found_by(record)
    assert found["improvements"] == [[0.03, 0.8]]
    first, second, third, fourth = found["attempts"]
    assert (first["begun_at"], first["ended"], first["log"]["violation"]) == ("straight line", "converged", [0.1, 0.0])
    assert (second["begun_at"], second["hindered"]) == ("best curve with a bump", "link5 – board")
    assert (second["duration"], second["log"], third["log"]) == (None, None, None)
    assert [fourth[key] for key in ("iterations", "duration", "hindered", "log")] == [0, None, "", None]
    assert found_by({"info": {"attempts": 3}}) is None
    assert found_by(None) is None


def test_a_damaged_log_is_refused_in_words(tmp_path):
    np.savez_compressed(tmp_path / LOG, t=np.arange(100.0), q=np.zeros((100, 2)))
    whole = (tmp_path / LOG).read_bytes()
    flipped = bytearray(whole)
    flipped[90:95] = bytes(255 - byte for byte in whole[90:95])
    damaged = [*(whole[:size] for size in (0, 3, 60, len(whole) // 2, len(whole))), bytes(flipped)]
    for rows in (np.zeros((0, 2)), np.full((3, 2), np.nan)):
        np.savez(tmp_path / LOG, t=np.zeros(len(rows)), **dict.fromkeys(NEEDED[1:], rows))
        damaged.append((tmp_path / LOG).read_bytes())
    for content in damaged:
        (tmp_path / LOG).write_bytes(content)
        with pytest.raises(op.InputError, match="log") as caught:
            read_log(tmp_path)
    assert "q: nan in row 0; expected finite numbers" in str(caught.value)


def test_metrics_of_a_damaged_record_are_left_out():
    problem = op.load_problem("12_planar")
    record = {"metrics": {"jerk_share": {"x": 1}, "rms_torque": "3", "tool_path": [[0.1]], "peak_jerk": 10**400}}
    run = ViewedRun("damaged", None, record=record)
    assert not any(build_scene(problem, [run]).to_dict()["runs"][0]["row"].values())


def test_stops_of_a_damaged_record_are_left_out():
    stop = {"t": 1.0, "after": 1, "why": "attach cup"}
    wrong = [3, {"t": 1.0}, {**stop, "t": "soon"}, {**stop, "t": float("nan")}, {**stop, "after": None}]
    assert stops_told({"info": {"stops": [stop, *wrong]}}) == [stop]
    for record in (None, {}, {"info": None}, {"info": {"stops": 3}}):
        assert stops_told(record) == []


def test_a_planners_run_tells_the_page_how_it_was_found():
    run = op.plan(op.load_problem("01_reach"), "trajopt", budget=2.0)
    shown = build_scene(run.problem, [ViewedRun("a", run.trajectory, run.report.to_dict(), None, run.to_dict())])
    first, *_ = shown.to_dict()["runs"][0]["found"]["attempts"]
    assert first["begun_at"] == "straight line"
    assert len(first["log"]["duration"]) == len(first["log"]["radius"]) > 0


def test_distances_of_the_scene_of_the_robot_itself_and_of_pairs_are_measured_alone(proof):
    shown = clearance_of(proof.problem, proof.trajectory)
    t, distance = floats(shown["t"]), floats(shown["distance"])
    scene, own, *pairs = shown["choices"]
    assert (scene["of"], own["of"]) == ("robot – scene", "robot – itself")
    both = np.minimum(floats(scene["distance"]), floats(own["distance"]))
    assert np.allclose(both, distance, atol=1e-6)
    model = CollisionModel(proof.problem.robot, proof.problem.scene)
    for one in pairs:
        alike = [found.index for found in model.pairs if f"{found.name_a} – {found.name_b}" == one["of"]]
        for k in (0, len(t) // 2):
            q = proof.trajectory(t[k : k + 1])[0]
            assert floats(one["distance"])[k] == pytest.approx(
                min(model.distance(q, pair).distance for pair in alike), abs=1e-4
            )
    assert clearance_of(proof.problem, proof.trajectory, chosen=False)["choices"] == []


def test_distances_of_the_scene_alone_are_those_of_obstacles_where_they_are_by_then(planar, motion):
    ball = Obstacle("ball", Sphere(0.1), at(2.0, 0.18, 1.0)).moving([[0.0, -0.8], [0.0], [0.0]])
    start, goal = np.array([0.5, 1.0]), np.array([0.9, 0.8])
    problem = op.Problem(planar, start, goal, scene=[ball])
    shown = clearance_of(problem, motion(problem, 1.5), even=20)
    (scene,) = [one for one in shown["choices"] if one["of"] == "robot – scene"]
    assert floats(scene["distance"]).min() == pytest.approx(shown["least"]["distance"], abs=1e-6)
    assert shown["least"]["pair"][1] == "ball"
