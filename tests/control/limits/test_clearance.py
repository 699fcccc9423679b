"""Obstacles that are seen anew while a controller runs."""

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.control.braking_path import BrakingPath
from optiplan.control.limits.stop_limits import DistanceView, StopLimit
from optiplan.control.step_report import StepOutcome
from optiplan.errors import InputError

HOME = [0.3, 0.4, 0.0, -1.8, 0.0, 2.2, 0.8]


def box(k, pose=None):
    at = {"position": (0.5, -0.3 + 0.3 * k, 0.25)} if pose is None else {"position": pose.position, "rpy": pose.rpy}
    return op.Box(f"box{k}", size=(0.2, 0.1, 0.3), **at)


def made_for(panda, poses, velocities):
    """A new controller among obstacles at these poses, which move from now on."""
    boxes = [box(k, poses[f"box{k}"]).moving([[0.0, v] for v in velocities[f"box{k}"]], 0.4) for k in range(3)]
    return op.Controller(panda, [op.PostureTask(HOME)], scene=op.Scene(boxes))


def rows_by_name(controller, state):
    """Rows of the next step and their lower ends; what is still in view from before may be among them."""
    problem = controller.build(state, 0.002)
    return {name: np.append(row, low) for name, row, low in zip(problem.row_names, problem.C, problem.low, strict=True)}


@pytest.mark.skipif(core is None, reason="the native core was not built")
def test_updated_in_place_it_commands_what_a_new_controller_would(panda):
    rng = np.random.default_rng(5)
    controller = op.Controller(panda, [op.PostureTask(HOME)], scene=op.Scene([box(k) for k in range(3)]))
    state, near = op.State(panda.configurations["ready"]), 0
    for step in range(40):
        poses = {
            f"box{k}": op.Pose(
                tuple(np.array([0.5, -0.3 + 0.3 * k, 0.25]) + rng.uniform(-0.1, 0.1, 3)),
                rpy=(0.1 * step, 0.0, 0.2 * k),
            )
            for k in range(3)
        }
        velocities = {name: tuple(rng.uniform(-0.5, 0.5, 3)) for name in poses}
        controller.update_scene(poses, velocities)
        found = rows_by_name(controller, state)
        for name, row in rows_by_name(made_for(panda, poses, velocities), state).items():
            np.testing.assert_allclose(found[name], row, atol=1e-5)
            near += "box" in name
        state = controller.step(state, 0.002).state
        if step % 8 == 7:
            state = op.State(rng.uniform(-0.3, 0.3, 7) + HOME)
    assert near > 40, "rows were compared"


def test_who_is_not_seen_again_is_taken_to_stand_still(panda):
    limit = op.ClearanceLimit(op.Scene([op.Sphere("ball", radius=0.05, position=(2.0, 0.0, 0.5))]))
    controller = op.Controller(panda, [], limits=[op.PositionLimit(), limit])
    controller.update_scene({"ball": op.Pose((1.0, 0.0, 0.5))}, {"ball": (-1.0, 0.0, 0.0)})
    at = [limit._obstacles.at(t)[0] for t in (0.0, 0.2, 0.4, 5.0)]
    np.testing.assert_allclose(np.subtract(at, at[0]), [0.0, -0.2, -0.4, -0.4], atol=1e-12)


def test_without_limits_of_joints_a_way_out_is_finite(panda):
    ready = panda.configurations["ready"]
    ball = op.Sphere("ball", radius=0.05, position=tuple(panda.fk(ready).matrix[:3, 3]))
    controller = op.Controller(panda, [op.PostureTask(ready)], limits=[op.ClearanceLimit(op.Scene([ball]))])
    state = op.State(ready)
    for _ in range(20):
        state = controller.step(state, 0.002).state
        assert np.isfinite([state.q, state.v, state.a]).all()
    outcome = StepOutcome(state, 0.002)
    for bad in (np.nan, np.inf):
        assert controller._if_clear(np.full(7, bad), outcome) is None
    view, limit, path = controller._guard._views[0], controller.limits[0], BrakingPath(panda)
    lost = DistanceView(view.q, np.full(len(view.bound), np.nan), view.near[:0], view.distance[:0], view.gradient[:0])
    path.start(np.full(7, np.nan), np.zeros(7), np.zeros(7), controller._box, 0.002)
    assert not StopLimit.stop_is_clear(limit, path, lost, np.full(len(view.bound), -1.0), 0.0)


def test_an_update_of_nothing_makes_nothing_anew(panda, monkeypatch):
    alone, among = op.ClearanceLimit(), op.ClearanceLimit(op.Scene([box(0)]))
    controller = op.Controller(panda, [], limits=[op.PositionLimit(), alone, among])
    models = alone.model, among.model
    controller.update_scene({})
    assert (alone.model, among.model) == models
    controller.update_scene({"box0": op.Pose((1, 0, 0))})
    assert alone.model is models[0]
    assert among.model is not models[1]


@pytest.mark.parametrize(
    ("poses", "velocities", "words"),
    [
        ({"bottle": op.Pose((1, 0, 0))}, None, "'bottle'.*one of: box0, box1"),
        ({"box0": (1, 0, 0)}, None, r"poses\['box0'\].*op\.Pose"),
        ([op.Pose((1, 0, 0))], None, "poses of obstacles by name"),
        ({"box0": op.Pose((1, 0, 0))}, {"box0": (np.nan, 0, 0)}, "three finite numbers"),
        ({"box0": op.Pose((1, 0, 0))}, {"box1": (0, 0, 0)}, "without a pose"),
    ],
)
def test_bad_scenes_are_refused(panda, poses, velocities, words):
    controller = op.Controller(panda, [], scene=op.Scene([box(0), box(1)]))
    with pytest.raises(InputError, match=f"Controller.update_scene.*{words}"):
        controller.update_scene(poses, velocities)
