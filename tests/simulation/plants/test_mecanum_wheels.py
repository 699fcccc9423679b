"""Wheels with rollers in MuJoCo: they carry the base, roll as the kinematics says, and drift a little."""

import numpy as np
import pytest

from optiplan.kinematics.mecanum import wheel_matrix
from optiplan.problem.load import problem_from_dict
from optiplan.robot.robot import load_robot
from optiplan.simulation.execution import ExecutionOptions, execute
from optiplan.simulation.plants.base import PlantOptions
from optiplan.simulation.plants.mecanum_wheels import MecanumWheels
from optiplan.simulation.plants.mujoco_plant import MujocoPlant
from tests.simulation.conftest import swing

pytest.importorskip("mujoco")
STEP = 2.5e-4


@pytest.fixture(scope="module")
def delbot():
    return load_robot("delbot")


def test_the_base_stands_on_its_rollers(delbot):
    q = np.array(delbot.configurations["home"])[: delbot.n]
    wheels = MecanumWheels(delbot)
    plant = MujocoPlant(delbot, problem(delbot).scene, q, STEP, wheels=wheels)
    for _ in range(100):
        wheels.aim(q, np.zeros(delbot.n))
        plant.advance(plant.holding(), 4)
    assert not plant.contacts()  # rollers on the floor are none
    np.testing.assert_allclose(plant.q[:3], q[:3], atol=1e-4)
    assert wheels.log().lift < 1e-4


def test_a_base_goes_ahead_sideways_and_round_on_its_wheels(delbot):
    """Within a tenth of a millimetre, its pose being fed back; by the rates alone it is some millimetres off."""
    start = np.array(delbot.configurations["home"])[: delbot.n]
    by = np.zeros(delbot.n)
    by[:3] = 0.2, 0.25, 0.4
    motion = swing(delbot.joint_names, start, by, 1.5)
    log = execute(problem(delbot), motion, ExecutionOptions(engine="mujoco", wheels=True))
    assert not log.touched
    assert log.tracking.tool_rms < 1e-3
    np.testing.assert_allclose(log.q[-1, :3], motion.end[:3], atol=1e-3)
    assert log.wheels.travel == pytest.approx(np.hypot(0.2, 0.25), rel=0.05)
    assert 0.0 < log.wheels.drift < 5e-3
    assert log.wheels.lift < 5e-4
    (row,) = [check for check in log.report["checks"] if check["name"] == "wheels"]
    assert "off after 0.3" in row["detail"]


def test_wheels_begin_at_the_rates_of_a_moving_base(delbot):
    q = np.array(delbot.configurations["home"])[: delbot.n]
    v = np.zeros(delbot.n)
    v[:3] = 0.2, -0.1, 0.3
    plant = MujocoPlant(delbot, problem(delbot).scene, q, STEP, PlantOptions(velocity=v), MecanumWheels(delbot))
    rates = [plant.data.joint(f"wheel {name}").qvel[0] for name in ("front_left", "front_right")]
    np.testing.assert_allclose(rates, (wheel_matrix(delbot, q) @ v)[:2])


def problem(robot):
    home = [float(x) for x in np.array(robot.configurations["home"])[: robot.n]]
    return problem_from_dict({"version": 1, "robot": "delbot", "start": {"joints": home}, "goal": {"joints": home}})
