"""What controllers read: ROS 2 messages, URScript, fixed cycles, and how far they are from the motion."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

from optiplan.robot.robot import load_robot
from optiplan.runs.controller_formats import ros_yaml, urscript
from optiplan.runs.export import FORMATS, export_trajectory
from optiplan.trajectory.fixed_rate import difference, interpolation_errors, on_cycle
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    """A UR5 through two corners, at its limits."""
    robot = load_robot("ur5")
    middle = [0.6, -1.1, 1.0, -1.5, -1.57, 0.3]
    corners = [[0, -1.5, 1.2, -1.3, -1.57, 0], middle, [1.6, -1.2, 1.1, -1.5, -1.57, 0]]
    return stop_at_corners(np.array(corners), robot.limits, robot.joint_names)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_a_joint_trajectory_message_holds_the_motion(motion, tmp_path, suffix):
    file = tmp_path / f"motion{suffix}"
    told = export_trajectory(motion, file, "ros", 100.0)
    message = json.loads(file.read_text()) if suffix == ".json" else YAML(typ="safe").load(file.read_text())
    assert list(message) == ["header", "joint_names", "points"]
    assert message["joint_names"] == list(motion.joint_names)
    times = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in message["points"]])
    assert len(times) == told.samples > 100 * motion.duration
    assert times[-1] == pytest.approx(motion.duration, abs=1e-9)
    for order, key in enumerate(("positions", "velocities", "accelerations")):
        assert np.allclose(
            [p[key] for p in message["points"]], motion(np.clip(times, 0, motion.duration), order), atol=1e-6
        )


def test_a_program_for_an_arm_servos_through_samples_of_the_motion(motion, tmp_path):
    told = export_trajectory(motion, tmp_path / "motion.script")
    text = (tmp_path / "motion.script").read_text()
    rows = np.array([[float(x) for x in row.split(",")] for row in re.findall(r"servoj\(\[(.*?)\]", text)])
    assert len(rows) == told.samples - 1
    assert told.duration * 500 == pytest.approx(round(told.duration * 500), abs=1e-9)
    slowed = on_cycle(motion, 500.0)
    assert rows == pytest.approx(slowed(np.arange(1, told.samples) / 500.0, clamp=True), abs=1e-7)
    assert text.count("t=0.002,") == len(rows)
    assert text.index("halt") < text.index("servoj"), "where the arm stands is looked at first"
    assert text.startswith("#")
    assert text.endswith("optiplan_motion()\n")


def test_an_event_at_the_end_is_in_both_languages(motion):
    last = Segment(1, "detach", "let go", motion.duration, motion.duration, "cube", "tool0")
    held, times = replace(motion, segments=(last,)), np.linspace(0.0, motion.duration, 11)
    for program in (ros_yaml(held, times), urscript(held, times)):
        assert program.count(b"step 1, let go") == 1


def test_a_motion_on_a_cycle_is_slower_by_less_than_one(motion):
    for rate in (30.0, 125.0, 1000.0):
        slowed = on_cycle(motion, rate)
        assert 0.0 <= slowed.duration - motion.duration < 1.0 / rate
        assert slowed.duration * rate == pytest.approx(round(slowed.duration * rate), abs=1e-9)
        assert slowed.end == pytest.approx(motion.end, abs=1e-12)
    on_one = on_cycle(motion, 125.0)
    assert on_cycle(on_one, 125.0).duration == pytest.approx(on_one.duration, rel=1e-12)


def test_errors_between_samples_are_those_of_a_dense_comparison(motion):
    t = np.linspace(0.0, motion.duration, 40)
    errors = interpolation_errors(motion, t)
    dense = np.linspace(0.0, motion.duration, 40_001)
    lines = np.stack([np.interp(dense, t, q) for q in motion(t).T], axis=1)
    met = np.abs(lines - motion(dense)).max(axis=0)
    assert np.all(errors["linear"] >= met - 1e-12)
    assert errors["linear"] == pytest.approx(met, rel=1e-3)
    assert errors["linear"].max() > errors["cubic"].max() > errors["quintic"].max() > 0.0
    at_breakpoints = interpolation_errors(motion, motion.breakpoints)["quintic"]
    assert at_breakpoints.max() < 1e-9, "cubic pieces between their own breakpoints"


def test_a_difference_of_motions_is_their_difference_at_all_times(motion):
    other = on_cycle(motion, 7.0).scaled(motion.duration)
    shifted = Trajectory(other.joint_names, other.breakpoints, other.coefficients * 1.25)
    t = np.linspace(0.0, motion.duration, 5001)
    assert difference(motion, shifted)(t) == pytest.approx(motion(t) - shifted(t), abs=1e-12)


def test_the_table_of_formats_is_whole():
    assert list(FORMATS) == ["csv", "json", "npz", "ros", "urscript"]
    suffixes = [suffix for kind in FORMATS.values() for suffix in kind.suffixes]
    assert len(suffixes) == len(set(suffixes))
