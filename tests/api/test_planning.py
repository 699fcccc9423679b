"""`op.plan`, `op.verify`, `op.retime`, `op.view`, and what a run can be asked for."""

import urllib.request

import numpy as np
import pytest

import optiplan as op
from optiplan.api import planning
from optiplan.errors import UnknownChoiceError


def test_plan_honours_the_problems_own_planner(problem):
    splined = op.Problem(problem.robot, "ready", "out", planner={"name": "cubic"}, limits={"jerk": "none"})
    run = op.plan(splined)
    assert (run.planner, run.options) == ("cubic", {})
    slow = op.Problem(problem.robot, "ready", "out", planner={"name": "quintic", "duration": 9.0})
    assert op.plan(slow).duration == pytest.approx(9.0)
    assert op.plan(slow, options={}).duration < 9.0
    assert op.plan(slow, "quintic").duration == pytest.approx(9.0)
    assert op.plan(slow, "septic").options == {}


def test_a_name_that_planning_does_not_find_is_no_argument(problem, monkeypatch):
    def lost(*_):
        raise UnknownChoiceError("frame", "cube", ["hand"])

    monkeypatch.setattr(planning.pipeline, "answer", lost)
    with pytest.raises(UnknownChoiceError, match="unknown frame 'cube'"):
        op.plan(problem)


def test_seed_budget_and_progress_are_handed_on(problem):
    stages = []
    run = op.plan(problem, "rrtconnect", budget=5, seed=3, progress=lambda stage, fraction: stages.append(stage))
    assert run.verified
    assert run.problem.seed == 3
    assert run.problem.hash == problem.hash
    assert "verify" in stages
    again = op.plan(problem, "rrtconnect", budget=op.Budget(5.0), seed=3)
    assert np.array_equal(again.trajectory.coefficients, run.trajectory.coefficients)


def test_a_trajectory_at_one_time_is_one_configuration(run):
    assert run.trajectory(0.1).shape == (2,)
    assert np.array_equal(run.trajectory(0.1, 1), run.trajectory([0.1, 0.2], 1)[0])
    assert run.trajectory(99.0, clamp=True).tolist() == run.trajectory.end.tolist()


class TestWarmStart:
    def test_a_worse_answer_does_not_replace_what_is_at_hand(self, problem, run):
        again = op.plan(problem, "quintic", {"duration": 2.0 * run.duration}, warm_start=run)
        assert again.info["warm_start"] == "kept"
        assert again.verified
        assert again.duration == run.duration
        assert again.report.verified

    def test_where_the_planner_fails_the_motion_at_hand_remains(self, problem, run):
        again = op.plan(problem, "quintic", {"duration": 0.01}, warm_start=run.trajectory)
        assert again.verified
        assert again.failure is None

    def test_a_better_answer_wins(self, problem, run):
        slow = op.plan(problem, "quintic", {"duration": 3.0 * run.duration})
        again = op.plan(problem, "quintic", warm_start=slow)
        assert again.info["warm_start"] == "beaten"
        assert again.duration == run.duration

    def test_a_motion_that_no_longer_holds_is_refused(self, problem, run):
        at = problem.robot  # a wall on the way: the tool passes it half-way
        data = at.model.createData()
        import pinocchio as pin

        pin.framesForwardKinematics(at.model, data, run.trajectory(0.5 * run.duration))
        place = data.oMf[at.frame_id(at.tool_frame)].translation
        blocked = problem.with_scene([op.Sphere("ball", radius=0.02, position=place)])
        again = op.plan(blocked, "quintic", warm_start=run)
        assert again.info["warm_start"] == "refused"
        assert not again.verified

    def test_a_motion_to_another_goal_is_refused(self, problem, run):
        again = op.plan(problem.with_goal("out"), "quintic", warm_start=run)
        assert again.info["warm_start"] == "refused"
        assert again.verified


class TestVerify:
    def test_a_motion_is_judged_in_whatever_form_it_comes(self, problem, run, tmp_path):
        motion = run.trajectory
        t = np.linspace(0.0, run.duration, 400)
        run.save(tmp_path / "run")
        run.export(tmp_path / "motion.csv")
        run.export(tmp_path / "motion.json")
        dense = op.Samples(motion.joint_names, t, motion(t), motion(t, 1), motion(t, 2))
        for given in (motion, run, dense, tmp_path / "run", str(tmp_path / "motion.csv"), tmp_path / "motion.json"):
            assert op.verify(problem, given).verified, given

    def test_positions_alone_are_interpolated_and_it_is_said(self, problem, run):
        t = np.linspace(0.0, run.duration, 50)
        report = op.verify(problem, (t, run.trajectory(t)))
        assert any("interpolation of the samples" in line for line in report.scope)

    def test_a_bad_motion_is_a_refusal(self, problem, run):
        fast = run.trajectory.scaled(0.5 * run.duration)
        assert not op.verify(problem, fast).verified

    def test_op_verify_is_both_a_function_and_a_room(self):
        import inspect

        import optiplan.verify.report
        from optiplan import planners, verify

        assert list(inspect.signature(op.verify).parameters) == ["problem", "motion"]
        assert op.verify is verify
        assert optiplan.verify.report.Report is op.Report
        assert "trajopt" in planners()


class TestRetime:
    POINTS = ((0.2, 0.3), (0.3, 0.4), (0.5, 0.6), (0.5, 1.0), (0.1, 1.0))

    def test_the_path_stays_what_it_is(self, problem):
        run = op.retime(problem, self.POINTS)
        assert run.verified
        assert (run.planner, len(run.problem.vias)) == ("retime", 3)
        Q = run.trajectory(np.linspace(0.0, run.duration, 2000))
        a, b = np.array(self.POINTS[:-1]), np.array(self.POINTS[1:])
        share = np.clip(((Q[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1), 0.0, 1.0)
        off = np.linalg.norm(Q[:, None] - a - share[..., None] * (b - a), axis=-1).min(axis=1)
        assert off.max() < 1e-9

    def test_it_does_not_stop_on_a_straight_line(self, problem):
        ends = np.array([[0.2, 0.3], [0.8, 0.9]])
        many = np.linspace(*ends, 30)
        run = op.retime(problem, many)
        assert run.verified
        assert run.duration == pytest.approx(op.retime(problem, ends).duration, rel=1e-9)

    def test_rounded_corners_are_faster_and_within_the_deviation(self, problem):
        sharp, rounded = op.retime(problem, self.POINTS), op.retime(problem, self.POINTS, deviation=0.05)
        assert rounded.verified
        assert rounded.duration < sharp.duration

    def test_a_path_through_something_is_not_verified(self, problem):
        ball = op.Sphere("ball", radius=0.05, position=(0.908, 0.18, -0.121))
        blocked = problem.with_scene([ball])
        run = op.retime(blocked, [[0.2, 0.0], [1.0, 0.0]])
        assert run.trajectory is not None
        assert [check.name for check in run.report.failures] == ["collision"]


def test_a_run_is_saved_and_found_again(run, tmp_path):
    run.save(tmp_path / "one")
    again = op.load_run(str(tmp_path / "one"))
    assert again.verified
    assert again.to_dict() | {"timings": 0, "report": 0} == run.to_dict() | {"timings": 0, "report": 0}
    of_files = {"samples", "duration"}
    assert {check.name for check in again.report.checks} == {check.name for check in run.report.checks} | of_files


def test_a_run_that_failed_is_found_again(problem, tmp_path):
    failed = op.plan(problem, "quintic", {"duration": 0.01})
    failed.save(tmp_path / "none")
    again = op.load_run(tmp_path / "none")
    assert (again.verified, again.failure.kind) == (False, failed.failure.kind)
    with pytest.raises(op.InputError, match="without a motion"):
        again.export(tmp_path / "none.csv")


def test_an_altered_motion_does_not_wear_its_old_verdict(run, tmp_path):
    run.save(tmp_path / "one")
    file = tmp_path / "one" / "trajectory.json"
    other = op.Trajectory(run.trajectory.joint_names, run.trajectory.breakpoints, 1.01 * run.trajectory.coefficients)
    import json

    file.write_text(json.dumps(other.to_dict()))
    altered = op.load_run(tmp_path / "one")
    assert not altered.verified
    with pytest.raises(op.InputError, match="not verified"):
        altered.export(tmp_path / "altered.csv")
    assert not (tmp_path / "altered.csv").exists()
    assert altered.export(tmp_path / "altered.csv", unverified=True).samples > 2


def test_exported_arrays_hold_the_motion(run, tmp_path):
    run.export(tmp_path / "new" / "motion.npz", rate=50.0)
    arrays = np.load(tmp_path / "new" / "motion.npz")
    assert arrays["joint_names"].tolist() == list(run.trajectory.joint_names)
    assert np.allclose(arrays["v"], run.trajectory(arrays["t"], 1))
    assert np.array_equal(arrays["coefficients"], run.trajectory.coefficients)


def test_a_view_is_served_until_it_is_closed(run, tmp_path):
    run.save(tmp_path / "one")
    with op.view(run, tmp_path / "one", block=False, port=0) as shown:
        page = urllib.request.urlopen(shown.url, timeout=20).read()
        assert b"turn" in page
        assert shown.url in repr(shown)
    assert "closed" in repr(shown)
    shown.close()
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(shown.url, timeout=5)
