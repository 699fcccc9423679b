"""What planners are given for a tracking error, and the distances that they plan with."""

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.planners.common.tracking_tube import planned_in_tube
from optiplan.planners.task.stages import Stages, WorldState
from optiplan.problem.task.scene_change import scene_after
from tests.planned import Until


@pytest.fixture(scope="module")
def problem():
    return op.load_problem("02_shelf")


def test_limits_and_constraints_are_narrower(problem):
    cone = op.OrientationCone("panda_hand_tcp", (0, 0, 1), (0, 0, -1), 3.0)
    plane = op.OnPlane("panda_hand_tcp", (0, 0, 1), 0.0, 5.0)
    apart = op.PairClearance((("panda_hand", "panda_link0"),), 0.01)
    wide = problem.with_parts(path_constraints=[cone, plane, apart], tracking_error=0.01)
    found = planned_in_tube(wide)
    np.testing.assert_allclose(found.limits.lower, wide.limits.lower + 0.01, atol=2e-6)
    np.testing.assert_allclose(found.limits.upper, wide.limits.upper - 0.01, atol=2e-6)
    narrow, level, farther = found.path_constraints
    assert narrow.within == pytest.approx(3.0 - 0.07)
    assert 5.0 - 0.07 * 1.5 < level.within < 5.0 - 0.02
    assert farther.at_least > 0.02
    assert planned_in_tube(problem) is problem


def test_tolerances_that_the_tube_takes_are_not_taken_whole(problem):
    cone = op.OrientationCone("panda_hand_tcp", (0, 0, 1), (0, 0, -1), 0.05)
    wide = problem.with_parts(goal=problem.start, path_constraints=[]).with_parts(tracking_error=0.02)
    from optiplan.problem.problem import derived

    (found,) = planned_in_tube(derived(wide, path_constraints=(cone,))).path_constraints
    assert found.within == pytest.approx(0.01)


def test_constraints_of_what_a_step_holds_are_narrower_by_then():
    """The cube is a frame of the robot only while it is held; a tracking error ended in `unknown frame 'cube'`."""
    cube = op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.5, 0.2, 0.3))
    upright = op.OrientationCone("cube", (0, 0, 1), (0, 0, 1), 0.3)
    apart = op.PairClearance((("cube", "panda_link0"),), 0.01)
    pose = op.Pose((0.5, 0.2, 0.3), rpy_deg=(180, 0, 0))
    task = op.Task().move(pose).attach("cube", "panda_hand", touch=("panda_leftfinger", "panda_rightfinger"))
    task = task.move(op.Pose((0.5, -0.2, 0.4), rpy_deg=(180, 0, 0)), path_constraints=[upright, apart])
    stated = op.Problem("panda", "ready", task=task, scene=[cube], tracking_error=0.001)
    run = op.plan(stated, budget=10.0)
    assert run.verified, run.why_not
    asked, at = planned_in_tube(stated), run.trajectory(run.trajectory.segments[1].end)
    held = WorldState(at, scene_after(stated.scene, stated.task[1].action, stated.robot, at))
    cone, farther = Stages(asked).at(held, asked.task[2], asked.task[2].action.joints).problem.path_constraints
    assert cone.within == pytest.approx(0.3 - 0.007)
    assert farther.at_least > 0.012


@pytest.mark.parametrize(("name", "error"), [("02_shelf", 0.01), ("18_baxter_dual", 0.003), ("16_delbot", 0.01)])
def test_distances_in_the_tube_are_below_all_distances_there(name, error):
    problem = op.load_problem(name)
    own, exact = np.full(problem.robot.n, error), CollisionModel(problem.robot, problem.scene)
    model = planning_model(problem.robot, problem.scene, error=own)
    rng = np.random.default_rng(0)
    limits = problem.limits
    low, high = np.maximum(limits.lower, -3.0), np.minimum(limits.upper, 3.0)
    met = 0
    for _ in range(12):
        q = problem.start + 0.2 * rng.uniform(-1, 1, problem.robot.n) * (high - low)
        q = np.clip(q, limits.lower + 2.0 * error, limits.upper - 2.0 * error)  # nearer to them it is not free
        near = {one.pair.index: one for one in model.contacts(q, 0.05)}
        assert model.collides(q) == any(one.distance <= 0.0 for one in model.contacts(q, 1e-3))
        for at in q + error * np.sign(rng.uniform(-1, 1, (12, problem.robot.n))):
            exact.place(at)
            for index, one in near.items():
                if one.distance > 0.0:
                    met += 1
                    assert exact.pair_distance(index).distance >= one.distance - 2e-6
    assert met > 100


def test_kept_models_are_of_their_error(problem):
    plain, wide = (kept_planning_model(problem.robot, problem.scene, np.full(7, e)) for e in (0.0, 0.01))
    assert plain is not wide
    assert plain.error is None
    assert kept_planning_model(problem.robot, problem.scene) is plain
    assert kept_planning_model(problem.robot, problem.scene, np.full(7, 0.01)) is wide
    q = problem.start
    assert wide.clearance(q).distance < plain.clearance(q).distance


@pytest.mark.parametrize("planner", ["rrtconnect", "prm", "rounded", "quintic"])
def test_planners_find_such_motions(planner):
    problem = op.load_problem("02_shelf" if planner in ("rrtconnect", "prm") else "01_reach")
    run = op.plan(problem, planner, budget=4.0, tracking_error=0.004)
    assert run.verified, run


def test_ends_keep_the_error_from_the_limits(problem):
    model = planning_model(problem.robot, problem.scene, error=np.full(7, 0.01))
    q = np.array(problem.robot.configurations["ready"])
    assert not model.collides(q)
    q[6] = problem.limits.upper[6] - 0.005
    assert model.collides(q)
    first = Until()
    budget = op.Budget(20.0, first.met)
    run = op.plan(problem, tracking_error=0.02, budget=budget, progress=first)  # a goal here is 1 mrad within the limit
    assert run.verified, run


def test_a_start_that_touches_in_the_tube_says_so(problem):
    run = op.plan(problem, tracking_error=0.2)
    assert run.failure.kind == "start-in-collision"
    assert "within the tracking error" in run.failure.detail
