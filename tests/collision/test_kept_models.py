"""Models of the same robot among the same bodies are kept; no other is taken for one."""

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import optiplan as op
from optiplan.collision import native_model
from optiplan.collision.kept_models import collision_model, kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.planners.sampling.shrunk_obstacles import among_thinner, thinned

BOXES = [op.Box("shelf", size=(0.4, 0.4, 0.02), position=(0.5, 0.0, 0.4))]


@pytest.fixture(scope="module")
def problem() -> op.Problem:
    return op.Problem("panda", "ready", [0.5, -0.5, 0.2, -2.0, 0.1, 1.8, 0.7], BOXES)


@pytest.mark.parametrize("kept", [collision_model, kept_planning_model])
def test_another_start_needs_no_other_model(problem, kept):
    model = kept(problem.robot, problem.scene)
    moved = problem.with_start([0.1, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    assert moved.scene is not problem.scene
    assert kept(moved.robot, moved.scene) is model


@pytest.mark.parametrize("kept", [collision_model, kept_planning_model])
@pytest.mark.parametrize(
    "change",
    [
        lambda scene: scene.moved("shelf", z=0.05),
        lambda scene: scene.with_(op.Box("shelf", size=(0.4, 0.4, 0.03), position=(0.5, 0.0, 0.4))),
        lambda scene: scene.with_(op.Box("plate", size=(0.4, 0.4, 0.02), position=(0.5, 0.0, 0.2))),
        lambda scene: scene.with_(allowed=[("panda_hand", "shelf")]),
        lambda scene: op.Scene([scene.obstacles[0].moving([[0, 0.01], [0], [0]])]),
        lambda scene: scene.with_attached(op.Sphere("cup", 0.01, position=(0, 0, 0.2)).attached_to("panda_hand")),
    ],
    ids=["moved", "thicker", "one more", "allowed", "moving", "attached"],
)
def test_another_scene_has_its_own_model(problem, kept, change):
    model = kept(problem.robot, problem.scene)
    other = change(problem.scene)
    assert kept(problem.robot, other) is not model
    assert kept(problem.robot, other).scene is other


@pytest.mark.parametrize("kept", [collision_model, kept_planning_model])
@pytest.mark.parametrize("raised", [0.0, 0.1])
def test_a_file_that_holds_something_else_by_now_is_another_body(problem, kept, raised, tmp_path):
    """A scan that is written anew under its old name, in its old place or in another one."""
    scan = tmp_path / "scan.npz"

    def scanned(points, z):
        np.savez(scan, points=np.array(points))
        return problem.with_scene([op.PointCloud("scan", scan, radius=0.02, position=(0.5, 0.0, z))])

    far = scanned([[0.0, 2.0, 0.0]], 0.0)
    model = kept(far.robot, far.scene)
    near = scanned([[0.0, 2.0, 0.0], [0.1, 1.5, 0.0]], raised)
    assert kept(near.robot, near.scene).same_bodies is not model.same_bodies
    again = scanned([[0.0, 2.0, 0.0], [0.1, 1.5, 0.0]], raised)
    assert kept(again.robot, again.scene) is kept(near.robot, near.scene)


def test_a_motion_through_what_a_file_holds_by_now_is_refused(tmp_path):
    scan = tmp_path / "scan.npz"
    start, goal = [0.9, 0.5], [-1.1, 0.4]

    def scanned(y):
        np.savez(scan, points=np.array([[0.85, y, 0.5]]))
        return op.Problem("planar2r", start, goal, [op.PointCloud("scan", scan, radius=0.05)])

    run = op.plan(scanned(9.0), "quintic")
    assert run.verified
    assert not op.verify(scanned(0.18), run.trajectory).verified
    assert op.verify(scanned(9.0), run.trajectory).verified


def test_another_robot_has_its_own_model(problem):
    model = collision_model(problem.robot, problem.scene)
    raised = problem.with_base(op.Pose((0.0, 0.0, 0.1)))
    assert collision_model(raised.robot, raised.scene) is not model


@pytest.mark.parametrize("planner", ["quintic", "rrtconnect", "sclerp", "line", "trajopt"])
def test_planners_ask_the_kept_model(problem, planner, monkeypatch):
    kept_planning_model(problem.robot, problem.scene)
    made = []
    plain = native_model.planning_model  # answers, too: what is imported from here on keeps what stands there
    monkeypatch.setattr(
        native_model, "planning_model", lambda *given, **more: made.append(given) or plain(*given, **more)
    )
    op.plan(problem, planner, budget=0.5)
    assert not made


def test_the_model_of_what_stands_still_is_kept_beside_that_of_what_moves(problem):
    moving = op.Scene([*problem.scene.obstacles, op.Sphere("ball", 0.05, (1, 0, 1)).moving([[0, 0.01], [0], [0]])])
    model = kept_planning_model(problem.robot, problem.scene)
    assert kept_planning_model(problem.robot, moving) is not model
    assert kept_planning_model(problem.robot, moving.standing) is model


OBSTACLES = [
    *BOXES,
    op.Cylinder("tin", radius=0.04, length=0.12, position=(0.45, 0.1, 0.47)),
    op.Sphere("ball", 0.06, position=(0.3, 0.4, 0.5)),
    op.Mesh("frame", Path(__file__).parents[2] / "problems/meshes/frame.stl", scale=0.001, position=(0.55, 0.05, 0.5)),
    op.HalfSpace("floor", normal=(0, 0, 1), offset=-0.2),
]


@pytest.fixture(scope="module")
def crowded() -> op.Problem:
    return op.Problem("panda", "ready", [0.5, -0.5, 0.2, -2.0, 0.1, 1.8, 0.7], OBSTACLES)


@pytest.mark.parametrize("asked", [False, True], ids=["before a query", "after a query"])
@pytest.mark.parametrize("change", ["moved", "reshaped"])
def test_a_model_of_changed_obstacles_answers_like_a_new_one(crowded, change, asked):
    """To the last bit: nothing of where obstacles were, of their shapes, or of what was asked then, is left."""
    known = CollisionModel(crowded.robot, crowded.scene)
    Q = np.random.default_rng(5).uniform(-1.0, 1.0, (20, crowded.robot.n)) + crowded.start
    if asked:
        _answers(known, Q)
    before = _answers(CollisionModel(crowded.robot, crowded.scene), Q)
    if change == "moved":
        scene = crowded.scene.moved("tin", x=0.05).moved("frame", z=-0.03).moved("shelf", y=0.1)
        found = known.with_obstacles_moved(scene)
    else:
        scene = thinned(crowded.scene, -0.01)
        found = known.with_obstacles_reshaped(scene)
    assert found is not None
    assert found.scene is scene
    assert found.pairs == known.pairs
    assert (found.same_bodies is known.same_bodies) == (change == "moved")
    new = _answers(CollisionModel(crowded.robot, scene), Q)
    for one, expected in zip(_answers(found, Q), new, strict=True):
        np.testing.assert_array_equal(one, expected)
    for one, expected in zip(_answers(known, Q), before, strict=True):
        np.testing.assert_array_equal(one, expected)  # the old one has kept its places and shapes


def test_a_planners_model_between_thinner_obstacles_answers_like_a_new_one(crowded):
    Q = np.random.default_rng(6).uniform(-1.0, 1.0, (20, crowded.robot.n)) + crowded.start
    found = among_thinner(planning_model(crowded.robot, crowded.scene), -0.01)
    new = planning_model(crowded.robot, thinned(crowded.scene, -0.01))
    assert [found.collides(q) for q in Q] == [new.collides(q) for q in Q]
    np.testing.assert_array_equal(found.near(Q, 0.1).distance, new.near(Q, 0.1).distance)


def test_a_model_of_moved_obstacles_outlives_the_one_that_it_was_made_of(crowded):
    """Solvers hold plain pointers into the geometry that they were made of: they are never those of another model."""
    known = CollisionModel(crowded.robot, crowded.scene)
    known.clearance(crowded.start)
    known.collides(crowded.start)
    shapes = weakref.ref(known.geometry)
    moved = known.with_obstacles_moved(crowded.scene.moved("shelf", y=0.1))
    assert moved is not None
    before = moved.clearance(crowded.start)
    del known
    gc.collect()
    assert shapes() is None
    after = moved.clearance(crowded.start)
    assert before is not None
    assert after is not None
    assert after.distance == before.distance


def _answers(model: CollisionModel, Q: np.ndarray) -> list[np.ndarray]:
    near = model.near(Q, 0.2)
    collides = np.array([model.collides(q) for q in Q])
    clearance = [model.clearance(q) for q in Q]
    points = np.array([(one.distance, *one.point_a, *one.point_b) for one in clearance if one is not None])
    bounds = model.lower_bounds(Q), model.travel(Q, np.full_like(Q, 0.01)), model.gradients(Q, near)
    return [near.rows, near.pairs, near.distance, near.points, near.normals, collides, points, *bounds]


def test_a_run_among_moved_obstacles_is_that_of_a_fresh_thread(crowded):
    """Plan, proof and metrics with the kept model are those with a new one."""
    scene = crowded.scene.moved("ball", x=0.03).moved("shelf", z=-0.02)
    collision_model(crowded.robot, crowded.scene)
    kept = op.plan(crowded.with_scene(scene), "quintic")
    with ThreadPoolExecutor(1) as alone:
        fresh = alone.submit(lambda: op.plan(crowded.with_scene(scene), "quintic")).result()
    assert kept.report is not None
    assert fresh.report is not None
    assert kept.report.to_dict() == fresh.report.to_dict()
    assert kept.metrics == fresh.metrics
    assert np.array_equal(kept.trajectory.coefficients, fresh.trajectory.coefficients)


@pytest.mark.parametrize(
    "change",
    [
        lambda scene: scene.with_(op.Box("shelf", size=(0.4, 0.4, 0.03), position=(0.5, 0.0, 0.4))),
        lambda scene: scene.with_(op.Box("plate", size=(0.4, 0.4, 0.02), position=(0.5, 0.0, 0.2))),
        lambda scene: scene.with_(allowed=[("panda_hand", "shelf")]),
        lambda scene: scene.moved("tin", x=-0.45, y=-0.1, z=-0.4),
    ],
    ids=["thicker", "one more", "allowed", "into the base"],
)
def test_other_bodies_or_pairs_take_a_new_model(crowded, change):
    known = CollisionModel(crowded.robot, crowded.scene)
    assert known.with_obstacles_moved(change(crowded.scene)) is None
