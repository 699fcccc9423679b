"""The two circles that the Delbot draws, with its arm and with platform and arm together: problems 27 and 28."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.planners.base import Budget
from optiplan.planners.cartesian.differential_ik import Aim, Tracker
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import circle
from optiplan.problem.load import load_problem
from optiplan.problem.problem import derived
from optiplan.robot.frames import frame_pose
from optiplan.runs.pipeline import run
from tests.reference.entries import entry

PROBLEMS = Path(__file__).parents[4] / "problems"
FLANGE = "wrist_3"  # the last frame of the table, whose circle the entry is about; the tool draws the same one


@pytest.fixture(scope="module", params=["27_circle", "28_circle_of_base_and_arm"])
def drawn(request):
    problem = load_problem(PROBLEMS / f"{request.param}.yaml")
    found = run(problem, problem.planner, problem.options, Budget(30.0), lambda stage, fraction: None)
    assert found.verified
    return problem, found.trajectory


def poses(problem, trajectory, frame, count=1500):
    """At random times: between knots, whatever these are."""
    t = np.sort(np.random.default_rng(0).uniform(0.0, trajectory.duration, count))
    return [frame_pose(problem.robot, q, frame) for q in trajectory(t)]


def test_the_circle_closes_and_is_round_at_all_times(drawn):
    problem, trajectory = drawn
    radius = problem.options["radius"]
    start = frame_pose(problem.robot, problem.start, problem.robot.tool_frame)
    end = frame_pose(problem.robot, trajectory.end, problem.robot.tool_frame)
    assert np.linalg.norm(end.translation - start.translation) <= 1e-9
    assert trajectory.end == pytest.approx(problem.start, abs=1e-9)  # of nine joints, too
    up, out = (2, 0) if problem.options["plane"] == "yz" else (1, 2)
    centre = start.translation - radius * np.eye(3)[up]
    found = poses(problem, trajectory, problem.robot.tool_frame)
    offset = np.array([X.translation for X in found]) - centre
    assert np.abs(offset[:, out]).max() <= 1e-6
    assert np.abs(np.linalg.norm(offset, axis=1) - radius).max() <= 1e-6
    assert max(np.abs(X.rotation - start.rotation).max() for X in found) <= 1e-6
    assert np.ptp(offset, axis=0) == pytest.approx(2.0 * radius * (np.eye(3)[out] == 0.0), abs=1e-2 * radius)


def test_the_arm_draws_the_circle_of_the_report():
    """`delbot.circle.reference`, seen from the arm; the report's own script ends 32 mm off, `delbot.circle.script`."""
    expected = entry("delbot.circle.reference")
    problem = load_problem(PROBLEMS / "27_circle.yaml")
    assert problem.start == pytest.approx(expected["q0"], abs=1e-12)
    foot = frame_pose(problem.robot, problem.start, "arm_base")
    flange = foot.actInv(frame_pose(problem.robot, problem.start, FLANGE))
    assert flange.translation == pytest.approx(expected["p0"], abs=1e-12)
    assert (problem.options["radius"], problem.options["duration"]) == (expected["radius"], expected["T"])
    closing = np.linalg.norm(drawn_points(problem)[-1] - drawn_points(problem)[0])
    assert closing <= 1e-6 < entry("delbot.circle.script")["closure_repo_jacobian"]
    assert closing < min(expected["closure"][name] for name in ("euler_40", "euler_400", "euler_4000"))


def test_joint_rates_on_the_circle_are_those_of_the_reference():
    """Run through evenly in T = 10 s, the fastest joint is as fast as `peak_joint_rate`."""
    expected = entry("delbot.circle.reference")
    path = followed(load_problem(PROBLEMS / "27_circle.yaml"))
    fastest = np.abs(path(np.linspace(0.0, 1.0, 2001), 1)).max() / expected["T"]
    expected.check(fastest, "peak_joint_rate", relative=True)


def followed(problem):
    start = frame_pose(problem.robot, problem.start, FLANGE)
    centre = start.translation - problem.options["radius"] * np.eye(3)[2]
    path = circle(start, centre, 2.0 * np.pi * np.eye(3)[0], np.zeros(3))
    model = CollisionModel(problem.robot, problem.scene)
    tracker = Tracker(problem.robot, problem.limits, FLANGE, path, Aim())
    return follow(model, tracker, problem.start, Budget(20.0))


def drawn_points(problem):
    path = followed(problem)
    return [frame_pose(problem.robot, q, FLANGE).translation for q in path(np.array([0.0, 1.0]))]


def test_the_fingers_dip_into_the_carrier():
    """The report's script knows nothing of it: filled up, the carrier would be in the way."""
    problem = load_problem(PROBLEMS / "27_circle.yaml")
    inside = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.125]))
    filling = Obstacle("filling", Box((0.28, 0.48, 0.14)), frame_pose(problem.robot, problem.start, "carrier") * inside)
    failure = followed(derived(problem, scene=Scene((filling,))))
    assert failure.kind == "collision"
    assert "filling" in failure.witness["pair"]
