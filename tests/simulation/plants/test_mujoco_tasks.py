"""Objects of a task in MuJoCo: they rest, fall, are held by welds and by friction, and touch what they should not."""

import numpy as np
import pytest

import optiplan as op
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import derived
from optiplan.simulation.execution import ExecutionOptions, execute
from optiplan.simulation.plants.mjcf_objects import TaskObjects
from optiplan.simulation.plants.mujoco_tasks import MujocoTaskPlant
from optiplan.simulation.plants.task_plant import FrictionGrip
from optiplan.simulation.tasks.stages import stages_of

pytest.importorskip("mujoco")
GAP = 1.5e-3  # m; the plan releases the cube as high above the table


@pytest.fixture(scope="module")
def welded(fetch):
    return op.execute(fetch, "mujoco")


def test_an_object_is_where_the_plan_has_it_less_what_it_falls(fetch, welded):
    cube = welded.objects["cube"]
    assert not welded.touched
    assert welded.tracking.tool_rms < 1e-4
    np.testing.assert_allclose(cube.offset, [0.0, 0.0, -GAP], atol=2e-5)
    assert cube.slip < 1e-5
    assert cube.poses.shape == (len(welded.t), 7)
    np.testing.assert_allclose(cube.poses[0, :3], [0.45, 0.1, 0.0235], atol=1e-12)
    resting = (welded.t > 0.1) & (welded.t < 0.3)
    np.testing.assert_allclose(cube.poses[resting, 2], 0.0225, atol=1e-5)  # on the table
    assert cube.poses[:, 2].max() > 0.06


def test_the_report_has_a_row_for_each_object(welded):
    (row,) = [check for check in welded.report["checks"] if check["name"] == "object"]
    assert (row["place"], row["passed"], row["limit"]) == ("cube", True, 2e-3)
    assert row["worst"] == pytest.approx(GAP, abs=2e-5)
    assert "1.5 mm" in row["detail"]
    assert "objects end within 1.5 mm" in repr(welded)


def test_friction_holds_with_a_margin_that_its_force_gives(fetch):
    """A cube of 0.1 kg between two fingers: m |a - g| / (2 mu F)."""
    log = op.execute(fetch, "mujoco", grip=op.FrictionGrip(force=10.0, friction=0.5))
    needed = 0.1 * 9.81 / (2 * 0.5 * 10.0)
    assert needed < 1.0 - log.slip_margin < 2.0 * needed
    assert 1e-6 < log.objects["cube"].slip < 2e-4
    assert log.objects["cube"].error < 2e-3
    assert any(check["name"] == "grip" and check["passed"] for check in log.report["checks"])


def test_fingers_press_with_no_more_than_their_drive_gives(fetch):
    """One drive of 70 N moves both fingers of the Panda."""
    with pytest.raises(op.InputError, match=r"execute.*grip.*36 N each.*at most 35 N.*panda_finger_joint1"):
        op.execute(fetch, "mujoco", grip=op.FrictionGrip(force=36.0))


def test_what_friction_cannot_hold_is_left_behind(fetch):
    log = op.execute(fetch, "mujoco", grip=op.FrictionGrip(force=1.0, friction=0.3))
    assert log.slip_margin <= 0.0
    assert log.objects["cube"].error > 0.02
    assert not all(check["passed"] for check in log.report["checks"])


def test_an_object_that_meets_what_the_plan_did_not_know_is_a_contact(fetch):
    """A beam on its way, added behind the plan's back: the cube is pushed, or its weld gives, but not in silence."""
    beam = op.Box("beam", size=(0.3, 0.02, 0.02), position=(0.45, 0.04, 0.08))
    problem = derived(fetch.problem, scene=fetch.problem.scene.with_(beam))
    log = execute(problem, fetch.trajectory, ExecutionOptions(engine="mujoco"))
    assert ("beam", "cube") in log.contacts.touched
    assert not log.report["executed"]


@pytest.fixture(scope="module")
def carried():
    """A verified run: the Panda holds a cube 3 cm beside its tool frame from the start, turns and lets it fall."""
    held = op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.03, 0, 0.16)).attached_to("panda_hand", mass=0.2)
    table = op.Box("table", size=(0.2, 0.4, 0.04), position=(0.35, 0.0, 0.36))
    task = op.Task().move((0.2, -0.785, 0, -2.356, 0, 1.571, 0.785)).detach("cube").dwell(0.3)
    run = op.plan(op.Problem("panda", "ready", task=task, scene=Scene([table], [held])), budget=20.0)
    assert run.verified, run
    return run


def test_an_object_that_is_held_at_first_is_released(carried):
    fallen = op.execute(carried, "mujoco").objects["cube"]
    assert fallen.slip < 1e-4
    assert fallen.poses[-1, 2] == pytest.approx(0.40, abs=1e-4)
    assert op.execute(carried).objects["cube"].error < 1e-4  # in our plant nothing falls


def test_pads_stand_for_fingers_that_do_not_move(carried):
    """At rest: the weight across the pads, and its moment about y, on their friction; P = 2 F, R = 15 mm."""
    grip, weight = FrictionGrip(force=30.0, friction=0.6), 0.2 * 9.81
    stages = stages_of(carried.problem, carried.trajectory)
    objects = TaskObjects(carried.problem, carried.trajectory, stages, grip)
    plant = MujocoTaskPlant(carried.problem, objects, 2.5e-4)
    plant.enter(stages[0], ())
    for _ in range(30):
        plant.advance(plant.holding(), 4)
        load = plant.grip_load()
    expected = weight / (0.6 * 60.0) + 0.03 * weight / (2.0 / 3.0 * 0.6 * 0.015 * 60.0)
    assert load == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("key", ["force", "friction"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), "much"])
def test_a_grip_needs_numbers_above_zero(key, value):
    with pytest.raises(op.InputError, match=f"FrictionGrip.*{key}"):
        FrictionGrip(**{key: value})
