"""Every task: its Jacobian against differences, its error at the target, where it leads, what it refuses."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.control.objective import TaskObjective
from optiplan.control.tasks.base import ControlTask

TARGET = op.Pose(position=(0.4, 0.2, 0.5), rpy=(2.8, 0.3, 0.4))


POSTURE = np.array([0.3, -0.5, 0.3, -2.0, 0.2, 1.8, 0.4, 0.1, 0.2])


def tasks(robot):
    tool, n = robot.tool_frame, robot.n
    root = robot.model.frames[robot.model.nframes // 2].name
    rng = np.random.default_rng(0)
    return {
        "pose": op.PoseTask(tool, TARGET),
        "position": op.PositionTask(tool, [0.3, 0.1, 0.6]),
        "orientation": op.OrientationTask(tool, [0.3, 0.5, -0.4]),
        "relative": op.RelativePoseTask(tool, root, TARGET),
        "look-at": op.LookAtTask(tool, [1.0, 0.5, 0.2], axis=(1.0, 0.2, 0.0)),
        "posture": op.PostureTask(POSTURE[:n], cost=1.0, gain=5.0),
        "damping": op.DampingTask(),
        "coupling": op.JointCouplingTask(rng.normal(size=(2, n)), [0.1, 0.2]),
        "centre-of-mass": op.CentreOfMassTask([0.1, 0.0, 0.4]),
        "manipulability": op.ManipulabilityTask(5.0),
    }


NAMES = sorted(tasks(op.load_robot("panda")))


def configurations(robot, count, seed=0):
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.limits.lower, -2.0), np.minimum(robot.limits.upper, 2.0)
    return rng.uniform(low, high, (count, robot.n))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("which", ["panda", "delbot"])
def test_jacobian_against_differences(name, which, request):
    robot = request.getfixturevalue(which)
    task, h = tasks(robot)[name], 1e-6
    task.bind(robot)
    controller = op.Controller(robot, [])
    for q in configurations(robot, 4):
        J = task.jacobian(controller.configuration(op.State(q)))
        ends = [
            [task.error(controller.configuration(op.State(q + s * h * e))) for s in (1, -1)] for e in np.eye(robot.n)
        ]
        differences = np.array([(up - down) / (2.0 * h) for up, down in ends]).T
        expected = np.zeros_like(J) if name == "damping" else differences
        got = np.zeros_like(J) if name == "damping" else J
        assert np.abs(got - expected).max() < 2e-7 * max(1.0, np.abs(J).max())


def test_base_motion_jacobian_and_wrap(delbot):
    task = op.BaseMotionTask(target=(1.0, 0.5, 3.0))
    task.bind(delbot)
    controller = op.Controller(delbot, [])
    state = op.State([0.2, 0.1, -3.0, *np.zeros(6)])
    e = task.error(controller.configuration(state))
    assert e == pytest.approx([-0.8, -0.4, -6.0 + 2.0 * np.pi])
    assert (task.jacobian(controller.configuration(state))[:, :3] == np.eye(3)).all()


def test_a_base_twist_is_seen_from_the_base(delbot):
    task = op.BaseMotionTask(twist=(0.2, 0.0, 0.0))
    controller = op.Controller(delbot, [task])
    state = op.State([0.0, 0.0, np.pi / 2.0, *delbot.configurations["home"][3:]])
    for _ in range(1500):
        state = controller.step(state, 0.002).state
    assert state.v[:3] == pytest.approx([0.0, 0.2, 0.0], abs=1e-3)


@pytest.mark.parametrize("name", ["pose", "position", "orientation", "look-at", "posture", "coupling"])
@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_error_vanishes(panda, name, form):
    task = tasks(panda)[name]
    controller = op.Controller(panda, [task], form=form)
    state = op.State(panda.configurations["ready"])
    first = np.linalg.norm(task.error(controller.configuration(state)))
    for _ in range(1200):
        state = controller.step(state, 0.004).state
    assert first > 0.05
    assert np.linalg.norm(task.error(controller.configuration(state))) < 1e-3 * first


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
@pytest.mark.parametrize("off", [0.0, 1e-8, 1e-3])
def test_an_axis_that_points_straight_away_turns_round(panda, form, off):
    ready = panda.configurations["ready"]
    X = panda.fk(ready).matrix
    task = op.LookAtTask(panda.tool_frame, X[:3, 3] - X[:3, 2] + off * X[:3, 1])
    controller, state = op.Controller(panda, [task, op.PostureTask("ready")], form=form), op.State(ready)
    e = np.linalg.norm(task.error(controller.configuration(state)))
    assert e == pytest.approx(np.pi, abs=2e-3)
    for _ in range(400):
        state = controller.step(state, 0.002).state
    assert np.linalg.norm(task.error(controller.configuration(state))) < e - 0.2


def test_what_is_set_on_a_task_stays_for_controllers_to_come(panda, delbot):
    posture, damping, tool = op.PostureTask("ready"), op.DampingTask(), op.PoseTask(panda.tool_frame)
    posture.cost, damping.cost, tool.gain = 0.5, [1, 2, 3, 4, 5, 6, 7], 3.0
    for cost, gain in ((0.5, 3.0), (0.25, 4.0)):
        op.Controller(panda, [posture, damping, tool])
        assert (posture.cost == np.full(7, cost)).all()
        assert damping.cost.tolist() == [1, 2, 3, 4, 5, 6, 7]
        assert tool.gain == gain
        posture.cost, posture.target, tool.gain = 0.25, np.full(7, 0.1), 4.0
    assert (posture.target == 0.1).all()
    early = op.PostureTask()
    early.target = "ready"
    op.Controller(panda, [early, op.PoseTask(panda.tool_frame)])
    assert (early.target == panda.configurations["ready"]).all()
    with pytest.raises(op.InputError, match="DampingTask: cost"):
        op.Controller(delbot, [damping])


def test_strict_priorities(panda):
    """Two targets against each other: the first is reached, the second as far as the first allows."""
    tool = panda.tool_frame
    first = op.PositionTask(tool, [0.4, 0.2, 0.5])
    second = op.PositionTask(tool, [0.6, -0.2, 0.5], priority=1)
    weighed = op.Controller(panda, [first, op.PositionTask(tool, [0.6, -0.2, 0.5])])
    strict = op.Controller(panda, [first, second, op.PostureTask("ready", priority=2)])
    ends = []
    for controller in (weighed, strict):
        state = op.State(panda.configurations["ready"])
        for _ in range(800):
            state = controller.step(state, 0.004).state
        ends.append(np.linalg.norm(first.error(controller.configuration(state))))
    assert ends[0] > 0.1
    assert ends[1] < 1e-4


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_feed_forward_follows_a_moving_target(panda, form):
    """A circle of 10 cm in 2 s: with its twist and acceleration given, the tool stays on it."""
    task = op.PoseTask(panda.tool_frame)
    controller = op.Controller(panda, [task, op.PostureTask("ready", cost=1e-3)], form=form)
    state = op.State(panda.configurations["ready"])
    X = pin.SE3(controller.configuration(state).pose(panda.frame_id(panda.tool_frame)))
    dt, w, r, errors = 0.002, np.pi, 0.05, []
    for k in range(2500):
        t = k * dt
        s = 0.5 * t * t if t < 1.0 else t - 0.5  # sets out smoothly
        rate, grow = (t, 1.0) if t < 1.0 else (1.0, 0.0)
        c, d = np.cos(w * s), np.sin(w * s)
        place = X.translation + r * np.array([c - 1.0, d, 0.0])
        speed = r * w * rate * np.array([-d, c, 0.0])
        change = r * w * grow * np.array([-d, c, 0.0]) - r * (w * rate) ** 2 * np.array([c, d, 0.0])
        task.set_target(pin.SE3(X.rotation, place), [*speed, 0, 0, 0], [*change, 0, 0, 0])
        if t > 2.0:
            errors.append(np.linalg.norm(task.error(controller.configuration(state))))
        state = controller.step(state, dt).state
    assert max(errors) < 5e-4


def test_repr_and_targets(panda):
    assert repr(op.PoseTask("panda_hand_tcp")) == "PoseTask(frame=panda_hand_tcp, cost=[1.0])"
    X = pin.SE3.Random()
    for target in (X, X.homogeneous):
        assert op.PoseTask("panda_hand_tcp", target).target.isApprox(X, 1e-9)


def test_a_gain_of_ones_own_is_meant(panda):
    """Without one, tasks ask for no more than the robot can do; with one, for gain times the error."""
    tool, far = panda.tool_frame, np.full(6, 2.0)
    for make in (op.PoseTask, lambda frame, **given: op.RelativePoseTask(frame, "panda_link0", **given)):
        free, own = make(tool), make(tool, gain=7.0)
        for task in (free, own):
            task.bind(panda)
        np.testing.assert_allclose(own.wanted_rate(far), -7.0 * far)
        assert np.linalg.norm(free.wanted_rate(far)) < 0.9 * free.gain * np.linalg.norm(far)


class Together(ControlTask):
    """Two joints at the same place, with one row as a vector of whole numbers."""

    def __init__(self):
        super().__init__(1, 1.0, 10.0, 0)

    def error(self, c):
        return c.q[:1] - c.q[2:3]

    def jacobian(self, c):
        return np.array([1, 0, -1, 0, 0, 0, 0])


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_a_task_of_ones_own_gives_the_same_commands(panda, form):
    coupling = op.JointCouplingTask([1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    states = []
    for task in (Together(), coupling):
        controller = op.Controller(panda, [task, op.PostureTask("ready")], form=form)
        state = op.State([0.3, -0.8, -0.2, -2.4, 0.0, 1.6, 0.8])
        for _ in range(200):
            state = controller.step(state, 0.002).state
        states.append(state)
    np.testing.assert_allclose(states[0].q, states[1].q, atol=1e-12)
    assert abs(states[0].q[0] - states[0].q[2]) < 0.3


@pytest.mark.parametrize("gain", [0.5, 8.0])
def test_what_is_asked_for_is_what_the_docstring_says(panda, gain):
    rng, dt, n = np.random.default_rng(0), 0.002, panda.n
    (q,), v = configurations(panda, 1), rng.normal(size=n)
    twist, rate_of_twist = rng.normal(size=(2, 6))
    task = op.PositionTask(panda.tool_frame, gain=gain)
    task.bind(panda)
    task.set_target(TARGET, twist, rate_of_twist)
    state, controller = op.State(q, v, rng.normal(size=n)), op.Controller(panda, [])
    c, ahead, behind = (controller.configuration(op.State(q + s * 1e-6 * v, v)) for s in (0, 1, -1))
    J, drift = task.jacobian(c), (task.jacobian(ahead) - task.jacobian(behind)) @ v / 2e-6
    wanted = -gain * task.error(c) + twist[:3]
    asked = {}
    for by_acceleration in (False, True):
        objective = TaskObjective([task], n, by_acceleration, 0.0, 1e-4, first=True)
        objective.begin_step(state, dt)
        asked[by_acceleration] = objective.demand(c, state).b.copy()
    expected = 4.0 * max(gain, 1.0) * (wanted - J @ v) - gain * (J @ v - twist[:3]) + rate_of_twist[:3] - drift
    np.testing.assert_allclose(asked[False], wanted, atol=1e-12)
    np.testing.assert_allclose((asked[True] - J @ v) / dt, expected, atol=1e-5)
