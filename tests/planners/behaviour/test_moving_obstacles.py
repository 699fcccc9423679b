"""Planning among obstacles that move: any planner waits or goes slower, `trajopt` goes round in time."""

import threading
from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, Failure, PlanResult
from optiplan.planners.common.dynamic_obstacles import wait_for_obstacles
from optiplan.planners.registry import make_planner
from optiplan.planners.trajopt import optimise_in_time
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import CUTOFF, Margins
from optiplan.problem.problem import derived
from optiplan.robot.frames import frame_pose
from optiplan.runs.pipeline import run
from tests.planners import cases
from tests.verify.behaviour.test_moving_obstacles import MIDDLE, MOTION, REACH, T, ball, through

HIT = REACH.with_scene([ball([0, 0, 0.5], through(0.5), until=3.0)])


def plan(problem, name, budget=6.0):
    return run(problem, name, cases.OPTIONS.get(name, {}), Budget(budget), lambda stage, fraction: None)


@pytest.mark.parametrize("name", ["scurve", "quintic", "rrtconnect", "prm"])
def test_any_planner_waits_or_goes_slower(name):
    found = plan(HIT, name)
    assert found.verified, found.failure
    assert {"waited", "slower"} <= found.info.keys()
    assert found.duration < T + 1.0


def test_trajopt_goes_round_in_time():
    found = plan(HIT, "trajopt")
    assert found.verified
    assert found.duration < 1.1 * T
    assert any(attempt["seed"] == "in time" for attempt in found.info["attempts"])


def test_a_way_that_takes_longer_than_its_share_has_the_rest_too():
    """Trajopt gave up after three tenths of the budget, also where a minute was left."""
    planner, budget, parts = make_planner("trajopt"), Budget(9.0), []

    class Slow:
        options = planner.options

        def plan(self, problem, part, progress):
            parts.append(part.seconds)
            if len(parts) > 1:
                return replace(planner.plan(problem, part, progress), info={"cut_short": True})
            part.leave(budget.seconds)  # its time is over
            return PlanResult(None, Failure("no-path", "not yet"))

    found = optimise_in_time.optimise_in_time(Slow(), HIT, budget, lambda stage, fraction: None)
    assert found.trajectory is not None
    assert found.info["cut_short"]
    assert len(parts) == 2
    assert parts[1] > 1.5 * parts[0]


def test_the_wait_may_be_longer_than_that_for_what_never_stands_still():
    """A ball leaves, ever faster: after 10 s it is 0.3 m above the way, which the hand still meets."""
    leaves = op.Sphere("ball", 0.05, position=tuple(MIDDLE)).moving([[0], [0], [0, 0, 0, 3e-4]], until=15.0)
    found = plan(REACH.with_scene([leaves]), "scurve")
    assert found.verified, found.failure
    assert 10.0 < found.info["waited"] < 15.0


def test_a_robot_that_moves_cannot_wait():
    problem = HIT.with_start(MOTION.state(0.2 * T)).with_scene(HIT.scene.later(0.2 * T))
    found = plan(problem, "trajopt")
    assert found.verified, found.failure
    refused = plan(problem, "scurve")
    assert refused.verified or refused.failure.kind == "collision"


def test_what_never_leaves_is_said_to_be_in_the_way():
    """It comes to stand on the goal."""
    goal = frame_pose(REACH.robot, MOTION.end, REACH.robot.tool_frame).translation
    falls = op.Sphere("ball", 0.05, position=tuple(goal + np.array([0.0, 0.0, 0.5]))).moving(
        [[0], [0], [0, -2.0]], until=0.25
    )
    found = plan(REACH.with_scene([falls]), "scurve")
    assert found.failure.kind == "collision"
    assert "waiting" in found.failure.detail


def test_a_cancelled_search_for_waiting_times_is_no_end_of_the_budget():
    cancelled, over = threading.Event(), Budget(0.0)
    cancelled.set()
    for budget, kind in ((Budget(6.0, cancelled), "cancelled"), (over, "budget")):
        found = wait_for_obstacles(PlanResult(MOTION, None), HIT, budget)
        assert found.failure.kind == kind


@pytest.mark.parametrize("name", ["trajopt", "quintic", "rrtconnect"])
@pytest.mark.parametrize("with_vias", [False, True])
def test_through_vias(with_vias, name):
    middle = 0.5 * (REACH.start + REACH.goal[0].q) + 0.1
    problem = HIT.with_vias(op.ViaPoint(middle, tolerance=0.01)) if with_vias else HIT
    assert plan(problem, name).verified


def test_a_motion_with_times_of_vias_does_not_wait():
    middle = 0.5 * (REACH.start + REACH.goal[0].q)
    failure = plan(HIT.with_vias(op.ViaPoint(middle, tolerance=0.01, time=1.0)), "quintic").failure
    assert failure.kind == "unsupported"
    assert "times of vias" in failure.detail


def test_a_motion_that_waits_has_to_hold_the_path_constraints(monkeypatch):
    """In its second half it is near the goal; waiting at the start it is not."""
    monkeypatch.setattr(optimise_in_time, "_curves", lambda *given: [])
    wall = op.Box("wall", size=(1.2, 0.04, 1.2), position=tuple(MIDDLE)).moving([[0], [0], [0, 0, 0.2]], until=3.0)
    there = {"box": {"size": [4.0, 2.0, 4.0], "pose": {"position": [0.0, 1.36, 0.5]}}, "during": [0.6, 1.0]}
    problem = REACH.with_scene([wall]).with_constraints({"position": there})
    found = make_planner("trajopt").plan(problem, Budget(3.0), lambda stage, fraction: None)
    assert found.trajectory is None
    assert found.failure.kind == "constraint"


@pytest.mark.parametrize("name", ["trajopt", "sclerp"])
def test_a_slower_motion_is_the_answer_where_one_that_waits_breaks_a_constraint(name, monkeypatch):
    """From a share of the duration on it is past the start: a wait takes that share, going slower does not."""
    monkeypatch.setattr(optimise_in_time, "_curves", lambda *given: [])
    wall = op.Box("wall", size=(1.2, 0.04, 1.2), position=tuple(MIDDLE)).moving([[0], [0], [0, 0, 1.0]], until=3.0)
    past = {"box": {"size": [4.0, 4.0, 4.0], "pose": {"position": [0.0, 2.15, 0.5]}}, "during": [0.4, 1.0]}
    found = plan(REACH.with_scene([wall]).with_constraints({"position": past}), name)
    assert found.verified, found.failure
    assert found.info["slower"] > 1.0


def test_margins_are_of_the_places_at_which_obstacles_are_then():
    """One stands beside the goal at first and leaves, another comes there."""
    goal = frame_pose(REACH.robot, MOTION.end, REACH.robot.tool_frame).translation
    at = {"position": tuple(goal - np.array([0.0, 0.0, 0.07]))}
    leaves = op.Sphere("leaves", 0.05, **at).moving([[0], [0], [0, 0, -1.0]], until=T)
    comes = op.Sphere("comes", 0.05, **at).moving([[0], [0], [-(T**2), 0, 1.0]], until=T)
    ends = np.array([MOTION.start, MOTION.end])
    for body, near_then in ((leaves, False), (comes, True)):
        model = planning_model(REACH.robot, op.Scene([body]))
        own = [pair.index for pair in model.pairs if body.name in (pair.name_a, pair.name_b)]
        end = Margins.between(model, ends, 0.005, T).end[own]
        assert (end.min() < CUTOFF) == near_then


def test_rows_in_time_against_differences():
    """Values of the rows by the duration and by the control points."""
    problem = derived(REACH, scene=op.Scene([ball([0.0, 0.03, 0.5], [[0], [0, 0.1], [0, -1.0, -0.3]])]))
    model = planning_model(problem.robot, problem.scene)
    basis = SplineBasis(bunched_breakpoints(22, 0.6))
    control = along_path(basis, np.array([MOTION.start, MOTION.end]), problem.limits.velocity)
    margins = Margins.between(model, control[[0, -1]], 0.005)
    made = Transcription(problem, model, basis, margins)
    assert not made.plain
    made.set_samples(np.linspace(0.05, 0.95, 60))

    def rows(control, duration):
        return made.contacts.rows(made.curve(control, duration))

    now = rows(control, T)
    apart = now.value > 0.0  # of bodies that overlap the normals are averages over samples
    timed = apart & (np.abs(now.by_duration) > 1e-3)
    assert timed.sum() > 3, "the ball is near somewhere"
    step = 1e-6
    later, sooner = rows(control, T + step), rows(control, T - step)
    assert len(later.value) == len(now.value) == len(sooner.value)
    assert (later.value - sooner.value)[timed] / (2 * step) == pytest.approx(now.by_duration[timed], rel=1e-3, abs=1e-4)
    rng = np.random.default_rng(0)
    by = np.zeros_like(control)
    by[basis.free] = rng.normal(size=by[basis.free].shape)
    after, before = rows(control + step * by, T), rows(control - step * by, T)
    wanted = now.by_control @ by[basis.free].ravel()
    assert ((after.value - before.value) / (2 * step))[apart] == pytest.approx(wanted[apart], rel=1e-3, abs=1e-3)


def test_obstacles_that_stand_change_nothing():
    """A scene whose obstacles do not move is planned as before, in the native core."""
    model = planning_model(REACH.robot, op.Scene([op.Sphere("ball", 0.05, position=tuple(MIDDLE))]))
    assert model.motions == ()
    assert model.model is REACH.robot.model
