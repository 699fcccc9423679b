"""Steps of several arms in time."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.planners.task.beside import one_after_another
from optiplan.planners.task.chains import do_chain
from optiplan.planners.task.stages import Stages, WorldState
from optiplan.planners.task.via_moves import ViaMoves
from optiplan.problem.load import load_problem
from optiplan.problem.task.timeline import scene_parts
from optiplan.runs.common_bound import duration_bound

ARMS = {"a": "planar2r", "b": {"use": "planar2r", "base": op.Pose((0, 2.0, 0))}}
BALL = op.Sphere("ball", radius=0.02, position=(0.0, 1.0, 1.0))


def passed_on():
    """The ball goes from one arm, which also fetches something else afterwards, to the other; it is held from afar."""
    return (
        op.Task()
        .attach("ball", "a/tip", arm="a")
        .move([0.2, 0.5], arm="a", name="there")
        .detach("ball", arm="a")
        .move([1.5, 0.5], arm="a")
        .move([0.9, 0.5], arm="b")
        .attach("ball", "b/tip", arm="b")
        .move([0.5, 1.0], arm="b", wait_for="there")
        .dwell(0.3, arm="b")
        .detach("ball", arm="b")
    )


@pytest.fixture(scope="module")
def run():
    problem = op.Problem(op.Robot.side_by_side(ARMS), "ready", task=passed_on(), scene=[BALL], planner="quintic")
    found = op.plan(problem, budget=20.0)
    assert found.verified, (found.failure, found.report and found.report.failures)
    return found


def test_a_step_waits_by_itself_for_the_arm_that_releases_its_object(run):
    task = run.problem.task
    assert [step.waits for step in task] == [(), (), (), (), (), (3,), (2,), (), ()]
    times = {(one.step, one.kind): one for one in run.trajectory.segments}
    released, taken = times[3, "detach"], times[6, "attach"]
    assert taken.begin >= released.begin
    assert times[5, "move"].begin == 0.0  # meanwhile
    assert times[4, "move"].begin < times[5, "move"].end + 0.3
    begins = [one.begin for one in run.trajectory.segments]
    assert begins == sorted(begins)


def test_scene_and_load_are_those_of_both_arms(run):
    holders = [
        (part.begin, [held.link for held in part.problem.scene.attached])
        for part in scene_parts(run.problem, run.trajectory)
    ]
    assert [links for _, links in holders if links] == [["a/tip"], ["b/tip"]]
    assert all(part.problem.robot.mounting.payload == () for part in scene_parts(run.problem, run.trajectory))


def test_the_bound_is_that_of_the_slower_arm(run):
    bound = duration_bound(run.problem, run.trajectory)
    alone = op.plan(op.Problem("planar2r", [0.5, 1.0], [0.2, 0.5], planner="scurve")).lower_bound
    assert alone < bound <= run.duration
    assert run.lower_bound == pytest.approx(bound)


def test_what_is_taken_before_it_is_released_is_refused(run):
    segments = run.trajectory.segments
    taken = next(one for one in segments if one.kind == "attach" and one.step == 6)
    early = [replace(one, begin=0.0, end=0.0) if one is taken else one for one in segments]
    early.sort(key=lambda one: (one.begin, one.step))
    report = op.verify(run.problem, replace(run.trajectory, segments=tuple(early)))
    assert [check.name for check in report.failures][:1] == ["steps"]


def test_steps_stand_in_a_row_up_to_where_an_arm_waits(run):
    row = one_after_another(run.problem)
    assert [step.number for step in row.task] == [1, 2, 3, 4, 5, 6, 7, 8, 9]
    other = run.problem.with_task(
        op.Task()
        .move([0, 0], arm="a", name="x")
        .move([0, 0], arm="b", wait_for="x", name="y")
        .move([1, 0], arm="a")
        .move([1, 0], arm="a", wait_for="y")
    )
    assert [step.number for step in one_after_another(other).task] == [1, 3, 2, 4]


def test_an_arm_comes_nearer_at_its_ends_whatever_the_other_does():
    """Arm a goes to a ball, 2 mm before it, and back, while arm b moves: as quickly with 10 mm required as without."""
    there, planar = [0.2, 0.5], op.load_robot("planar2r")
    x, y, z = planar.fk(there).position
    balls = (op.Sphere("ball", radius=0.02, position=(x + d, y, z)) for d in np.arange(0.0, 0.2, 5e-4))
    gaps = ((ball, CollisionModel(planar, op.Scene([ball])).clearance(np.array(there)).distance) for ball in balls)
    ball = next(ball for ball, gap in gaps if gap > 0.0015)
    task = op.Task().move(there, arm="a").move([1.5, 0.5], arm="a").move([1.2, -0.5], arm="b").move([0, 0.9], arm="b")
    problem = op.Problem(op.Robot.side_by_side(ARMS), "ready", task=task, scene=[ball])
    plain, asked = (op.plan(problem.with_parts(clearance=one), budget=20.0) for one in (0, {"scene": 0.01}))
    assert plain.verified
    assert asked.verified
    assert asked.duration == pytest.approx(plain.duration, rel=0.02)
    first, other = (next(one for one in asked.trajectory.segments if one.step == k) for k in (1, 3))
    assert other.begin < first.end < other.end


def test_a_step_past_vias_waits_once():
    past = op.JointGoal([0.4, 0.4])
    task = op.Task().move([1.0, 0.5], arm="a", name="put").move([0.2, 0.9], arm="b", wait_for="put", vias=[past, past])
    problem = op.Problem(op.Robot.side_by_side(ARMS), "ready", task=task)
    moves = ViaMoves.of(problem, make_planner("trajopt", {})).problem.task
    assert [step.waits for step in moves] == [(), (1,), (), ()]


def test_a_corner_leads_to_the_next_line_of_the_same_arm():
    """The second line of arm a has a blend, but the third waits: what follows it in the row is a line of arm b."""
    arms = {"a": "ur5", "b": {"use": "ur5", "base": op.Pose((0, 2.0, 0))}}
    task = (
        op.Task()
        .line(by=(0, 0, 0.1), arm="a", blend=0.02)
        .line(by=(0.1, 0, 0), arm="a", name="over")
        .line(by=(0, 0, 0.1), arm="b", name="up")
        .line(by=(0, 0, 0.1), arm="a", blend=0.02)
        .line(by=(0, 0.1, 0), arm="a", wait_for="up")
    )
    problem = one_after_another(op.Problem(op.Robot.side_by_side(arms), "ready", task=task))
    assert [step.number for step in problem.task] == [1, 2, 4, 3, 5]
    chain = do_chain(Stages(problem), WorldState(problem.start, problem.scene), problem.task, Budget(60.0))
    assert chain.failure is None
    assert [one.corner is not None for one in chain.steps] == [True, False, False, False, False]


def test_run_and_problem_are_read_again(run, tmp_path):
    run.save(tmp_path / "run")
    again = op.load_run(tmp_path / "run")
    assert again.verified
    assert again.trajectory.segments == run.trajectory.segments
    run.problem.save(tmp_path / "p.yaml")
    assert load_problem(tmp_path / "p.yaml").hash == run.problem.hash
