"""A tour is planned and proved as part of a task; every way of cheating is refused; what cannot be done is named."""

import json
import threading
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, Failure
from optiplan.planners.registry import make_planner
from optiplan.planners.tours import search
from optiplan.planners.tours.legs import TourLegs
from optiplan.problem.problem import derived
from optiplan.robot.frames import frame_pose
from optiplan.runs.pipeline import chosen
from optiplan.runs.pipeline import run as plan_with
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.verify.verify import verify
from tests.checks import named
from tests.planned import planned_until
from tests.planners import cases

PLACES = [(0.45, y, z) for y in (-0.3, -0.1, 0.1, 0.3) for z in (0.25, 0.45)]
WALL = op.Box("wall", size=(0.2, 0.02, 0.3), position=(0.55, 0.0, 0.1))


class Told:
    """Progress that keeps the motions found on the way."""

    def __init__(self):
        self.found_motions = []

    def __call__(self, stage, fraction):
        pass

    def found(self, motion, bound):
        self.found_motions.append(motion)


@pytest.fixture(scope="module")
def problem():
    targets = [{"name": f"hole {k}", "position": place, "axis": [1, 0, 0]} for k, place in enumerate(PLACES)]
    targets[0] |= {"after": "hole 7"}
    targets[2] |= {"window": [12.0, 60.0]}
    tour = {"standoff": 0.02, "closed": True, "at_each": [{"dwell": 0.1, "do": "drill"}, {"dwell": 0.2}]}
    task = op.Task().tour(targets, **tour).move("up")
    return op.Problem("ur5", "ready", task=task, scene=[WALL])


@pytest.fixture(scope="module")
def run(problem):
    found = planned_until(problem)
    assert found.verified, (found.failure, found.report)
    return found


def check(problem, motion, name):
    return named(verify(problem, motion), name)


def test_every_target_is_visited_and_rested_at(problem, run):
    led = [one for one in run.trajectory.segments if one.kind == "tour"]
    tour = problem.task[0].action
    assert sorted(one.name for one in led[:-1]) == [target.name for target in tour.targets]
    assert led[-1].name == "back"
    assert np.abs(run.trajectory(led[-1].end) - problem.start).max() < 1e-6
    for one in led[:-1]:
        goal = next(target.goal for target in tour.targets if target.name == one.name)
        assert goal.contains(frame_pose(problem.robot, run.trajectory(one.end), goal.frame))
        assert np.abs(run.trajectory(one.end, 1)).max() < 1e-9
    order = [one.name for one in led]
    assert order.index("hole 7") < order.index("hole 0")
    assert next(one.end for one in led if one.name == "hole 2") >= 12.0 - 1e-9
    kinds = [one.kind for one in run.trajectory.segments]
    assert kinds == ["tour", "process", "dwell"] * 8 + ["tour", "move"]


def test_the_run_says_so(run, tmp_path):
    run.save(tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    events = [one for one in record["events"] if one["kind"] == "process"]
    assert [one["name"] for one in events] == ["drill"] * 8
    assert record["verified"]
    again = op.load_run(tmp_path)
    assert op.verify(again.problem, again.trajectory).verified
    names = {one.name: one.detail for one in run.report.checks}
    assert "8 targets" in names["tour"]
    assert run.lower_bound_of == "stops"
    total = 8 * 0.3 + sum(
        lower_bound(run.trajectory(one.begin), run.trajectory(one.end), run.problem.limits)
        for one in run.trajectory.segments
        if one.kind in ("tour", "move")
    )
    assert run.lower_bound == pytest.approx(total, rel=1e-6)


def test_other_orders_and_names_are_refused(problem, run):
    motion = run.trajectory
    segments = list(motion.segments)
    segments[0], segments[3] = (
        replace(a, name=b.name) for a, b in ((segments[0], segments[3]), (segments[3], segments[0]))
    )
    assert not check(problem, replace(motion, segments=tuple(segments)), "goal").passed
    without = replace(motion, segments=motion.segments[3:])
    assert "not every target" in check(problem, without, "tour").detail
    sooner = motion.scaled(0.5 * motion.duration)
    assert not verify(problem, sooner).verified
    stated = [replace(one, window=(0.0, 0.5)) for one in problem.task[0].action.targets]
    tight = replace(problem.task[0], action=replace(problem.task[0].action, targets=tuple(stated)))
    assert "outside [0, 0.5] s" in check(derived(problem, task=(tight, problem.task[1])), motion, "tour").detail


def test_an_order_that_nothing_checks_is_not_verified(problem, run, monkeypatch):
    monkeypatch.setattr("optiplan.verify.tasks.whole_task.tour_checks", lambda *_: [])
    report = verify(problem, run.trajectory)
    assert [one.name for one in report.failures] == ["statements"]
    assert "tour of step 1" in report.failures[0].detail


def test_a_motion_that_does_not_rest_is_refused(problem, run):
    """The end of a leg is said to be a little earlier, within the tolerance of the target."""
    motion, (first, second) = run.trajectory, run.trajectory.segments[:2]
    by = 2e-3
    earlier = (replace(first, end=first.end - by), replace(second, begin=second.begin - by), *motion.segments[2:])
    found = check(problem, replace(motion, segments=earlier), "standstill")
    assert not found.passed
    assert first.name in found.detail or "drill" in found.detail


def test_better_tours_are_told_on_the_way(problem):
    progress = Told()
    targets = [{"position": place, "axis": [1, 0, 0]} for place in PLACES]
    own = op.Problem("ur5", "ready", task=op.Tour(targets), scene=[WALL])
    found = plan_with(own, "trajopt", {}, Budget(1.5), progress)
    assert found.verified
    durations = [motion.duration for motion in progress.found_motions]
    assert durations == sorted(durations, reverse=True)
    assert found.duration == min(durations)
    led = [(one.begin, one.end) for one in found.trajectory.segments]
    assert all(a[1] == pytest.approx(b[0], abs=1e-9) for a, b in pairwise(led))


def test_all_targets_out_of_reach_are_named(problem):
    far = [{"name": "far", "position": (2, 0, 0.3)}, {"name": "low", "position": (0.4, 0.1, -3)}]
    buried = {"name": "buried", "position": (0.5, 0.0, 0.15), "axis": [1, 0, 0]}
    task = op.Tour([*far, buried, {"position": PLACES[0], "axis": [1, 0, 0]}])
    found = op.plan(op.Problem("ur5", "ready", task=task, scene=[WALL]))
    assert found.failure.kind == "goal-unreachable"
    assert found.failure.detail.startswith("step 1 (tour): 3 of 4 targets cannot be reached: 'far'")
    assert "nearest at [" in found.failure.detail
    assert [one["target"] for one in found.failure.witness["targets"]] == ["far", "low", "buried"]


def test_an_interrupted_search_keeps_its_best(problem, monkeypatch):
    cancel = threading.Event()

    class Cancelling(Told):
        def found(self, motion, bound):
            super().found(motion, bound)
            cancel.set()

    progress = Cancelling()
    targets = [{"position": place, "axis": [1, 0, 0]} for place in PLACES]
    own = op.Problem("ur5", "ready", task=op.Tour(targets), scene=[WALL])
    monkeypatch.setattr(search, "work_of", lambda layers: np.inf)  # so that OR-Tools is asked
    found = plan_with(own, "trajopt", {}, Budget(30.0, cancel), progress)
    assert found.verified
    assert len(progress.found_motions) == 1


def test_a_tour_whose_share_is_over_has_the_whole_time_for_a_first_one(problem):
    """It ended with *the budget of … ended*, however much time the task had left."""
    tour, model = problem.task[0].action, planning_model(problem.robot, problem.scene)
    planner, told = make_planner("trajopt", {}), []
    own = derived(problem, task=())
    found = search.TourSearch(own, tour, model, planner, Budget(0.0), Told(), told.append, Budget(60.0)).run()
    assert isinstance(found, search.FoundTour), found
    assert len(told) == 1


def test_the_end_of_the_time_does_not_hide_what_took_it(monkeypatch):
    targets = [{"name": f"hole {k}", "position": place, "axis": [1, 0, 0]} for k, place in enumerate(PLACES[:2])]
    problem = op.Problem("ur5", "ready", task=op.Task().tour(targets))
    tour, model = problem.task[0].action, planning_model(problem.robot, problem.scene)
    legs = iter([Failure("collision", "the arm touches 'wall'")])
    late = Failure("budget", "the budget of 60 s ended")
    monkeypatch.setattr(TourLegs, "motion", lambda *_: next(legs, late))
    own, planner, told = derived(problem, task=()), make_planner("trajopt", {}), Told()
    found = search.TourSearch(own, tour, model, planner, Budget(60.0), told, told, Budget(60.0)).run()
    assert found.kind == "budget"
    assert "the budget of 60 s ended; before that: from the start to 'hole " in found.detail
    assert found.detail.endswith("': the arm touches 'wall'")


def test_a_leg_without_time_left_is_told_as_that(problem):
    """A planner without time says that there is nothing within 0 s, or what its best attempt touches: no reason."""
    arm = derived(problem, task=())
    planner, _ = chosen(arm, None, {})
    legs = TourLegs(arm, SimpleNamespace(free=lambda a, b: False), planner, lambda stage, fraction: None)
    failure = legs.motion((0, 1), arm.start, arm.start + 0.5, Budget(0.0))
    assert failure.kind == "budget"
    assert failure.detail.startswith("the budget of 0 s ended while planning this motion")


def test_a_target_that_is_reached_after_its_window_is_named(monkeypatch):
    """Its leg takes three times as long as it counted; there is time left."""
    target = {"name": "hole", "position": PLACES[0], "axis": [1, 0, 0], "window": [0.0, 2.0]}
    straight = TourLegs._straight_motion
    monkeypatch.setattr(TourLegs, "_straight_motion", lambda *args: straight(*args).scaled(6.0))
    found = plan_with(op.Problem("ur5", "ready", task=op.Tour([target])), "trajopt", {}, Budget(60.0), Told())
    assert found.failure.kind == "no-path"
    assert "'hole' is reached at 6 s of the tour, after its window, which ends at 2 s" in found.failure.detail


def test_a_leg_of_an_endless_joint_ends_at_the_stated_turn():
    """The next one begins there, not at the image that is nearer."""
    arm = derived(cases.endless(), start=np.zeros(2))
    planner = make_planner("quintic", {})
    legs = TourLegs(arm, SimpleNamespace(free=lambda a, b: False), planner, lambda stage, fraction: None)
    end = np.array([4.0, 0.5])
    assert legs.motion((0, 1), arm.start, end, Budget(10.0)).end == pytest.approx(end)
