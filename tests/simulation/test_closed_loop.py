"""The closed loop: errors as theory says, delay, sensors, pushes, contacts, and what the log holds."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.geometry.scene import Scene
from optiplan.problem.obstacles import Box, Sphere
from optiplan.problem.problem import derived
from optiplan.simulation.closed_loop import Loop, Push, simulate
from optiplan.simulation.controllers.joints import ComputedTorque, DriveLoops, PidController, VelocityTracking
from optiplan.simulation.execution import ExecutionOptions, execute, torque_plant
from optiplan.simulation.execution_report import execution_report
from optiplan.simulation.plants.base import Friction, Payload, PlantOptions
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.plants.ideal import IdealPlant
from optiplan.simulation.plants.imperfections import DelayLine, Imperfections, Sensor
from optiplan.simulation.plants.rigid_body import RigidBodyPlant
from optiplan.simulation.references.joints import StepReference, TrajectoryReference
from optiplan.simulation.step_response import step_response
from optiplan.trajectory.joining import cut_trajectory
from tests.simulation.conftest import READY, swing

BY = np.array([0.4, 0.2, -0.3, 0.3, 0.2, 0.4, -0.5])


@pytest.fixture(scope="module")
def motion(panda):
    return swing(panda.joint_names, READY, BY, 0.7)


def loop(robot, reference, controller, plant, **more):
    return Loop(robot, robot.limits, reference, controller, plant, **more)


def test_computed_torque_follows_at_full_speed(reach, motion):
    log = execute(reach, motion)
    assert log.tracking.tool_rms < 1e-4
    assert log.t[-1] == pytest.approx(0.8)
    np.testing.assert_allclose(log.q[-1], motion.end, atol=1e-5)
    assert not log.touched
    assert "no contact" in repr(log)


@pytest.mark.parametrize("engine", ["own", "mujoco"])
def test_obstacles_move_while_a_motion_is_executed(reach, motion, engine):
    """A ball that falls onto the arm: it touches when its height says so, and a slower one has not arrived."""
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    ball = Sphere("ball", radius=0.05, position=(0.0, 0.0, 2.0))
    fast, slow = (reach.with_scene(Scene([ball.moving([[0.0], [0.0], [0.0, speed]])])) for speed in (-3.0, -0.5))
    options = ExecutionOptions(engine=engine)
    log = execute(fast, motion, options)
    assert log.touched
    met = min(log.contacts.touched.values())
    standing = execute(reach.with_scene(Scene([ball])), motion, options)
    assert not standing.touched
    assert 0.2 < met < 0.5  # what is below it is 0.5 to 1.4 m high
    assert not execute(slow, motion, options).touched


@pytest.mark.parametrize("engine", ["own", "mujoco"])
def test_a_motion_that_begins_moving_is_executed_so(reach, panda, engine):
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    part = cut_trajectory(swing(panda.joint_names, READY, BY, 0.7), 0.35, 0.7)
    log = execute(reach, part, ExecutionOptions(engine=engine))
    assert np.abs(part(np.zeros(1), 1)).max() > 0.5
    assert np.abs(log.error[0]).max() == 0.0
    assert log.tracking.tool_peak < 2e-3


def test_a_task_is_executed_with_its_objects(fetch):
    """In our plant what is held is one body with its link, and weighs on it."""
    log = op.execute(fetch)
    cube = log.objects["cube"]
    assert log.tracking.tool_rms < 5e-5
    assert not log.touched
    assert cube.error < 5e-5
    assert cube.slip < 1e-12
    np.testing.assert_allclose(cube.poses[0, :3], [0.45, 0.1, 0.0235], atol=1e-12)
    np.testing.assert_array_equal(cube.poses[-1], cube.poses[-200])  # released, it stays
    heavy = derived(fetch.problem, task=tuple(_with_mass(step, 3.0) for step in fetch.problem.task))
    loaded = execute(heavy, fetch.trajectory).applied - log.applied
    held = np.abs(loaded).max(axis=1) > 1.0
    events = [segment.begin for segment in fetch.trajectory.segments if segment.kind in ("attach", "detach")]
    assert log.t[held][[0, -1]] == pytest.approx(events, abs=0.02)


def _with_mass(step, mass):
    return replace(step, action=replace(step.action, mass=mass)) if step.kind == "attach" else step


def test_a_speed_that_changes_and_a_way_back_take_nothing_twice(fetch):
    """Back to the last event and forwards again: the cube is taken once, and ends where it should."""
    asked = {0.7: "reverse", 1.1: "resume"}

    def change(executor):
        executor.override = 0.6 if executor.time > 0.4 else 1.0
        for t in [t for t in asked if t <= executor.time]:
            getattr(executor, asked.pop(t))()

    log = op.execute(fetch, speeds=change)
    assert not asked
    assert log.objects["cube"].error < 5e-5
    assert log.tracking.tool_rms < 5e-5


def test_an_error_dies_out_as_the_law_says(panda):
    """e(t) = e0 (1 + w t) exp(-w t), critically damped, at 2 Hz."""
    w, e0 = 2 * np.pi * 2.0, 0.05
    reference = StepReference(np.array(READY), np.array(READY) + e0, 0.0, 0.5)
    controller = ComputedTorque(RigidBodyDynamics(panda), 2.0)
    log = simulate(loop(panda, reference, controller, RigidBodyPlant(panda, READY, 2.5e-4)))
    wanted = e0 * (1 + w * log.t) * np.exp(-w * log.t)
    np.testing.assert_allclose(log.error, np.tile(wanted[:, None], 7), atol=0.02 * e0)


def test_a_pd_joint_answers_as_a_mass_on_a_spring(panda):
    """The first joint turns about the vertical: M q'' = P e - D q', others held stiffly."""
    M = RigidBodyDynamics(panda).mass_matrix(np.array(READY))[0, 0]
    P, D = 20.0, 1.0
    stiff = np.r_[P, np.full(6, 5e3)], np.zeros(7), np.r_[D, np.full(6, 50.0)]
    rotors = PlantOptions(limit=np.full(7, 1e4), rotor_inertia=np.r_[0.0, np.full(6, 1.0)])
    end = np.array(READY) + np.r_[0.01, np.zeros(6)]
    controller = PidController(stiff, 1e-3, gravity=RigidBodyDynamics(panda))
    reference = StepReference(np.array(READY), end, 0.0, 4.0)
    log = simulate(loop(panda, reference, controller, RigidBodyPlant(panda, READY, 2.5e-4, rotors)))
    found = step_response(log.t, log.q[:, 0], 0.0, READY[0], end[0])
    zeta = D / (2 * np.sqrt(P * M))
    assert found.overshoot == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), abs=0.02)


def test_pid_integral_takes_the_weight_and_stays_within_its_limit(panda):
    gains = np.full(7, 400.0), np.full(7, 2000.0), np.full(7, 40.0)
    options = PlantOptions(limit=np.full(7, 500.0), rotor_inertia=np.full(7, 0.5))
    hold = StepReference(np.array(READY), np.array(READY), 0.0, 3.0)
    log = simulate(loop(panda, hold, PidController(gains, 1e-3), RigidBodyPlant(panda, READY, 2.5e-4, options)))
    assert np.abs(log.error[-1]).max() < 1e-4  # the integral carries the arm
    weak = PidController(gains, 1e-3, integral_limit=np.full(7, 1.0))
    log = simulate(loop(panda, hold, weak, RigidBodyPlant(panda, READY, 2.5e-4, options)))
    gravity = RigidBodyDynamics(panda).gravity(log.q[-1])
    lacking = (np.abs(gravity) - 1.0).clip(0.0)
    np.testing.assert_allclose(np.abs(log.error[-1]), lacking / 400.0, atol=2e-4)


def test_velocity_tracking_on_the_ideal_plant(panda, motion):
    plant = IdealPlant(np.array(READY), 1e-3)
    log = simulate(loop(panda, TrajectoryReference(motion), VelocityTracking(10.0), plant))
    assert log.tracking.peak.max() < 1e-6
    assert log.input == "velocity"


@pytest.mark.parametrize("steps", [0, 1, 3, 4, 5, 9])
def test_a_command_acts_after_its_delay(steps):
    """Commands 1, 2, 3, … sent every 4 steps act `steps` steps later; before, the first input."""
    line = DelayLine(steps * 1e-3, 1e-3, 4, np.array([0.0]))
    acting = [float(value[0]) for k in range(6) for value, held in line.after(np.array([k + 1.0])) for _ in range(held)]
    sent = [float(k // 4 + 1) for k in range(24)]
    assert acting == [0.0] * steps + sent[: 24 - steps]


def test_sensors(panda):
    perfect = Sensor(Imperfections(), 1e-3)
    q, v = np.array([0.12345]), np.array([0.5])
    assert perfect.measure(q, v) == (q, v)
    coarse = Sensor(Imperfections(encoder=1e-2), 1e-3)
    assert coarse.measure(q, v)[0] == pytest.approx([0.12])
    moving = [coarse.measure(np.array([1e-3 * 0.5 * k]), v)[1][0] for k in range(1, 3000)]
    assert np.mean(moving[1000:]) == pytest.approx(0.5, rel=0.02)  # differences, filtered
    noisy = Sensor(Imperfections(position_noise=1e-3, velocity_noise=1e-2, seed=4), 1e-3)
    found = np.array([np.concatenate(noisy.measure(q, v)) for _ in range(4000)])
    np.testing.assert_allclose(found.std(axis=0), [1e-3, 1e-2], rtol=0.05)
    again = Sensor(Imperfections(position_noise=1e-3, velocity_noise=1e-2, seed=4), 1e-3)
    np.testing.assert_array_equal(found[0], np.concatenate(again.measure(q, v)))


def test_what_is_wrong_shows(reach, motion):
    good = execute(reach, motion).tracking.tool_rms
    heavier = execute(reach, motion, ExecutionOptions(payload=Payload(0.3, 0.0))).tracking.tool_rms
    late = execute(reach, motion, ExecutionOptions(imperfections=Imperfections(delay=0.005))).tracking.tool_rms
    known = execute(reach, motion, ExecutionOptions(payload=Payload(0.3, 0.3))).tracking.tool_rms
    assert heavier > 5 * good
    assert late > 1.5 * good
    assert known < 1.2 * good


def test_a_push_is_felt_and_forgotten(panda):
    hold = StepReference(np.array(READY), np.array(READY), 0.0, 1.0)
    push = Push(0.2, 0.1, np.array([0.0, 40.0, 0.0]))
    controller = ComputedTorque(RigidBodyDynamics(panda), 5.0)
    log = simulate(loop(panda, hold, controller, RigidBodyPlant(panda, READY, 2.5e-4), pushes=[push]))
    error = log.tool_error[:, 0]
    assert error[log.t < 0.2].max() < 1e-9
    assert error[(log.t > 0.2) & (log.t < 0.4)].max() > 1e-3
    assert error[-1] < 1e-5


def test_contacts_are_found_by_both_engines(reach, motion):
    shelf = Box("wall", size=(0.1, 0.6, 0.6), position=(0.52, 0.0, 0.5))
    problem = reach.with_scene(Scene([shelf]))
    for engine in ("own", "mujoco"):
        if engine == "mujoco":
            pytest.importorskip("mujoco")
        log = execute(problem, motion, ExecutionOptions(engine=engine))
        assert log.touched, engine
        assert any("wall" in pair for pair in log.contacts.touched)
        assert log.contacts.least < 0.0
    free = execute(reach, motion)
    assert free.contacts.least > 0.0


@pytest.mark.parametrize("engine", ["own", "mujoco"])
def test_a_loop_that_explodes_says_so(panda, reach, motion, engine, tmp_path, monkeypatch):
    """Gains far beyond what a sampled loop bears."""
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes a warning
    wild = np.full(7, 1e9), np.zeros(7), np.zeros(7)
    plant = torque_plant(reach, engine, np.array(READY), 2.5e-4, PlantOptions(limit=np.full(7, 1e12)))
    log = simulate(loop(panda, TrajectoryReference(motion), PidController(wild, 1e-3), plant))
    assert "without bound" in log.stopped
    assert log.summary()["stopped"] == log.stopped


@pytest.mark.filterwarnings("error")
def test_the_log_of_a_loop_that_explodes_is_finite(planar):
    step = StepReference(np.zeros(2), np.array([0.3, 0.0]), 0.0, 1.0)
    log = simulate(loop(planar, step, VelocityTracking(1e6), IdealPlant(np.zeros(2), 1e-3)))
    assert "without bound" in log.stopped
    assert np.isfinite(log.applied).all()
    assert np.isfinite(log.trajectory.coefficients).all()


def test_a_long_loop_is_logged_thinly_and_judged_whole(planar, monkeypatch):
    """As a minute would be, of which every step is a sample no more."""
    monkeypatch.setattr("optiplan.simulation.recorder.MOST_SAMPLES", 6000)
    monkeypatch.setattr("optiplan.simulation.log.MOST_PIECES", 600)
    hold = StepReference(np.zeros(2), np.zeros(2), 0.0, 6.5)
    plant = IdealPlant(np.zeros(2), 1e-3)
    log = simulate(loop(planar, hold, VelocityTracking(10.0), plant))
    assert 3000 < len(log.t) <= 6000
    assert log.t[-1] == pytest.approx(6.5, abs=2e-3)
    assert 500 < len(log.trajectory.breakpoints) <= 602
    assert log.trajectory.duration == pytest.approx(log.t[-1])


def test_beyond_limits_is_told(planar):
    fast = swing(planar.joint_names, [0.0, 0.0], np.array([2.0, 0.0]), 0.2)
    log = simulate(loop(planar, TrajectoryReference(fast), VelocityTracking(0.0), IdealPlant(np.zeros(2), 1e-3)))
    peak = 1.875 * 2.0 / 0.2
    assert log.tracking.beyond_velocity[0] == pytest.approx(peak - planar.limits.velocity[0], rel=1e-2)
    assert log.tracking.beyond_velocity[1] == 0.0


@pytest.mark.parametrize(("beyond", "end"), [(-0.05, "upper"), (-3.1, "lower")])
def test_the_position_beyond_its_limit_is_reported_with_that_limit(panda, beyond, end):
    """Joint 4 may be from -3.07 to -0.07: it begins farther from 0 than the one end, and nearer than the other."""
    limit, far = getattr(panda.limits, end)[3], np.array(READY)
    far[3] = beyond
    step = StepReference(np.array(READY), far, 0.1, 1.0)
    log = simulate(loop(panda, step, VelocityTracking(20.0), IdealPlant(np.array(READY), 1e-3)))
    position = next(one for one in execution_report(log, panda, panda.limits)["checks"] if one["name"] == "position")
    assert not position["passed"]
    assert (position["place"], position["limit"]) == (panda.joint_names[3], limit)
    assert position["worst"] == pytest.approx(beyond, abs=1e-3)
    assert position["time"] > 0.5


def test_friction_is_overcome_by_feedback(reach, motion, panda):
    options = PlantOptions(friction=Friction(np.full(7, 0.2), np.full(7, 0.2)))
    controller = ComputedTorque(RigidBodyDynamics(panda), 10.0)
    plant = RigidBodyPlant(panda, READY, 2.5e-4, options)
    log = simulate(loop(panda, TrajectoryReference(motion), controller, plant))
    assert 1e-4 < log.tracking.peak.max() < 0.05


def test_step_response_of_a_known_curve():
    t = np.linspace(0.0, 5.0, 5001)
    q = 1.0 - np.exp(-t / 0.5)
    found = step_response(t, q, 0.0, 0.0, 1.0)
    assert found.rise == pytest.approx(0.5 * np.log(9.0), abs=2e-3)
    assert found.settling == pytest.approx(0.5 * np.log(50.0), abs=2e-3)
    assert found.overshoot == 0.0
    assert found.steady_error == pytest.approx(0.0, abs=1e-3)
    never = step_response(t, 0.5 * q, 0.0, 0.0, 1.0)
    assert (never.rise, never.settling) == (None, None)
    assert never.steady_error == pytest.approx(0.5, abs=1e-3)
    with pytest.raises(ValueError, match="no step"):
        step_response(t, q, 0.0, 1.0, 1.0)


def test_drives_that_take_positions_lag_by_the_velocity_over_the_gain(panda, motion):
    """Those that take velocities are told v_ref, and do not."""
    peaks, gravity = {}, RigidBodyDynamics(panda)
    for takes in ("position", "velocity"):
        gains = (np.full(7, 40.0), np.array([400.0, 400, 300, 300, 60, 60, 30]), np.zeros(7))
        controller = DriveLoops(gains, 1e-3, takes, gravity=gravity)
        plant = RigidBodyPlant(panda, READY, 2.5e-4)
        log = simulate(loop(panda, TrajectoryReference(motion), controller, plant, dt=1e-3))
        peaks[takes] = np.abs(log.q - log.wanted).max(axis=0)
    fastest = np.abs(np.array(motion.extrema(1))).max(axis=0)
    np.testing.assert_allclose(peaks["position"][:4], fastest[:4] / 40.0, rtol=0.05)
    assert (peaks["velocity"][:4] < 0.35 * peaks["position"][:4]).all()
