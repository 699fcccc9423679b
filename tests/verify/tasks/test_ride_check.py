"""What is taken from what moves is proved relative to it: millimetres, and millimetres per second, off are refused."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import derived
from optiplan.problem.task.timeline import scene_parts
from optiplan.runs.run_folder import load_run, save_run
from optiplan.runs.stored_runs import judged
from optiplan.trajectory.joining import join_trajectories, standstill
from optiplan.verify.verify import verify
from tests.checks import named
from tests.planned import planned_until

SPEED, TURN = 0.3, 0.5
"""m/s of the belt, rad/s of the table."""
TAKE = [
    {"approach": {"pose": {"in": "belt", "position": [0, 0, 0.02], "rpy_deg": [180, 0, 0]}, "distance": 0.06}},
    {"attach": {"object": "cube", "link": "panda_hand", "touch": ["panda_leftfinger", "panda_rightfinger"]}},
    {"gripper": {"group": "hand", "joints": [0.02]}},
    {"dwell": 0.1},
    {"retreat": {"distance": 0.06, "along": [0, 0, 1], "in": "belt"}},
    {"move": {"configuration": "ready"}},
]


def data_of(motion, position, task=TAKE):
    cube = {"name": "cube", "shape": {"box": [0.04, 0.04, 0.04]}, "pose": {"in": "belt", "position": [0, 0, 0.02]}}
    frame = {"position": position, "motion": motion}
    return {
        "version": 1,
        "robot": "panda",
        "start": {"configuration": "ready"},
        "frames": {"belt": frame},
        "scene": {"obstacles": [cube]},
        "task": copy.deepcopy(task),
    }


def on_belt(speed=SPEED, y=-0.6, x=0.5, task=TAKE):
    return data_of({"polynomial": [[0], [0, speed], [0]]}, [x, y, 0.1], task)


@pytest.fixture(scope="module")
def run():
    found = planned_until(problem_from_dict(on_belt()), seconds=300.0)
    assert found.verified, found.report and found.report.failures
    return found


def taken(run):
    """When the cube is taken, s."""
    return next(one.begin for one in run.trajectory.segments if one.kind == "attach")


def failed(problem, motion):
    return {check.name for check in verify(problem, motion).failures}


def test_every_step_with_the_belt_is_proved_relative_to_it(run):
    covered = {one for check in run.report.checks for one in check.covers}
    assert {f"task[{k}].ride" for k in range(6)} <= covered
    assert "task[6].ride" not in covered  # the move home is in the world
    ride = named(run.report, "ride")
    assert ride.kind == "continuous"
    held = [one for step, one in enumerate(run.problem.task) if one.ride is not None]
    assert {one.ride.mover.name for one in held} == {"belt"}


def test_the_tool_goes_with_the_belt_while_the_fingers_close(run):
    """An outside look: poses at dense times, with none of the verifier's means."""
    motion, robot = run.trajectory, run.problem.robot
    closing = next(one for one in motion.segments if one.kind == "gripper")
    places = []
    for t in np.linspace(closing.begin, closing.end, 200):
        p = np.array(robot.fk(motion(float(t))).position)
        places.append(p - [0.5, -0.6 + SPEED * t, 0.12])
    assert np.abs(places).max() < 1e-4


@pytest.mark.parametrize("off", [[0.003, 0, 0], [0, 0.003, 0], [0, 0, 0.003]])
def test_a_hand_3_mm_beside_what_it_takes_is_refused(run, off):
    data = on_belt()
    at = data["frames"]["belt"]["position"]
    data["frames"]["belt"]["position"] = [a + b for a, b in zip(at, off, strict=True)]
    assert "goal" in failed(problem_from_dict(data), run.trajectory)


def test_a_hand_that_lags_by_10_ms_is_refused(run, tmp_path):
    """3 mm behind all the time, with the same velocity: in a run folder, too."""
    still = standstill(run.trajectory.joint_names, run.trajectory.start, 0.01)
    whole = join_trajectories([still, replace(run.trajectory, segments=())])
    own = run.trajectory.segments
    later = [replace(one, begin=one.begin + 0.01 * (k > 0), end=one.end + 0.01) for k, one in enumerate(own)]
    late = replace(whole, segments=tuple(later))
    report = verify(run.problem, late)
    assert {"goal", "line"} & {check.name for check in report.failures}
    assert not report.verified
    save_run(run, tmp_path / "run")
    assert judged(run.problem, load_run(tmp_path / "run")).verified
    (tmp_path / "run" / "trajectory.json").write_text(json.dumps(late.to_dict()))
    assert {"goal", "line"} & {check.name for check in judged(run.problem, load_run(tmp_path / "run")).failures}


def test_a_hand_10_mm_per_s_slower_than_what_it_takes_is_refused(run):
    """At the moment of the grasp the place is right, to 1e-9 m; the velocity is not."""
    t, faster = taken(run), SPEED + 0.01
    data = on_belt(speed=faster, y=-0.6 - 0.01 * t)
    report = verify(problem_from_dict(data), run.trajectory)
    ride = named(report, "ride")
    assert not ride.passed
    assert ride.worst == pytest.approx(0.01, rel=0.5)
    assert not report.verified


def test_what_moves_otherwise_than_the_arm_is_not_taken(run):
    slower = run.problem.scene.obstacles[0].motion
    other = replace(slower, coefficients=slower.coefficients * 0.999)
    scene = replace(run.problem.scene, obstacles=(replace(run.problem.scene.obstacles[0], motion=other),))
    report = verify(derived(run.problem, scene=scene), run.trajectory)
    assert "ride" in {check.name for check in report.failures}
    alone = tuple(replace(step, ride=None) for step in run.problem.task)
    assert "ride" in failed(derived(run.problem, task=alone), run.trajectory)


def test_statements_of_rides_that_nothing_was_checked_of_are_refused(run, monkeypatch):
    monkeypatch.setattr("optiplan.verify.tasks.task_check.ride_checks", lambda *_: iter(()))
    assert "statements" in failed(run.problem, run.trajectory)


def test_fingers_that_move_while_the_hand_rests_are_refused(run):
    """Joints that do not lead the hand stand still, as in any step."""
    coefficients = np.array(run.trajectory.coefficients)
    closing = next(one for one in run.trajectory.segments if one.kind == "dwell")
    piece = int(np.searchsorted(run.trajectory.breakpoints, closing.begin + 1e-6) - 1)
    coefficients[piece, 1, 7] += 1e-3
    assert "standstill" in failed(run.problem, replace(run.trajectory, coefficients=coefficients))


def test_a_turntable_is_picked_from():
    data = data_of({"turn": {"axis": [0, 0, 1], "angle": [0, TURN]}}, [0.6, 0.0, 0.1])
    place = [0.1, 0, 0.02]
    data["scene"]["obstacles"][0]["pose"]["position"] = place
    data["task"][0]["approach"]["pose"]["position"] = place
    found = planned_until(problem_from_dict(data), seconds=300.0)
    assert found.verified, found.failure or found.report.failures
    t = taken(found)
    turn = TURN * t
    p = np.array(found.problem.robot.fk(found.trajectory(t)).position)
    assert p == pytest.approx([0.6 + 0.1 * np.cos(turn), 0.1 * np.sin(turn), 0.12], abs=2e-4)
    data["frames"]["belt"]["motion"]["turn"]["angle"] = [0.02 * t, TURN - 0.02]  # 2 mm/s at the grasp
    assert "ride" in failed(problem_from_dict(data), found.trajectory)


def test_what_is_let_go_on_something_that_moves_goes_on_with_it():
    start = {"configuration": "ready"}
    hand = {"name": "cube", "shape": {"box": [0.04, 0.04, 0.04]}, "link": "panda_hand", "mass": 0.1}
    hand |= {"pose": {"position": [0, 0, 0.1034]}, "touch": ["panda_leftfinger", "panda_rightfinger"]}
    task = [
        {"approach": {"pose": {"in": "belt", "position": [0, 0, 0.03], "rpy_deg": [180, 0, 0]}, "distance": 0.06}},
        {"gripper": {"group": "hand", "joints": [0.04]}},
        {"detach": {"object": "cube"}},
        {"retreat": {"distance": 0.08}},
        {"move": {"configuration": "ready"}},
    ]
    data = on_belt(task=task) | {
        "scene": {"attached": [hand]},
        "start": start,
        "locked": {"panda_finger_joint1": 0.025},
    }
    found = planned_until(problem_from_dict(data), seconds=300.0)
    assert found.verified, found.failure or found.report.failures
    motion = found.trajectory
    let_go = next(one.begin for one in motion.segments if one.kind == "detach")
    last = scene_parts(found.problem, motion)[-1]
    (cube,) = last.problem.scene.dynamic_obstacles
    at = cube.motion.pose(0.0) * cube.X_WO
    assert last.begin == pytest.approx(let_go)
    assert at.translation[1] == pytest.approx(-0.6 + SPEED * let_go, abs=1e-3)
    assert cube.motion.at(np.array([0.0]), 1)[0] == pytest.approx([0, SPEED, 0])
    task = tuple(
        replace(step, action=replace(step.action, mover=None)) if step.kind == "detach" else step
        for step in found.problem.task
    )
    assert "ride" in failed(derived(found.problem, task=task), motion)  # it would stand where the hand lets it go


def test_what_is_held_is_brought_by_its_own_frame_to_what_moves():
    x, y, z = op.load_robot("panda").fk("ready").to_data()["position"]
    cube = {"name": "cube", "shape": {"box": [0.04, 0.04, 0.04]}, "pose": {"position": [x, y, z - 0.05]}}
    pose = {"frame": "cube", "in": "belt", "position": [0, 0, 0.03]}
    task = [
        {"attach": {"object": "cube", "link": "panda_hand", "touch": ["panda_leftfinger", "panda_rightfinger"]}},
        {"approach": {"pose": pose, "along": [0, 0, -1], "distance": 0.06}},
        {"detach": {"object": "cube"}},
        {"move": {"configuration": "ready"}},
    ]
    scene = {"scene": {"obstacles": [cube]}}
    found = planned_until(problem_from_dict(on_belt(task=task) | scene), seconds=300.0)
    assert found.verified, found.failure or found.report.failures
    task.insert(3, {"dwell": 0.1})
    with pytest.raises(op.InputError, match="a dwell after 'cube', which went with 'belt', is released"):
        problem_from_dict(on_belt(task=task) | scene)


def test_a_wait_is_proved():
    task = [{"wait_until": "belt.y > -0.3"}, {"move": {"joints": [0.3, -0.785, 0, -2.356, 0, 1.571, 0.785]}}]
    found = planned_until(problem_from_dict(on_belt(task=task)), seconds=300.0)
    assert found.verified
    first = found.trajectory.segments[0]
    assert first.end == pytest.approx(1.0, abs=1e-4)
    later = problem_from_dict(on_belt(task=[{"wait_until": "belt.y > -0.297"}, task[1]]))
    assert failed(later, found.trajectory) == {"standstill"}


def test_a_run_with_the_belt_is_neither_executed_nor_simulated(run):
    """The belt goes by the clock: a robot that is slowed down would be late."""
    for call in (op.execute, op.Executor):
        with pytest.raises(op.InputError, match=r"goes with what moves|by the clock"):
            call(run)
    assert run.ratio >= 1.0
