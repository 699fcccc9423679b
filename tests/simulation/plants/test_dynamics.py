"""The rigid-body plant: laws of mechanics, friction, drives, payload; and the same in MuJoCo."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from optiplan.errors import InputError
from optiplan.geometry.scene import Mesh, Obstacle, Scene
from optiplan.problem.obstacles import Box
from optiplan.robot.robot import load_robot
from optiplan.simulation.plants.base import NOMINAL, Friction, Payload, PlantOptions
from optiplan.simulation.plants.dynamics import RigidBodyDynamics, check_inertias
from optiplan.simulation.plants.ideal import IdealPlant
from optiplan.simulation.plants.mjcf import mjcf
from optiplan.simulation.plants.mjcf_bodies import physical
from optiplan.simulation.plants.rigid_body import RigidBodyPlant

mujoco = pytest.importorskip("mujoco")
REGULAR = [0.0, -1.0, 1.2, -0.4, 0.6, 0.2]
EMPTY = Scene()
MASS = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])


def mujoco_plant(robot, q, step=2.5e-4, options=NOMINAL, scene=EMPTY):
    from optiplan.simulation.plants.mujoco_plant import MujocoPlant

    return MujocoPlant(robot, scene, q, step, options)


def energy(robot, plant):
    data = robot.model.createData()
    kinetic = pin.computeKineticEnergy(robot.model, data, plant.q, plant.v)
    return kinetic + pin.computePotentialEnergy(robot.model, data, plant.q)


def test_a_free_double_pendulum_keeps_its_energy(planar):
    plant = RigidBodyPlant(planar, np.array([0.3, 0.4]), 1e-4)
    first = energy(planar, plant)
    found = []
    for _ in range(100):
        plant.advance(np.zeros(2), 500)
        found.append(energy(planar, plant) - first)
    kinetic = max(pin.computeKineticEnergy(planar.model, planar.model.createData(), plant.q, plant.v), 1.0)
    assert np.abs(found).max() < 0.01 * kinetic  # bounded over 5 s, not growing


def test_a_finer_step_comes_nearer_to_the_truth(ur5):
    """Against an integrator of order 8: the error is of order h."""
    model, data = ur5.model, ur5.model.createData()
    q0, torque = np.array([0.1, -1.0, 1.2, -0.4, 0.6, 0.2]), np.array([5.0, -40.0, 10.0, 2.0, 1.0, 0.5])

    def rates(_, x):
        return np.concatenate([x[6:], pin.aba(model, data, x[:6], x[6:], torque)])

    truth = solve_ivp(rates, (0.0, 0.2), np.r_[q0, np.zeros(6)], rtol=1e-11, atol=1e-12, method="DOP853").y[:6, -1]
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4):
        plant = RigidBodyPlant(ur5, q0, step)
        plant.advance(torque, round(0.2 / step))
        errors.append(np.abs(plant.q - truth).max())
    assert errors[2] < 2e-3
    assert 1.7 < errors[0] / errors[1] < 2.3
    assert 1.7 < errors[1] / errors[2] < 2.3


def test_holding_holds(panda):
    plant = RigidBodyPlant(panda, READY, 2.5e-4)
    plant.advance(plant.holding(), 400)
    np.testing.assert_allclose(plant.q, READY, atol=1e-9)


def test_drives_give_no_more_than_they_can(panda):
    plant = RigidBodyPlant(panda, READY, 2.5e-4)
    assert plant.advance(np.full(7, 1e6), 1).tolist() == panda.limits.torque.tolist()


def test_viscous_friction_slows_as_its_law_says(planar):
    """One joint at a time on a level table: M v' = -b v, v = v0 exp(-b t / M)."""
    robot = planar
    model_gravity = robot.model.gravity.linear.copy()
    friction = Friction(np.array([0.5, 1e4]), np.zeros(2))
    plant = RigidBodyPlant(robot, np.zeros(2), 1e-4, PlantOptions(friction=friction))
    plant.dynamics.model.gravity = pin.Motion.Zero()
    M = RigidBodyDynamics(robot).mass_matrix(np.zeros(2))[0, 0]  # the second joint is as good as locked
    plant.advance(np.array([10.0, 0.0]), 1000)
    v0 = plant.v[0]
    plant.advance(np.zeros(2), 5000)
    assert plant.v[0] == pytest.approx(v0 * np.exp(-0.5 * 0.5 / M), rel=1e-3)
    np.testing.assert_array_equal(robot.model.gravity.linear, model_gravity)  # the robot's own model is left alone


@pytest.mark.parametrize("make", [RigidBodyPlant, mujoco_plant])
def test_dry_friction_holds_what_is_below_it_and_no_more(panda, make):
    coulomb = np.full(7, 0.5)
    still = make(panda, READY, 2.5e-4, PlantOptions(friction=Friction(np.zeros(7), coulomb)))
    still.advance(still.holding() + 0.4, 2000)
    assert np.abs(still.v).max() < (5e-3 if make is RigidBodyPlant else 2e-2)  # creeping
    moving = make(panda, READY, 2.5e-4, PlantOptions(friction=Friction(np.zeros(7), coulomb)))
    moving.advance(moving.holding() + np.r_[1.0, np.zeros(6)], 400)
    assert moving.v[0] > 0.02


def test_a_payload_is_felt_as_its_weight(panda):
    with_load = RigidBodyDynamics(panda, 2.0, np.array([0.0, 0.0, 0.05]))
    more = with_load.gravity(READY) - RigidBodyDynamics(panda).gravity(READY)
    data = panda.model.createData()
    X = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.05]))
    pin.framesForwardKinematics(panda.model, data, READY)
    J = with_load.tool_jacobian(READY)
    lever = data.oMf[panda.frame_id(panda.tool_frame)].rotation @ X.translation
    weight = np.array([0.0, 0.0, 2.0 * 9.81])
    np.testing.assert_allclose(more, J[:3].T @ weight + J[3:].T @ np.cross(lever, weight), atol=1e-9)


def test_mass_matrix_and_torque_agree(panda):
    dynamics = RigidBodyDynamics(panda, 1.0)
    v, a = np.linspace(-1, 1, 7), np.linspace(2, -3, 7)
    bias = dynamics.torque(READY, v, np.zeros(7))
    np.testing.assert_allclose(dynamics.torque(READY, v, a) - bias, dynamics.mass_matrix(READY) @ a, atol=1e-9)
    torque = dynamics.torque(READY, v, a)
    np.testing.assert_allclose(dynamics.acceleration(READY, v, torque, np.zeros(7)), a, atol=1e-7)


def test_a_push_acts_at_the_tool(panda):
    plant = RigidBodyPlant(panda, READY, 1e-5)
    push = pin.Force(np.array([0.0, 30.0, 0.0]), np.zeros(3))
    plant.advance(plant.holding(), 1, push)
    M, J = plant.dynamics.mass_matrix(READY), plant.dynamics.tool_jacobian(READY)
    np.testing.assert_allclose(plant.v, 1e-5 * np.linalg.solve(M, J.T @ push.vector), rtol=1e-6)


@pytest.mark.parametrize("name", ["panda", "ur5", "srra", "delbot", "baxter_left"])
def test_mujoco_moves_as_we_do(name):
    """The same robot, inertias, gravity and torques: the two engines stay together to a micrometre."""
    robot = load_robot(name)
    rng = np.random.default_rng(3)
    q = np.array(next(iter(robot.configurations.values())) if robot.configurations else REGULAR)
    weightless = RigidBodyDynamics(robot).gravity(q)
    load = PlantOptions(payload=Payload(0.5, 0.0, np.array([0.0, 0.02, 0.1])), rotor_inertia=np.full(robot.n, 0.05))
    ours, theirs = RigidBodyPlant(robot, q, 1e-4, load), mujoco_plant(robot, q, 1e-4, load)
    np.testing.assert_allclose(ours.holding(), theirs.holding(), atol=1e-9)
    torque = ours.holding() + 0.2 * rng.uniform(-1, 1, robot.n) * np.minimum(robot.limits.torque, 10.0)
    for plant in (ours, theirs):
        plant.advance(torque, 1000)
    assert not theirs.contacts()
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-6)
    again = RigidBodyDynamics(robot).gravity(q)  # the robot itself was left alone
    np.testing.assert_allclose(again, weightless, atol=1e-12)
    assert np.abs(ours.q - q).max() > 1e-3


def test_mujoco_knows_the_obstacles_and_what_may_touch(panda):
    free = mujoco_plant(panda, READY)
    assert free.contacts() == []
    shelf = Box("shelf", size=(0.3, 0.3, 0.05), position=(0.307, 0.0, 0.48))
    hit = mujoco_plant(panda, READY, scene=Scene([shelf]))
    assert any("shelf" in pair for pair in hit.contacts())
    assert hit.contacts() == []  # told once
    allowed = Scene([shelf], allowed=[("shelf", link) for link in panda.link_geometry])
    assert mujoco_plant(panda, READY, scene=allowed).contacts() == []


def test_a_flat_mesh_is_an_obstacle_in_mujoco_too(panda, tmp_path):
    (tmp_path / "flat.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n")
    for height, touches in ((0.48, True), (2.0, False)):
        table = Obstacle("table", Mesh(tmp_path / "flat.obj"), pin.SE3(np.eye(3), np.array([0.9, 0.0, height])))
        contacts = mujoco_plant(panda, READY, scene=Scene([table])).contacts()
        assert any("table" in pair for pair in contacts) == touches


def test_joints_that_follow_move_in_mujoco_too(tmp_path):
    text = f"""<robot name="gripper"><link name="base"/><link name="a">{MASS}
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
    <link name="b">{MASS}</link>
    <joint name="one" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
    <joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-4" upper="4" effort="50" velocity="6"/><mimic joint="one" multiplier="-2" offset="0.1"/></joint>
    </robot>"""
    (tmp_path / "g.urdf").write_text(text)
    robot = load_robot({"urdf": str(tmp_path / "g.urdf"), "tool_frame": "b"})
    ours, theirs = RigidBodyPlant(robot, np.array([0.4]), 1e-4), mujoco_plant(robot, np.array([0.4]), 1e-4)
    np.testing.assert_allclose(ours.holding(), theirs.holding(), atol=1e-9)
    for plant in (ours, theirs):
        plant.advance(plant.holding() + 1.0, 3000)
    assert ours.q[0] > 0.5
    np.testing.assert_allclose(ours.q, theirs.q, atol=2e-3)  # MuJoCo's equality gives way a little


def test_inertias_that_no_body_has_are_raised_and_others_left():
    good = np.diag([1.0, 2.0, 2.5])
    assert physical(good) is good
    raised = physical(np.diag([0.066, 0.0125, 0.086]))  # the PUMA's third link
    moments = np.linalg.eigvalsh(raised)
    assert moments[0] + moments[1] >= moments[2]
    np.testing.assert_allclose(np.sort(moments), [0.0125 + 0.00375, 0.066 + 0.00375, 0.086], rtol=1e-6)


def test_the_mjcf_can_be_read_by_mujoco(panda):
    model = mujoco.MjModel.from_xml_string(mjcf(panda, Scene(), 1e-3))
    total = sum(inertia.mass for inertia in list(panda.model.inertias)[1:])
    assert sum(model.body_mass[1:]) == pytest.approx(total)


def test_robots_without_inertias_are_named():
    with pytest.raises(InputError, match=r"S0 \(link S0_link\).*<inertial>"):
        check_inertias(load_robot("baxter_report"))
    for name in ("panda", "delbot", "puma560"):
        check_inertias(load_robot(name))


def test_the_ideal_plant_does_what_it_is_told():
    plant = IdealPlant(np.zeros(2), 1e-3)
    plant.advance(np.array([1.0, -2.0]), 500)
    np.testing.assert_allclose(plant.q, [0.5, -1.0])
    np.testing.assert_allclose(plant.v, [1.0, -2.0])
    assert not plant.holding().any()
