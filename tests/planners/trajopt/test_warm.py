"""From an earlier motion: it is cut, bent and optimised; where that leads to nothing as good, a search follows."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, Candidate, PlanResult
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.planners.trajopt.warm import WarmStart
from optiplan.problem.problem import derived
from optiplan.robot.frames import frame_pose
from optiplan.runs.pipeline import run
from optiplan.trajectory.timing.lower_bound import lower_bound
from tests.planners import cases


def silent(stage, fraction):
    pass


def plan(problem, earlier=None, budget=4.0):
    return run(problem, "trajopt", {}, Budget(budget), silent, earlier)


@pytest.fixture(scope="module")
def first():
    problem = cases.wall()
    return problem, plan(problem).trajectory


def moved(problem, **by):
    name = problem.scene.names[0]
    return derived(problem, scene=problem.scene.moved(name, **by))


@pytest.mark.parametrize("by", [{"z": 0.05}, {"x": -0.05}, {"y": 0.05}, {"z": -0.05}])
def test_after_a_change_of_scene(first, by):
    problem, earlier = first
    found = plan(moved(problem, **by), earlier)
    assert found.verified
    assert [each["seed"] for each in found.info["attempts"]] == ["warm"], "no search was needed"
    assert found.info["attempts"][0]["iterations"] < 30
    assert found.duration < 1.1 * earlier.duration


def test_after_a_change_of_goal_and_start(first):
    problem, earlier = first
    goal, start = problem.goal[0].q + 0.04, problem.start - 0.03
    found = plan(derived(problem, goal=(op.JointGoal(goal),), start=start), earlier)
    assert found.verified
    assert [each["seed"] for each in found.info["attempts"]] == ["warm"]
    assert found.trajectory.end == pytest.approx(goal, abs=1e-6)


def test_from_a_start_that_moved_it_takes_no_longer_than_anew(first):
    """A robot at rest begins at the rest of the earlier motion, not in its midst, where it passes nearer."""
    problem, earlier = first
    further = earlier(0.1 * earlier.duration)
    there = derived(problem, start=further + 0.01)
    warm = WarmStart(there, earlier, TrajOptOptions(), Budget(4.0), silent)
    assert warm.earlier.duration == earlier.duration
    assert warm.good
    assert warm.best.duration <= 1.01 * plan(there).duration
    on = WarmStart(problem.with_start(op.State(further)), earlier, TrajOptOptions(), Budget(4.0), silent)
    assert on.earlier.duration == earlier.duration
    moving = problem.with_start(earlier.state(0.1 * earlier.duration))
    assert WarmStart(moving, earlier, TrajOptOptions(), Budget(4.0), silent).earlier.duration == pytest.approx(
        0.9 * earlier.duration, rel=1e-6
    )


def test_a_pose_that_moved():
    problem = cases.pose()
    earlier = plan(problem).trajectory
    there = problem.goal[0].X_WG.copy()
    there.translation = there.translation + np.array([0.03, -0.03, 0.02])
    found = plan(derived(problem, goal=(replace(problem.goal[0], X_WG=there),)), earlier)
    assert found.verified
    assert [each["seed"] for each in found.info["attempts"]] == ["warm"]
    assert np.abs(found.trajectory.end - earlier.end).max() < 0.3, "the arm stays in its branch"


def room_to_brake(problem):
    """Gap at the start over the least way in which its rate can be brought to zero: below 1 bodies must touch.

    The gap g falls with rate -dg/dq v, which changes by at most |dg/dq| a_max a second.
    """
    model, state, step = planning_model(problem.robot, problem.scene), problem.start_state, 1e-6
    gap = model.clearance(state.q).distance
    slope = np.array([(model.clearance(state.q + step * e).distance - gap) / step for e in np.eye(len(state.q))])
    rate = min(float(slope @ state.v), 0.0)
    return gap / max(0.5 * rate**2 / float(np.abs(slope) @ problem.limits.acceleration), 1e-9)


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7])
def test_on_the_way(first, share):
    """The plate moves away from the arm's side of it, up or down: two motions past it are equally quick."""
    problem, earlier = first
    state = earlier.state(share * earlier.duration)
    there = [moved(problem, z=z).with_start(state) for z in (0.03, -0.03)]
    there = max(there, key=room_to_brake)
    assert room_to_brake(there) > 2.0, "what this test takes for granted"
    found = plan(there, earlier)
    assert found.verified
    for order, value in enumerate((state.q, state.v, state.a)):
        assert found.trajectory(0.0, order) == pytest.approx(value, abs=1e-6)
    assert found.duration <= 1.1 * (1.0 - share) * earlier.duration + 0.02


def test_where_nothing_can_brake_in_time_the_failure_names_what_is_met():
    """A finger 1.1 mm from the plate, at 0.7 m/s towards it, can brake within 15 mm at best."""
    q = [0.44391973, -0.45481777, 0.04243112, -2.06715845, -0.19076427, 1.95309646, 0.7030441]
    v = [2.05565126, 2.15425331, 0.37811291, 1.4007706, -0.23345973, 1.49796169, -1.0766547]
    near = moved(cases.wall(), z=0.03).with_start(op.State(q, v))
    assert 0.0 < room_to_brake(near) < 0.2
    found = plan(near)
    assert found.failure.kind == "collision"
    assert "stopping at once is no way out: 'panda_rightfinger' meets 'plate'" in found.failure.detail


def test_what_is_left_of_the_motion_is_an_answer(first):
    problem, earlier = first
    state = earlier.state(0.31 * earlier.duration)
    warm = WarmStart(problem.with_start(state), earlier, TrajOptOptions(), Budget(4.0), silent)
    assert warm.ahead is not None
    assert warm.ahead.duration == pytest.approx(0.69 * earlier.duration, rel=1e-6)
    across = moved(problem, z=0.5).with_start(state)
    assert WarmStart(across, earlier, TrajOptOptions(), Budget(4.0), silent).ahead is None


def test_a_motion_at_its_bound_that_is_still_free_is_the_answer_as_it_stands():
    problem = op.load_problem("01_reach")
    ball = op.Sphere("ball", 0.05, position=(-0.6, 0.0, 0.4))
    beside = derived(problem, scene=op.Scene((ball,)))
    earlier = plan(beside).trajectory
    assert earlier.duration < 1.01 * lower_bound(beside.start, earlier.end, beside.limits)
    found = plan(moved(beside, z=0.05), earlier)
    assert found.verified
    assert [(each["seed"], each["iterations"]) for each in found.info["attempts"]] == [("warm", 0)]
    assert found.duration == earlier.duration
    tool = frame_pose(beside.robot, earlier(0.5 * earlier.duration), beside.robot.tool_frame)
    found = plan(derived(beside, scene=op.Scene((replace(ball, X_WO=tool),))), earlier)
    assert found.verified
    assert found.info["attempts"][0]["iterations"] > 0


def test_a_search_follows_where_the_earlier_motion_leads_to_nothing(first):
    """The arm was to go left; now it goes right, and the earlier motion is of no use."""
    problem, earlier = first
    other = cases.LEFT * np.array([-1.0, 1, 1, 1, 1, 1, 1])
    found = plan(derived(problem, goal=(op.JointGoal(other),)), earlier)
    assert found.verified
    plain = plan(derived(problem, goal=(op.JointGoal(other),)))
    assert found.duration < 1.05 * plain.duration


def test_a_motion_of_other_joints_is_no_help(first):
    planar = op.plan(op.load_problem("12_planar"), budget=1.0)
    found = op.plan(op.load_problem("01_reach"), budget=2.0, warm_start=planar)
    assert found.verified
    assert found.info["warm_start"] == "refused"


def test_the_same_twice(first):
    problem, earlier = first
    changed = moved(problem, z=0.04)
    one, two = (TrajOpt().replan(changed, earlier, Budget(20.0), silent).trajectory for _ in range(2))
    assert (one.coefficients == two.coefficients).all()


def test_replanner():
    replanner = op.Replanner(op.load_problem("12_planar"), options={"seeds": 2})
    first = replanner.plan(budget=3.0)
    again = replanner.plan(scene=replanner.problem.scene.moved("peg", x=0.02), start=first.trajectory.start, budget=3.0)
    assert again.verified
    assert again.info["attempts"][0]["seed"] == "warm"
    on = replanner.plan(start=again.trajectory.state(0.2), budget=3.0)
    assert on.verified
    assert replanner.run is on
    assert replanner.problem.nonzero_ends
    for wrong in ({"start": [9.0, 9.0]}, {"goal": 3}, {"scene": "peg"}, {"budget": -1.0}):
        with pytest.raises(op.InputError) as refused:
            replanner.plan(**wrong)
        assert str(refused.value).startswith(f"op.Replanner.plan: {next(iter(wrong))}"), refused.value
    with pytest.raises(op.InputError, match="Replanner"):
        op.Replanner("12_planar")


def test_what_a_search_found_is_kept_behind_a_better_motion(first):
    """The verifier may refuse the best one."""
    problem, earlier = first
    warm = WarmStart(problem, earlier, TrajOptOptions(), Budget(4.0), silent)
    slower, slowest = (warm.best.scaled(factor * warm.best.duration) for factor in (1.1, 1.2))
    result = warm.with_search(PlanResult(slower, None, earlier=(Candidate(slowest, 0.1),), seconds=0.2))
    assert result.trajectory is warm.best
    assert [one.trajectory for one in result.earlier] == [slowest, slower]
    assert [one.seconds for one in result.earlier] == pytest.approx([warm.seconds + 0.1, warm.seconds + 0.2])
