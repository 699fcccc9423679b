"""The search of the main planner: never worse than what is at hand, margins as a wish, time spent where it pays."""

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.sampling.sample_path import SampledPath
from optiplan.planners.sampling.shortcutting import path_time
from optiplan.planners.trajopt import attempts, path_search, planner, stopping_rule
from optiplan.planners.trajopt.coarse_descents import GuessPath
from optiplan.planners.trajopt.optimizer import AttemptOptions, Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.problem.load import load_problem
from optiplan.problem.problem import JointGoal, Objective, PoseGoal, Problem, derived
from optiplan.robot.robot import load_robot
from optiplan.runs.pipeline import run
from optiplan.runs.run import Run
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.verify.verify import verify
from tests.planned import planned_until
from tests.planners import cases
from tests.robot.robots import BARE, LINK, joint, write_robot
from tests.unchecked_problem import unchecked_problem

pytestmark = pytest.mark.usefixtures("processor_clock")


def solve(problem: Problem, name: str = "trajopt", budget: float = 5.0, **options: float) -> Run:
    return run(problem, name, options, Budget(budget), lambda stage, fraction: None)


def near_a_board(gap: float) -> Problem:
    """The wall of the other tests, with a board so far below the hand at the start, m."""

    def made(height: float) -> Problem:
        board = cases.box("board", (0.3, 0.3, 0.02), (0.31, 0.0, height))
        walled = cases.wall()
        return cases.problem("panda", cases.READY, [JointGoal(cases.LEFT)], *walled.scene.obstacles, board)

    low = made(-0.2)
    model = CollisionModel(low.robot, low.scene)
    pairs = [k for k, pair in enumerate(model.pairs) if "board" in (pair.name_a, pair.name_b)]
    return made(-0.2 + min(model.distance(low.start, k).distance for k in pairs) - gap)


def test_a_search_that_the_clock_ends_for_the_smaller_margin_says_so(
    problems: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = load_problem(problems / "02_shelf.yaml")
    assert not solve(problem).info["cut_short"]
    monkeypatch.setattr(attempts, "_FAR", 0.0)  # so that the first curve waits
    monkeypatch.setattr(attempts, "_CLOSE_STEPS", 1e9)  # all that is left of the budget
    cut = solve(problem)
    assert cut.info["cut_short"]
    assert [attempt["seed"] for attempt in cut.info["attempts"]][:3] == ["straight", "end", "close"]


@pytest.mark.parametrize("name", ["02_shelf", "04_box"])
def test_a_robot_without_torque_limits_is_planned_around_things(problems: Path, name: str) -> None:
    """Steps are refused on the way; whether they exceeded a torque was asked of what had never been computed."""
    shelf = load_problem(problems / f"{name}.yaml")
    result = solve(derived(shelf, limits=replace(shelf.limits, torque=np.full(shelf.robot.n, np.inf))), budget=1.0)
    assert result.verified
    assert result.info["attempts"]


@pytest.mark.parametrize("gap", [0.002, 0.0005])
def test_a_start_near_a_body_does_not_cost_time(gap: float) -> None:
    problem = near_a_board(gap)
    wished, small = solve(problem), solve(problem, margin=0.001)
    assert wished.verified
    assert small.verified
    assert wished.duration <= 1.03 * small.duration


def test_both_arms_of_baxter_from_near_contact(problems: Path) -> None:
    """1.51 s with the margin as a command, 0.93 s as a wish."""
    problem = load_problem(problems / "18_baxter_dual.yaml")
    result = planned_until(problem, seconds=20.0, wanted=lambda motion: motion.duration <= 0.95)
    assert result.verified
    assert result.duration <= 0.95


@pytest.mark.parametrize("name", ["01_reach", "02_shelf", "07_any_of", "12_planar", "16_delbot"])
def test_never_worse_than_a_sampled_path(problems: Path, name: str) -> None:
    problem = load_problem(problems / f"{name}.yaml")
    assert_as_quick_as(problem, [1.005 * sampled(problem)])


def sampled(problem: Problem) -> float:
    """Duration of the motion along a sampled path, s."""
    found = solve(problem, "rrtconnect")
    assert found.verified
    return found.duration


def assert_as_quick_as(problem: Problem, durations: list[float]) -> None:
    """Plan until the motion is as quick as all of these, 5 s at the most."""
    ours = planned_until(problem, seconds=5.0, wanted=lambda motion: motion.duration <= min(durations))
    assert ours.verified
    assert ours.duration <= min(durations)


@pytest.mark.parametrize("make", [cases.free, cases.any_of, cases.wall, cases.swing, cases.one_box, cases.tight])
def test_never_worse_than_what_is_at_hand(make) -> None:  # type: ignore[no-untyped-def]
    problem = make()
    durations = [1.005 * sampled(problem)]
    for goal in problem.goal:
        line = stop_at_corners(np.array([problem.start, goal.q]), problem.limits, problem.robot.joint_names)
        model = CollisionModel(problem.robot, problem.scene)
        free = not any(model.collides(q) for q in line(np.linspace(0.0, line.duration, 400)))
        durations += [line.duration * (1.0 + 1e-9)] if free else []
    assert_as_quick_as(problem, durations)


def test_candidates_become_better_and_are_kept_with_their_time() -> None:
    result = TrajOpt().plan(cases.wall(), Budget(20.0), lambda stage, fraction: None)
    assert result.trajectory is not None
    durations = [*(candidate.trajectory.duration for candidate in result.earlier), result.trajectory.duration]
    assert all(a > b for a, b in pairwise(durations))
    assert result.seconds is not None
    seconds = [*(candidate.seconds for candidate in result.earlier), result.seconds]
    assert all(a < b for a, b in pairwise(seconds))


def test_improvements_of_a_run_end_with_its_answer() -> None:
    kept = solve(cases.wall()).to_dict()
    when, durations = zip(*kept["improvements"], strict=True)
    assert all(a < b for a, b in pairwise(when))
    assert all(a > b for a, b in pairwise(durations))
    assert durations[-1] == kept["duration"]


def test_the_best_of_another_objective_is_that_of_least_cost() -> None:
    """With weight on the jerk the straight line timed exactly is the fastest of all and far from the best."""
    problem = derived(cases.free(), objective=Objective(1.0, 1e-5))
    result = TrajOpt().plan(problem, Budget(20.0), lambda stage, fraction: None)
    assert result.trajectory is not None
    offers = [*(candidate.trajectory for candidate in result.earlier), result.trajectory]
    costs = [offer.duration + 1e-5 * offer.squared_jerk() for offer in offers]
    assert all(a > b for a, b in pairwise(costs))
    assert costs[-1] < 0.8 * costs[0]
    assert result.trajectory.duration > offers[0].duration


def test_a_larger_budget_is_not_worse() -> None:
    """The same attempts in the same order, and some more of them."""
    durations, attempts = [], []
    for budget in (0.5, 1.0, 4.0):
        result = TrajOpt().plan(cases.wall(), Budget(budget), lambda stage, fraction: None)
        assert result.trajectory is not None
        durations.append(result.trajectory.duration)
        attempts.append(len(result.info["attempts"]))
    assert attempts == sorted(attempts)
    assert durations[1] <= durations[0] * (1.0 + 1e-6)
    assert durations[2] <= durations[1] * (1.0 + 1e-6)


@pytest.mark.parametrize("make", [cases.wall, cases.one_box, cases.barred])
def test_planning_and_proof_end_with_the_budget(monkeypatch: pytest.MonkeyPatch, make) -> None:  # type: ignore[no-untyped-def]
    """A search that never has enough: 2 % or 50 ms over at most, and as much again for what is not polled."""
    monkeypatch.setattr(stopping_rule, "PRICE", 0.0)
    problem, budget = make(), 0.5
    solve(problem, budget=0.1)  # what is built once for the robot
    for _ in range(5):  # what is not polled may take longer beside other work, but not every time
        began = time.process_time()
        result = solve(problem, budget=budget, good_enough=1.0)
        spent = time.process_time() - began - result.timings.get("measure", 0.0)
        assert make is cases.barred or result.verified
        if spent <= 1.02 * budget + 0.1:
            break
    assert spent <= 1.02 * budget + 0.1


def test_position_tolerance_of_a_pose_is_used() -> None:
    pose = cases.pose()
    goal = pose.goal[0]
    assert isinstance(goal, PoseGoal)
    loose = derived(pose, goal=(replace(goal, position=0.2),))
    exact, near = solve(pose), solve(loose)
    assert near.verified
    assert near.duration <= 0.95 * exact.duration


def test_many_joints_whose_straight_line_is_free_are_planned_at_once(tmp_path: Path) -> None:
    names = [f"j{k}" for k in range(40)]
    links = [LINK.format("base"), *((LINK if k == 39 else BARE).format(f"l{k}") for k in range(40))]
    parents = ["base", *(f"l{k}" for k in range(39))]
    joints = [joint(name, parent, f"l{k}", x=0.1) for k, (name, parent) in enumerate(zip(names, parents, strict=True))]
    extra = f"group: [{', '.join(names)}]\ntool_frame: l39\n"
    robot = load_robot(str(write_robot(tmp_path, [*links, *joints], extra)))
    goal = JointGoal(np.full(40, 0.02))
    problem = unchecked_problem(
        name="many", robot=robot, scene=cases.free().scene, start=np.zeros(40), goal=(goal,), limits=robot.limits
    )
    result = solve(problem, budget=5.0)
    assert result.verified
    assert result.ratio < 1.02
    assert "fallback" not in result.info


def test_a_straight_line_that_leads_to_nothing_is_given_up_and_says_what_it_took() -> None:
    """The arm cannot pass the bar: the curve stays in it, and does not take all the steps that it may."""
    attempts = TrajOpt().plan(cases.barred(), Budget(1.0), lambda stage, fraction: None).info["attempts"]
    assert attempts[0]["seed"] == "straight"
    assert not attempts[0]["free"]
    assert 0 < attempts[0]["iterations"] < TrajOptOptions().iterations // 2


def test_lines_wait_for_a_search_that_fails_once_one_has_led_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing comes of any curve: with a path there is no second line; without one there is, with all its time."""
    seen: list[bool] = []
    monkeypatch.setattr(Optimiser, "run", lambda self, control, budget, options: seen.append(options.patient))
    problem, quiet = cases.wall(), lambda stage, fraction: None
    seeds = [
        entry["seed"] for entry in TrajOpt(TrajOptOptions(seeds=2)).plan(problem, Budget(5.0), quiet).info["attempts"]
    ]
    assert seeds[0] == "straight"
    assert set(seeds[1:]) == {"sampled"}
    assert not any(seen)
    failure = Failure("no-path", "none")
    monkeypatch.setattr(path_search, "sample_path", lambda *given: failure)
    result = TrajOpt(TrajOptOptions(seeds=2)).plan(problem, Budget(5.0), quiet)
    assert [entry["seed"] for entry in result.info["attempts"]] == ["straight", "line", "line"]
    assert seen[-3:] == [False, True, True]
    assert result.failure is failure


def test_the_first_free_curve_is_a_candidate_before_it_is_short() -> None:
    """The line leads through the wall: the first curve around it comes some steps before the fastest one."""
    problem = cases.wall()
    result = TrajOpt(TrajOptOptions(seeds=1)).plan(problem, Budget(5.0), lambda stage, fraction: None)
    first, *_, last = [*(one.trajectory for one in result.earlier), result.trajectory]
    assert last.duration < first.duration
    assert verify(problem, first).verified
    found: list[float] = []
    run = planner._Run(problem, Budget(5.0), lambda stage, fraction: None, TrajOptOptions())
    line = run.optimiser.along(np.array([problem.start, problem.goal[0].q]))
    attempt = run.optimiser.run(
        line, Budget(5.0), AttemptOptions(first=lambda one: found.append(one.trajectory.duration))
    )
    assert attempt.free
    assert len(found) == 1
    assert found[0] >= attempt.trajectory.duration


@pytest.mark.parametrize(("shorter", "kinds"), [(1.0, []), (0.9, ["sampled"])])
def test_a_path_on_an_optimised_curve_is_optimised_again_only_where_shortcuts_helped(
    shorter: float, kinds: list[str]
) -> None:
    problem = cases.free()
    run = planner._Run(problem, Budget(5.0), lambda stage, fraction: None, TrajOptOptions())
    ends = np.array([problem.start, problem.goal[0].q])
    attempt = run.optimiser.run(run.optimiser.along(ends), Budget(5.0))
    cost = float(path_time(ends, problem.limits.velocity).sum())
    run.repaired = attempt, cost
    run._sampled(GuessPath(SampledPath(ends, 0, shorter * cost, {})))
    seeds = [entry["seed"] for entry in run.info["attempts"] if entry["seed"] != "close"]
    assert seeds == kinds
    assert run.incumbent.candidates
    assert run.repaired is None


def test_a_path_that_takes_far_longer_than_the_best_motion_is_left() -> None:
    problem = cases.free()
    run = planner._Run(problem, Budget(5.0), lambda stage, fraction: None, TrajOptOptions())
    ends = np.array([problem.start, problem.goal[0].q])
    run.attempts.attempt("straight", run.optimiser.along(ends), run.budget)
    run._sampled(GuessPath(SampledPath(ends, 0, 2.0 * run.incumbent.cost, {})))
    assert {attempt["seed"] for attempt in run.info["attempts"]} <= {"straight", "close"}
    assert run.patience.in_vain == 1


def test_the_first_curve_waits_for_another_attempt_before_it_is_refined() -> None:
    """The bound lies far below it. Curves after it are compared with it as it was."""
    problem = cases.wall()
    run = planner._Run(problem, Budget(20.0), lambda stage, fraction: None, TrajOptOptions())
    ends = np.array([problem.start, problem.goal[0].q])
    first = run.attempts.optimised("straight", run.optimiser.along(ends), run.budget)
    assert first is not None
    run.incumbent.bounded(0.5 * first.trajectory.duration)
    run.attempts.keep(first)
    assert run.attempts.waiting is first
    assert run.attempts.refined is None
    run.attempts.keep(None)
    refined = run.attempts.refined
    assert run.attempts.waiting is None
    assert refined is not None
    assert run.info["attempts"][-1]["seed"] == "close"
    assert len(refined.control) > len(first.control)
    assert run.incumbent.curve is first
    assert run.incumbent.cost == refined.trajectory.duration < 0.998 * run.incumbent.rough
    assert verify(problem, refined.trajectory).verified


def test_a_better_curve_than_another_one_is_refined_at_once() -> None:
    problem = cases.wall()
    run = planner._Run(problem, Budget(20.0), lambda stage, fraction: None, TrajOptOptions())
    ends = np.array([problem.start, problem.goal[0].q])
    first = run.optimiser.run(run.optimiser.along(ends), run.budget)
    assert first is not None
    run.incumbent.bounded(0.5 * first.trajectory.duration)
    slower = replace(first, trajectory=first.trajectory.scaled(1.5 * first.trajectory.duration))
    run.attempts.keep(slower)
    assert run.attempts.waiting is slower
    run.attempts.keep(first)
    assert run.attempts.waiting is None
    assert run.attempts.refined is not None


def test_a_line_through_a_wall_waits_for_a_path_whose_stops_are_the_first_motion() -> None:
    """The line is free only after some steps: a path is there before it, and is proved."""
    problem = cases.wall()
    result = TrajOpt(TrajOptOptions(seeds=1)).plan(problem, Budget(5.0), lambda stage, fraction: None)
    first = result.earlier[0].trajectory
    assert result.trajectory is not None
    assert result.info["attempts"][0] == {**result.info["attempts"][0], "seed": "straight", "free": True}
    assert first.duration > result.trajectory.duration
    middle = first(np.linspace(0.0, first.duration, 2000)[1:-1], 1)
    assert (np.abs(middle).max(axis=1) < 1e-3).any(), "it stops at a corner"
    assert verify(problem, first).verified
