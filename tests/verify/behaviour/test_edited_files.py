"""Files of a run that were edited: what another program acts upon is held against the problem and the motion."""

import json
from dataclasses import replace
from shutil import copytree

import numpy as np
import pytest

import optiplan as op
from optiplan.problem.problem import Problem
from optiplan.runs.metrics import measure
from optiplan.runs.run import Run
from optiplan.runs.run_folder import load_run, save_run
from optiplan.runs.stored_runs import judged
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify
from tests.verify.motions import quintic, within_limits


def joined(parts, segments):
    """Motions one after the other, with segments between these times, s."""
    begin = np.cumsum([0.0, *(part.duration for part in parts)])
    knots = [part.breakpoints[:-1] + t for part, t in zip(parts, begin, strict=False)]
    pieces = np.concatenate([part.coefficients for part in parts])
    return Trajectory(parts[0].joint_names, np.append(np.concatenate(knots), begin[-1]), pieces, segments(begin))


@pytest.fixture(scope="module")
def task():
    """A pick by an arm that stands in a cube's reach: a move, the fingers close, the cube is held, a move away."""
    robot = op.load_robot("delbot", group="base")
    there, back = [0.5, 0.2, 0.4], [0.0, 0.0, 0.0]
    crate = op.Box("crate", size=(0.1, 0.1, 0.1), position=(3.0, 3.0, 0.5))
    steps = [
        {"move": {"joints": there}, "name": "go"},
        {"dwell": 0.2},
        {"attach": {"object": "crate", "link": robot.tool_frame}},
        {"move": {"joints": back}, "name": "return"},
    ]
    return Problem(robot, start=back, task=steps, scene=[crate])


@pytest.fixture(scope="module")
def motion(task):
    out = within_limits(quintic(task.robot.joint_names, [0.0] * 3, [0.5, 0.2, 0.4], 1.0), task.limits, 0.9)
    home = within_limits(quintic(task.robot.joint_names, [0.5, 0.2, 0.4], [0.0] * 3, 1.0), task.limits, 0.9)
    still = quintic(task.robot.joint_names, [0.5, 0.2, 0.4], [0.5, 0.2, 0.4], 0.5)

    def segments(t):
        times = [(0.0, t[1]), (t[1], t[2]), (t[2], t[2]), (t[2], t[3])]
        return tuple(
            Segment(step.number, step.kind, step.name, float(a), float(b))
            for step, (a, b) in zip(task.task, times, strict=True)
        )

    return joined([out, still, home], segments)


@pytest.fixture(scope="module")
def saved(task, motion, tmp_path_factory):
    folder, report = tmp_path_factory.mktemp("saved") / "run", verify(task, motion)
    assert report.verified, report.failures
    save_run(Run(task, "own", {}, motion, None, report, None, measure(task, motion, report), {}, {}), folder)
    assert judged(task, load_run(folder)).verified
    return folder


@pytest.fixture
def folder(saved, tmp_path):
    """A copy of the run, to edit."""
    return copytree(saved, tmp_path / "run")


def edited(folder, file, change):
    data = json.loads((folder / file).read_text())
    change(data)
    (folder / file).write_text(json.dumps(data))


def failed(task, folder):
    return [check.name for check in judged(task, load_run(folder)).failures]


def shifted(key):
    def change(data):
        for one in data[key]:
            one["t" if "t" in one else "begin"] += 0.6

    return change


def assigned(key, value):
    return lambda data: data.__setitem__(key, value)


EVENTS = {
    "moved": shifted("events"),
    "emptied": assigned("events", []),
    "removed": lambda data: data.pop("events"),
    "no list": assigned("events", True),
    "doubled": lambda data: data["events"].extend(data["events"]),
    "named otherwise": lambda data: data["events"][0].__setitem__("name", "detach crate"),
    "of another kind": lambda data: data["events"][0].__setitem__("kind", "gripper"),
    "of a step that is true": lambda data: data["events"][0].__setitem__("step", True),
    "with a width": lambda data: data["events"][0].__setitem__("width", 0.2),
    "at a time that is no number": lambda data: data["events"][0].__setitem__("t", "0.6"),
}


@pytest.mark.parametrize("file", ["trajectory.json", "run.json"])
@pytest.mark.parametrize("change", EVENTS.values(), ids=EVENTS)
def test_events_are_those_of_the_motion(task, folder, file, change):
    edited(folder, file, change)
    assert failed(task, folder) == ["events"]


@pytest.mark.parametrize("change", [shifted("segments"), assigned("segments", [])])
def test_segments_of_the_record_are_those_of_the_motion(task, folder, change):
    edited(folder, "run.json", change)
    assert failed(task, folder) == ["events"]


def test_a_segment_has_the_name_of_its_step(task, folder):
    """Names stand in programs that are exported."""

    def change(data):
        data["segments"][2]["name"] = data["events"][0]["name"] = "detach crate"

    for file in ("trajectory.json", "run.json"):
        edited(folder, file, change)
    assert failed(task, folder) == ["segments"]


def test_events_of_a_motion_without_a_task_are_refused(task, motion, tmp_path):
    plain = Problem(task.robot, start=[0.0] * 3, goal=[0.0] * 3)
    assert [check.name for check in verify(plain, motion).failures] == ["segments"]
    bare = Trajectory(motion.joint_names, motion.breakpoints, motion.coefficients)
    file = tmp_path / "motion.json"
    file.write_text(json.dumps(bare.to_dict()))
    assert judged(plain, load_run(file)).verified
    file.write_text(json.dumps({**bare.to_dict(), "events": motion.to_dict()["events"]}))
    assert failed(plain, file) == ["events"]


def test_a_motion_from_elsewhere_needs_no_events(task, motion, tmp_path):
    data = motion.to_dict()
    del data["events"]
    (tmp_path / "motion.json").write_text(json.dumps(data))
    assert failed(task, tmp_path / "motion.json") == []


WHEELS = {
    "2 x + 1": lambda data: data.__setitem__("wheels", [[2 * x + 1 for x in row] for row in data["wheels"]]),
    "one rate": lambda data: data["wheels"][7].__setitem__(2, data["wheels"][7][2] + 0.01),
    "emptied": assigned("wheels", []),
    "left out": lambda data: (data.pop("wheels"), data.pop("wheel_names")),
    "text": assigned("wheels", "none"),
    "shorter": lambda data: data["wheels"].pop(),
    "swapped names": lambda data: data["wheel_names"].reverse(),
    "no names": lambda data: data.pop("wheel_names"),
    "nan": lambda data: data["wheels"][3].__setitem__(0, float("nan")),
}


@pytest.mark.parametrize("change", WHEELS.values(), ids=WHEELS)
def test_wheels_are_those_of_the_motion(task, folder, change):
    edited(folder, "trajectory.json", change)
    assert failed(task, folder) == ["wheels"]


def test_wheels_of_a_robot_without_are_refused(tmp_path):
    problem = op.Problem("planar2r", [0.5, 1.0], [-0.5, 1.2])
    run = op.plan(problem, "quintic")
    run.save(tmp_path)
    edited(tmp_path, "trajectory.json", assigned("wheels", [[0.0] * 4]))
    assert failed(problem, tmp_path) == ["wheels"]


@pytest.mark.parametrize("value", [1.0, None, True, "2.0"])
def test_the_duration_of_the_record_is_that_of_the_motion(task, folder, value):
    edited(folder, "run.json", assigned("duration", value))
    assert failed(task, folder) == ["duration"]


def test_what_is_not_read_is_named_beside_the_verdict(task, folder):
    edited(folder, "trajectory.json", assigned("gripper_force", 40.0))
    report = judged(task, load_run(folder))
    assert report.verified
    assert "in the file of the motion, neither read nor checked: 'gripper_force'" in report.scope


def test_a_loaded_run_is_held_against_its_files_too(task, folder):
    assert op.load_run(folder).verified
    edited(folder, "trajectory.json", assigned("events", []))
    run = op.load_run(folder)
    assert not run.verified
    assert replace(run, report=None).verified is False


@pytest.mark.parametrize("begin", [5.0, -1.0, float("nan")])
def test_a_tour_at_no_time_of_the_motion_is_refused(begin):
    problem = op.load_problem("45_spot_tour")
    number = next(step.number for step in problem.task if step.kind == "tour")
    still = Trajectory(problem.robot.joint_names, np.array([0.0, 1.0]), problem.start[None, None])
    motion = replace(still, segments=(Segment(number, "tour", "rib left", begin, begin),))
    assert not verify(problem, motion).verified
