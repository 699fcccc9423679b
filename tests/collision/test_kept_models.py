"""Models of the same robot among the same bodies are kept; no other is taken for one."""

import pytest

import optiplan as op
from optiplan.collision.kept_models import collision_model, kept_planning_model

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


def test_another_robot_has_its_own_model(problem):
    model = collision_model(problem.robot, problem.scene)
    raised = problem.with_base(op.Pose((0.0, 0.0, 0.1)))
    assert collision_model(raised.robot, raised.scene) is not model


@pytest.mark.parametrize("planner", ["quintic", "rrtconnect", "sclerp", "line", "trajopt"])
def test_planners_ask_the_kept_model(problem, planner, monkeypatch):
    kept_planning_model(problem.robot, problem.scene)
    made = []
    monkeypatch.setattr("optiplan.collision.native_model.planning_model", lambda *given: made.append(given))
    op.plan(problem, planner, budget=0.5)
    assert not made


def test_the_model_of_what_stands_still_is_kept_beside_that_of_what_moves(problem):
    moving = op.Scene([*problem.scene.obstacles, op.Sphere("ball", 0.05, (1, 0, 1)).moving([[0, 0.01], [0], [0]])])
    model = kept_planning_model(problem.robot, problem.scene)
    assert kept_planning_model(problem.robot, moving) is not model
    assert kept_planning_model(problem.robot, moving.standing) is model
