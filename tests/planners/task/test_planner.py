"""A task is planned, proved, stored and read again; each way of cheating is refused."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.planners.base import Budget
from optiplan.planners.task import planner, search
from optiplan.planners.task.chains import do_chain
from optiplan.planners.task.sections import timed_step
from optiplan.planners.task.stages import Stages, WorldState
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.problem.problem import derived
from optiplan.problem.task.timeline import scene_parts
from optiplan.verify.verify import verify
from optiplan.viewer.moving_objects import moved_by, object_stays
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from tests.checks import named
from tests.planned import planned_until

FILE = Path(__file__).parents[2] / "problem" / "one_cube.yaml"


@pytest.fixture(scope="module")
def run():
    """A verified motion of a task with every kind of step."""
    found = op.plan(load_problem(FILE), budget=120.0)
    assert found.verified, (found.failure, found.report)
    return found


def check(problem, trajectory, name):
    return named(verify(problem, trajectory), name)


def test_every_step_has_its_part_of_one_motion(run):
    segments = run.trajectory.segments
    assert [segment.step for segment in segments] == [1, 1, 2, 3, 4, 5, 5, 6, 7, 8, 9]
    assert segments[0].begin == 0.0
    assert segments[-1].end == pytest.approx(run.duration)
    assert segments[2].begin == segments[2].end
    assert segments[9].end - segments[9].begin == pytest.approx(0.2)
    names = {check.name: check.kind for check in run.report.checks}
    assert names["line"] == names["collision"] == names["torque"] == "continuous"
    assert names["steps"] == names["goal"] == names["standstill"] == "exact"
    assert run.lower_bound_of == "stops"
    assert 1.0 < run.ratio < 2.0


def test_the_arm_does_not_stop_where_it_need_not(run):
    segments, speed = run.trajectory.segments, []
    for at in (segments[0].end, segments[4].end, segments[5].end):  # into the line, out of it, into the next
        speed.append(np.abs(run.trajectory(at, 1)).max())
    assert min(speed) > 0.1
    assert run.duration < run.info["duration_with_stops"]
    for event in (segments[2], segments[8]):
        assert np.abs(run.trajectory(event.begin, 1)).max() < 1e-6


def test_the_proof_is_about_what_is_held(run):
    parts = scene_parts(run.problem, run.trajectory)
    assert [[held.name for held in part.problem.scene.attached] for part in parts] == [[], ["cube"], []]
    assert [part.problem.robot.mounting.mass for part in parts] == pytest.approx([0.0, 0.1, 0.0])
    assert "cube is held from" in " ".join(run.report.scope)
    released = parts[-1].problem.scene.obstacles[-1]
    assert np.allclose(released.X_WO.translation, [0.5, -0.2, 0.027], atol=2e-3)


def test_it_is_stored_and_proved_again_from_the_files(run, tmp_path):
    run.save(tmp_path / "run")
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert [event["kind"] for event in record["events"]] == ["attach", "gripper", "gripper", "detach"]
    again = op.verify(problem_from_dict(record["problem"]), tmp_path / "run")
    assert again.verified, again
    slower = run.trajectory.scaled(1.5 * run.duration)
    assert op.verify(run.problem, slower).verified


def moved(run, k, **times):
    """The motion with another time of one segment, and its neighbours to fit."""
    segments = list(run.trajectory.segments)
    segments[k] = replace(segments[k], **times)
    if "begin" in times:
        segments[k - 1] = replace(segments[k - 1], end=times["begin"])
    if "end" in times:
        segments[k + 1] = replace(segments[k + 1], begin=times["end"])
    return replace(run.trajectory, segments=tuple(segments))


def test_a_motion_without_its_steps_is_refused(run):
    bare = replace(run.trajectory, segments=())
    found = check(run.problem, bare, "steps")
    assert not found.passed
    assert "0 segments for 11" in found.detail
    swapped = replace(run.trajectory, segments=tuple(reversed(run.trajectory.segments)))
    assert not verify(run.problem, swapped).verified


def test_an_event_while_the_arm_moves_is_refused(run):
    early = run.trajectory.segments[2].begin - 0.05
    trajectory = moved(run, 2, begin=early, end=early)
    report = verify(run.problem, trajectory)
    failed = {check.name for check in report.failures}
    assert {"standstill", "goal"} <= failed
    assert "moves at the event of step 2" in check(run.problem, trajectory, "standstill").detail


def test_a_dwell_that_is_too_short_is_refused(run):
    begin = run.trajectory.segments[9].begin
    found = check(run.problem, moved(run, 9, end=begin + 0.1), "standstill")
    assert not found.passed


def test_a_line_that_is_none_is_refused(run):
    """The end of the free move counted as part of the line is not straight."""
    found = check(run.problem, moved(run, 1, begin=run.trajectory.segments[1].begin - 0.3), "line")
    assert not found.passed
    assert "step 1" in found.detail


def test_what_is_held_must_not_touch_anything(run):
    """A rod through the way of the cube alone, which the arm itself passes above."""
    segments = run.trajectory.segments
    middle = 0.5 * (segments[5].begin + segments[5].end)
    part = scene_parts(run.problem, run.trajectory)[1]
    model = part.problem.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, run.trajectory(middle))
    (held,) = part.problem.scene.attached
    place = (data.oMf[model.getFrameId(held.link)] * held.X_LO).translation - [0.0, 0.0, 0.03]
    pin_in_the_way = op.Sphere("pin", 0.01, position=place.tolist())
    problem = run.problem.with_scene(run.problem.scene.with_(pin_in_the_way))
    found = check(problem, run.trajectory, "collision")
    assert not found.passed
    assert set(found.witness["pair"]) == {"cube", "pin"}


def test_a_step_that_cannot_be_done_is_named(run):
    far = [dict(step) for step in run.problem.source["task"]]
    far[4] = {
        "name": "too far",
        "approach": {"pose": {"position": [1.5, 0, 0.1], "rpy": [3.14, 0, 0]}, "distance": 0.1},
    }
    failed = op.plan(run.problem.with_task(far), budget=30.0)
    assert failed.failure.kind == "goal-unreachable"
    assert failed.failure.detail.startswith("step 5 (too far): ")
    assert failed.failure.witness["step"] == 5
    assert len(failed.failure.witness["q"]) == run.problem.robot.n


def test_looking_ahead_leaves_out_ends_without_a_way_on():
    """Of two ways to grasp only one leaves room for the line out; the nearer one must be given up."""
    ready = load_problem(FILE)
    near = {"joints": [0.3, *ready.start[1:7]]}
    task = [{"move": {"any_of": [near, {"joints": [-0.6, *ready.start[1:7]]}]}}, {"line": {"by": [0.0, 0.3, 0.0]}}]
    blocked = op.Box("block", size=(0.02, 0.02, 0.4), position=(0.32, 0.33, 0.5))
    problem = op.Problem("panda", "ready", task=task, scene=[blocked])
    run = planned_until(problem, seconds=60.0)
    assert run.verified
    assert run.trajectory(run.trajectory.segments[0].end)[0] == pytest.approx(-0.6, abs=1e-5)


def test_looking_ahead_leaves_out_lines_that_are_too_heavy():
    """Stretched out, the arm cannot hold itself; what the line takes is known before moves are planned."""
    ready = load_problem(FILE)
    near, far = ([angle, *ready.start[1:7]] for angle in (0.3, 2.6))
    line = {"line": {"by": [0.2, 0.0, 0.0]}}
    task = [{"move": {"any_of": [{"joints": near}, {"joints": far}]}}, line]
    problem = op.Problem("panda", "ready", task=task)
    torque = np.array([87.0, 15.0, 87.0, 87.0, 12.0, 12.0, 12.0])
    weak = derived(problem, limits=replace(problem.limits, torque=torque))
    run = planned_until(weak, seconds=60.0)
    assert run.verified
    assert run.trajectory(run.trajectory.segments[0].end)[0] == pytest.approx(2.6, abs=1e-5)
    stretched = derived(weak, task=op.Problem("panda", "ready", task=[line]).task)
    failed = op.plan(stretched, budget=60.0)
    assert failed.failure.kind == "limits"
    assert failed.failure.detail.startswith("step 1 (line): gravity alone exceeds the torque limits along the line")


def test_a_line_is_timed_within_the_budget():
    """When time is over, the law is a plain one, not none."""
    problem = op.Problem("panda", "ready", task=[{"line": {"by": [0.2, 0.2, 0.0]}}])
    steps = do_chain(Stages(problem), WorldState(problem.start, problem.scene), problem.task, Budget(60.0))
    slow, quick = (timed_step(steps.steps[0], Budget(seconds)) for seconds in (0.0, 60.0))
    assert 1.02 * quick.duration < slow.duration < 3.0 * quick.duration


@pytest.fixture(scope="module")
def short():
    """A line from either of two configurations: what is hurried needs no more."""
    first, *rest = load_problem(FILE).start[:7]
    ends = [{"joints": [first + angle, *rest]} for angle in (0.3, -0.6)]
    task = [{"move": {"any_of": ends}}, {"line": {"by": [0.0, 0.0, 0.1]}}]
    return op.Problem("panda", "ready", task=task).with_parts(clearance=0)


def _hurried(monkeypatch, wanted):
    """Search as if the part of the time for looking ahead were over at once; `wanted` tells which candidates hold."""
    paces, ahead = [], search.TaskSearch._candidates

    def candidates(self, leg, state, failures, pace):
        paces.append(pace.seconds)
        found = ahead(self, leg, state, failures, pace if pace.seconds > 50.0 else Budget(0.0))
        return found if wanted(len(found)) else []

    monkeypatch.setattr(search.TaskSearch, "_candidates", candidates)
    return paces


def test_a_hurried_search_goes_on_with_what_it_has(short, monkeypatch):
    _hurried(monkeypatch, lambda found: found == 1)  # else without a motion
    found = op.plan(short, "rrtconnect", budget=60.0)
    assert found.verified
    assert found.info["cut_short"]


def test_a_move_that_was_hurried_makes_a_task_that_was(short, monkeypatch):
    """`cut_short` was false, and another run of the same seed found another motion."""

    def hurried(*arguments, through=search.plan_through):
        result = through(*arguments)
        return replace(result, info={**result.info, "cut_short": True})

    monkeypatch.setattr(search, "plan_through", hurried)
    found = op.plan(short, "rrtconnect", budget=60.0)
    assert found.verified
    assert found.info["cut_short"]


def test_a_line_is_as_slow_as_the_constraint_of_another_frame_asks_and_other_steps_are_not():
    """The whole task was made so slow, since only limits on the frame that follows the line were planned for."""
    slow = {"frame": "panda_hand", "linear": 0.1}
    task = op.Task().line(by=(0, 0, -0.1), path_constraints=[{"tool_speed": slow}]).move("extended")
    found = op.plan(op.Problem("panda", "ready", task=task).with_parts(clearance=0), budget=60.0)
    assert found.verified, found.why_not
    assert "slowed" not in found.info
    line, move = found.trajectory.segments
    assert 1.0 < line.end < 1.3
    assert move.end - move.begin < 1.5


@pytest.mark.parametrize("obstacles_move", [False, True])
def test_steps_that_no_time_was_left_to_join_make_a_task_that_was_cut_short(short, monkeypatch, obstacles_move):
    ball = op.Sphere("ball", 0.05, position=(-1.0, 0.0, 0.5))
    moving = derived(short, scene=short.scene.with_(ball.moving([[0, 0.1], [0], [0]], until=0.5)))
    problem = moving if obstacles_move else short
    monkeypatch.setattr(planner, "_JOINING", 0.0)
    found = op.plan(problem, "rrtconnect", budget=60.0)
    assert found.verified
    assert found.info["cut_short"]


def test_a_hurried_search_in_vain_looks_at_all_candidates(short, monkeypatch):
    paces = _hurried(monkeypatch, lambda found: found > 1)
    found = planned_until(short, "rrtconnect", 60.0)
    assert found.verified
    assert min(paces) < 20.0 < 50.0 < max(paces)


def test_objects_go_with_what_holds_them_on_the_page(run):
    (cube,) = object_stays(run.problem, run.trajectory, moved_by(run.problem.task))
    assert [stay.body > 0 for stay in cube.stays] == [False, True, False]
    scene = build_scene(run.problem, [("one", run.trajectory, None)])
    (shown,) = scene.runs[0]["objects"]
    assert shown["name"] == "cube"
    assert [stay["begin"] for stay in shown["stays"]] == pytest.approx([stay.begin for stay in cube.stays])
    assert [part["name"] for part in scene.parts if part["set"] == "obstacle"] == ["table"]
    assert len(scene.runs[0]["segments"]) == 11


def test_runs_of_several_problems_have_their_own_obstacles(run):
    other = run.problem.with_scene(run.problem.scene.with_(op.Sphere("ball", 0.05, position=(0.3, 0.5, 0.5))))
    one = ViewedRun("one", run.trajectory, None, problem=run.problem)
    two = ViewedRun("two", None, None, problem=other)
    scene = build_scene(run.problem, [one, two])
    assert scene.several
    assert [sorted(thing["name"] for thing in shown["objects"]) for shown in scene.runs] == [
        ["cube", "table"],
        ["ball", "cube", "table"],
    ]


def test_exports_name_the_events(run, tmp_path):
    run.export(tmp_path / "cube.yaml")
    text = (tmp_path / "cube.yaml").read_text()
    assert text.count("# at ") == 4
    assert "step 2, attach cube" in text
    run.export(tmp_path / "cube.json", cyclic=True, rate=250.0)
    events = json.loads((tmp_path / "cube.json").read_text())["events"]
    assert [event["step"] for event in events] == [2, 3, 6, 7]
    held = [(event.get("object"), event.get("link")) for event in events]
    assert held[0] == held[3] == (events[0]["object"], "panda_hand")
    assert held[1] == held[2] == (None, None)
    assert events[0]["object"] in events[0]["name"]
    stored = op.Trajectory.from_dict(json.loads((tmp_path / "cube.json").read_text()))
    assert op.verify(run.problem, stored).verified
    for wrong in ({"object": "table"}, {"link": "panda_leftfinger"}):
        others = tuple(replace(one, **wrong) if one.object else one for one in stored.segments)
        report = op.verify(run.problem, replace(stored, segments=others))
        assert [check.name for check in report.failures] == ["steps"]


LIFTED, TAKEN = "step 4 (retreat)", "step 3 (attach part)"


@pytest.mark.parametrize(("gap", "refused"), [(1e-11, (LIFTED,)), (0.0, (LIFTED, TAKEN)), (-1e-4, (TAKEN,))])
def test_what_stands_on_a_table_is_lifted_with_what_the_message_says(gap, refused):
    """Where it touches, rounding says whether it can be taken."""
    message = lifted(gap)
    assert message.startswith(refused)
    assert "`allowed_collisions: [[part, belt]]` in this step" in message
    distance = float(re.search(r"place 'part' ([\d.]+) mm away from it", message)[1])
    assert distance == pytest.approx(0.1 - 1e3 * gap)
    assert lifted(gap + 1e-3 * distance) == ""
    assert lifted(gap, allowed_collisions=[("part", "belt")]) == ""


def lifted(gap, **step):
    """Why a part above a belt cannot be lifted."""
    scene = op.Scene(
        [op.Box("belt", (0.4, 0.4, 0.1), (0.5, 0, 0.15)), op.Box("part", (0.04, 0.04, 0.06), (0.5, 0, 0.23 + gap))]
    )
    above = op.ik("panda", op.Pose((0.5, 0, 0.34), rpy=(np.pi, 0, 0)))
    hand = [("part", link) for link in ("panda_hand", "panda_leftfinger", "panda_rightfinger")]
    task = op.Task().move(above).line(by=(0, 0, -0.1), allowed_collisions=hand)
    task = task.attach("part", "panda_hand", touch=["panda_leftfinger", "panda_rightfinger"], **step).retreat(
        0.15, **step
    )
    run = planned_until(op.Problem("panda", "ready", scene=scene, task=task))
    detail = "" if run.failure is None else run.failure.detail
    assert run.verified == (run.failure is None)
    return detail
