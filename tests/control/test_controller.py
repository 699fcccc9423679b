"""The controller: recovery, failing solvers, relaxation, singularities, targets out of reach, wrong input."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from benchmarks import control_hour
from optiplan.collision.model import CollisionModel
from optiplan.control.qp.active_set import active_at, solve_from
from optiplan.control.qp.program import Program
from optiplan.control.qp.solvers import ProxQp, QpSolver, QpSolvers

DT = 0.002


class Broken(QpSolver):
    """Always the same wrong answer, or an exception."""

    name = "broken"

    def __init__(self, answer):
        self.answer = answer

    def solve(self, program):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def reach(robot, **target):
    return op.PoseTask(robot.tool_frame, op.Pose(**target))


def test_from_outside_a_joint_limit_it_comes_back_monotonically(panda):
    start = panda.configurations["ready"].copy()
    start[0] = panda.limits.upper[0] + 0.2
    controller = op.Controller(panda, [op.PostureTask(start, cost=1.0)])  # whose target lies outside
    state, outside, steps = op.State(start), [0.2], []
    for _ in range(700):
        steps.append(controller.step(state, DT))
        state = steps[-1].state
        outside.append(state.q[0] - panda.limits.upper[0])
        assert np.abs(state.v).max() <= panda.limits.velocity.max()
        assert np.abs(state.a[0]) <= panda.limits.acceleration[0] + 1e-9
    assert (np.diff(outside)[np.array(outside[:-1]) > 1e-9] <= 1e-9).all()
    assert max(outside[-100:]) <= 1e-8
    assert steps[10].status == "recovering"
    assert "position" in steps[10].slack
    assert np.argmax(np.array(outside) < 1e-6) * DT < 0.6, "not slowly"


def test_from_inside_an_obstacle_it_comes_out_monotonically(panda):
    ready = panda.configurations["ready"]
    tip = op.Controller(panda, []).configuration(op.State(ready)).pose(panda.frame_id("panda_hand")).translation
    block = op.Box("block", size=(0.2, 0.2, 0.2), position=(tip[0] + 0.124, tip[1], tip[2]))
    scene = op.Scene([block])
    check = CollisionModel(panda, scene)
    depth = [check.clearance(ready).distance]
    assert -0.03 < depth[0] < -0.015
    controller = op.Controller(panda, [op.PostureTask("ready", cost=1.0)], scene=scene)
    state, statuses = op.State(ready), set()
    for _ in range(600):
        step = controller.step(state, DT)
        state = step.state
        depth.append(check.clearance(state.q).distance)
        statuses.add(step.status)
    assert (np.diff(depth)[np.array(depth[:-1]) < 0.005] >= -2e-7).all()
    assert depth[-1] >= 0.005 - 1e-6
    assert "recovering" in statuses


@pytest.mark.parametrize(
    "answer", [None, RuntimeError("no"), np.full(7, np.nan), np.zeros(3), np.full(7, 50.0)], ids=str
)
def test_a_solver_that_always_fails_stops_the_robot(panda, answer):
    tool = reach(panda, position=(0.5, 0.3, 0.4), rpy=(3.14, 0, 0))
    good = op.Controller(panda, [tool])
    state = op.State(panda.configurations["ready"])
    for _ in range(150):
        state = good.step(state, DT).state
    assert np.abs(state.v).max() > 0.1
    bad = op.Controller(panda, [tool], solver=Broken(answer))
    for _ in range(400):
        step = bad.step(state, DT)
        state = step.state
        assert (np.abs(state.a) <= panda.limits.acceleration + 1e-9).all()
    if answer is None or not np.shape(answer) == (7,) or np.isnan(answer).any():
        assert step.status == "stopped"
        assert "solver" in step.reason
        assert not state.v.any()


@pytest.mark.parametrize("solver", ["native", "proxqp", Broken(np.zeros(7))], ids=["native", "proxqp", "own"])
def test_a_nan_in_a_task_stops_the_robot(panda, solver):
    tool = reach(panda, position=(0.5, 0.3, 0.4), rpy=(3.14, 0, 0))
    controller, state = op.Controller(panda, [tool], solver=solver), op.State(panda.configurations["ready"])
    for _ in range(50):
        state = controller.step(state, DT).state
    tool.twist = np.zeros(6)
    tool.twist[0] = np.nan  # in place, which nothing checks
    for _ in range(300):
        step = controller.step(state, DT)
        state = step.state
        assert np.isfinite([state.q, state.v, state.a]).all()
    assert step.status == "stopped"


@pytest.mark.parametrize("fail", [0.0, 0.4])
@pytest.mark.parametrize("which", ["panda", "delbot"])
def test_a_short_hour(which, fail):
    """Two seconds of `benchmarks/control_hour.py`, where the hour is."""
    worst = control_hour.simulate(which, 2.0, 0.004, fail, seed=3)
    for name in ("position", "velocity", "acceleration", "clearance"):
        assert getattr(worst, name) <= 1e-6, name
    assert worst.steps == 500


def test_stop_brakes_within_limits(panda):
    tool = reach(panda, position=(0.5, 0.4, 0.4), rpy=(3.14, 0, 0))
    controller = op.Controller(panda, [tool])
    state = op.State(panda.configurations["ready"])
    for _ in range(150):
        state = controller.step(state, DT).state
    assert np.abs(state.v).max() > 0.3
    for _ in range(200):
        before, step = state, controller.stop(state, DT)
        state = step.state
        assert (np.abs(state.a) <= panda.limits.acceleration + 1e-9).all()
        assert (np.abs(state.a - before.a) / DT <= panda.limits.jerk + 1e-6).all()
    assert step.status == "stopped"
    assert not state.v.any()


def test_out_of_reach_is_the_nearest_pose_and_no_error(panda):
    tool = reach(panda, position=(1.5, 0.0, 0.5), rpy=(3.14, 0, 0))
    tool.cost = [1, 1, 1, 0.01, 0.01, 0.01]
    controller = op.Controller(panda, [tool])
    state = op.State(panda.configurations["ready"])
    for _ in range(6000):
        step = controller.step(state, DT)
        state = step.state
    assert step.status == "nearest"
    assert np.abs(state.v).max() < 2e-3
    frame = controller.configuration(state).pose(panda.frame_id(panda.tool_frame)).translation
    assert frame[0] > 0.75


@pytest.mark.parametrize("name", ["panda", "ur5", "srra"])
def test_a_robot_that_sets_out_is_not_as_near_as_it_comes(name):
    robot = op.load_robot(name)
    q = next(iter(robot.configurations.values()))
    controller = op.Controller(robot, [op.PostureTask(q + 0.2, cost=1.0, gain=2.0)])
    state, statuses = op.State(q), set()
    for _ in range(12):
        step = controller.step(state, 0.001)
        state = step.state
        statuses.add(step.status)
    assert statuses <= {"tracking", "limited"}


def test_positions_may_be_given_up_last(panda):
    q = panda.configurations["ready"].copy()
    q[0] = panda.limits.upper[0] - 0.05  # where it could not stop at full speed
    controller = op.Controller(panda, [op.PostureTask("ready")], relax=["position"])
    state = op.State(q)
    for _ in range(50):
        step = controller.step(state, DT)
        state = step.state
        assert step.status == "tracking"
    assert state.q[0] < q[0]


def test_relaxation_follows_the_declared_order(panda):
    """Two walls that cannot both hold: the one that is named first gives way, and its slack says so."""
    up = op.HalfSpaceLimit(panda.tool_frame, normal=(0, 0, 1), offset=2.0)  # the tool two metres high
    state = op.State(panda.configurations["ready"], v=[0.3, 0.2, -0.2, 0.1, 0.1, 0.2, 0.0])
    slow = op.ToolSpeedLimit(linear=0.02)
    kept = {}
    for order in (("tool speed", "half-space"), ("half-space", "tool speed")):
        limits = [op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit(), up, slow]
        controller = op.Controller(panda, [op.DampingTask()], limits=limits, relax=order)
        moving, speeds, given_up = state, [], set()
        for k in range(120):
            step = controller.step(moving, DT)
            moving = step.state
            given_up |= step.slack.keys()
            twist = controller.configuration(moving).jacobian(panda.frame_id(panda.tool_frame)) @ moving.v
            if k >= 60:
                speeds.append(float(np.linalg.norm(twist[:3])))
        kept[order[0]] = max(speeds), given_up
    assert kept["half-space"][0] <= 0.02 + 1e-4
    assert "half-space" in kept["half-space"][1]
    assert kept["tool speed"][0] > 0.05
    assert "tool speed" in kept["tool speed"][1]


SINGULAR = {
    "srra": {"wrist": [0.4, 0.3, 0.5, 0.2, 0.0, 0.3], "elbow": [0.4, 0.3, -np.pi / 2, 0.2, 0.6, 0.3]},
    "puma560": {"wrist": [0.4, -0.8, 0.5, 0.2, 0.0, 0.3]},
    "ur5": {"wrist": [0.4, -1.2, 1.3, -0.9, 0.0, 0.3], "elbow": [0.4, -1.2, 0.0, -0.9, 1.2, 0.3]},
}


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name, kinds in SINGULAR.items() for kind in kinds])
def test_through_singularities(name, kind):
    """A line of the tool through a singular configuration at 0.1 m/s: bounded error, joints within limits."""
    robot = op.load_robot(name)
    task = op.PoseTask(robot.tool_frame)
    controller = op.Controller(robot, [task])
    middle = controller.configuration(op.State(SINGULAR[name][kind])).pose(robot.frame_id(robot.tool_frame))
    X, along = pin.SE3(middle), np.array([0.06, 0.08, 0.0])
    start = np.array(SINGULAR[name][kind])
    start[4] += 0.15
    state = op.State(np.clip(start, robot.limits.lower, robot.limits.upper))
    errors = []
    for k in range(2200):
        s = min(1.0, k * 0.004 / 6.0) - 0.5
        twist = [*(along / 3.0), 0, 0, 0] if s < 0.5 else None
        task.set_target(pin.SE3(X.rotation, X.translation + 2.0 * s * along), twist)
        state = controller.step(state, 0.004).state
        errors.append(np.linalg.norm(task.error(controller.configuration(state))))
        assert (np.abs(state.v) <= robot.limits.velocity + 1e-9).all()
    assert max(errors[500:]) < 0.6
    assert errors[-1] < 0.05


TURNING = op.Scene([op.Box("paddle", (0.1, 0.1, 0.1), (2, 0, 0)).moving(turn={"axis": [0, 0, 1], "angle": [0, 1]})])


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda r: op.Controller(r, [op.PoseTask("gripper")]), ["PoseTask", "frame", "gripper", "panda_hand_tcp"]),
        (lambda r: op.Controller(r, [op.PostureTask([0, 0])]), ["PostureTask", "target", "7"]),
        (lambda r: op.Controller(r, [op.PostureTask("redy")]), ["PostureTask", "target", "ready"]),
        (lambda r: op.Controller(r, [op.JointCouplingTask([[1, 2]])]), ["JointCouplingTask", "A", "7"]),
        (lambda r: op.Controller(r, ["pose"]), ["Controller", "tasks[0]", "pose"]),
        (lambda r: op.Controller(r, [], limits=[3]), ["Controller", "limits[0]"]),
        (lambda r: op.Controller(r, [], solver="simplex"), ["solver", "simplex", "proxqp"]),
        (lambda r: op.Controller(r, [], form="torque"), ["form", "torque", "acceleration"]),
        (lambda r: op.Controller(r, [], damping=0.0), ["damping", "0.0"]),
        (lambda r: op.Controller(r, [], relax=["speed"]), ["relax", "speed", "clearance"]),
        (lambda r: op.PoseTask("x", position_cost=-1.0), ["position_cost", "-1"]),
        (lambda r: op.PoseTask("x", gain=float("nan")), ["gain", "nan"]),
        (lambda r: setattr(op.PoseTask("x"), "gain", np.nan), ["PoseTask", "gain", "nan"]),
        (lambda r: setattr(op.PoseTask("x"), "twist", np.full(6, np.nan)), ["PoseTask", "twist[0]", "nan"]),
        (lambda r: setattr(op.PoseTask("x"), "acceleration", np.zeros(3)), ["PoseTask", "acceleration", "6"]),
        (lambda r: op.PoseTask("x", np.full((4, 4), np.nan)), ["target"]),
        (lambda r: op.PoseTask("x", pin.SE3(np.eye(3), np.full(3, np.nan))), ["target", "NaN"]),
        (lambda r: op.PositionTask("x", [0.0, np.inf, 0.0]), ["target"]),
        (lambda r: op.LookAtTask("x", [0, 0, 0], axis=(0, 0, 0)), ["axis", "length 0"]),
        (lambda r: op.Controller(r, [op.BaseMotionTask()]), ["joints"]),
        (lambda r: op.Controller(r, [op.BaseMotionTask(joints=5)]), ["BaseMotionTask", "joints", "5", "panda_joint1"]),
        (lambda r: op.Controller(r, [op.BaseMotionTask(joints=["panda_joint1"] * 3)]), ["joints", "panda_joint1"]),
        (lambda r: op.JointCouplingTask([[10**400] * 7]), ["JointCouplingTask", "A"]),
        (lambda r: op.Controller(r, [op.PoseTask(None)]), ["PoseTask", "frame", "None", "panda_hand_tcp"]),
        (lambda r: op.Controller(r, [op.ManipulabilityTask(0.1, frame=7)]), ["ManipulabilityTask", "frame", "7"]),
        (lambda r: op.Controller(r, [], limits=[op.HalfSpaceLimit(7, (0, 0, 1), 0.0)]), ["HalfSpaceLimit", "frame"]),
        (lambda r: op.Controller(r, [], limits=[op.WheelSpeedLimit(3.0)]), ["WheelSpeedLimit", "panda"]),
        (lambda r: op.Controller(r, [], limits=[op.VelocityLimit([1, 2])]), ["velocity", "7"]),
        (lambda r: op.Controller(r, [], limits=[op.PositionLimit(1.0, -1.0)]), ["lower[0]", "1"]),
        (lambda r: op.Controller(r, [], limits=[op.JerkLimit(), op.JerkLimit(9.0)]), ["limits[1]", "second", "jerk"]),
        (lambda r: op.Controller(r, [], limits=[op.PositionLimit()] * 2), ["limits[1]", "second", "position"]),
        (lambda r: op.ToolSpeedLimit(), ["linear"]),
        (lambda r: op.ToolSpeedLimit(linear=-1.0), ["linear", "-1"]),
        (lambda r: op.HalfSpaceLimit("x", (0, 0, 0), 0.0), ["normal"]),
        (lambda r: op.HalfSpaceLimit("x", (0, 0, 1), np.nan), ["offset", "nan"]),
        (lambda r: op.ClearanceLimit("scene"), ["scene"]),
        (lambda r: op.Controller(r, [], scene=TURNING), ["ClearanceLimit", "scene", "'paddle'", "slide"]),
        (lambda r: op.ManipulabilityTask(0.1, part="tool"), ["ManipulabilityTask", "part", "tool", "translation"]),
        (lambda r: op.PostureTask(cost=-1.0), ["PostureTask", "cost[0]", "-1"]),
        (lambda r: op.State([0.0, np.nan]), ["State", "q[1]", "nan"]),
        (lambda r: op.State([0.0, 1.0], v=[1.0]), ["State", "v", "2"]),
        (lambda r: op.Controller(r, []).step(op.State([0.0]), 0.01), ["state.q", "1 joints", "7"]),
        (lambda r: op.Controller(r, []).step(op.State(np.zeros(7)), 0.0), ["dt", "0.0"]),
        (lambda r: op.Controller(r, []).step(op.State(np.zeros(7)), np.nan), ["dt", "nan"]),
        (lambda r: op.Controller(r, []).step(np.zeros(7), 0.01), ["state", "op.State"]),
        (lambda r: op.Controller(r, []).step(op.State.of(np.full(7, np.inf), *np.zeros((2, 7))), 1e-3), ["state.q[0]"]),
    ],
)
def test_wrong_input_names_field_and_value(panda, build, words):
    with pytest.raises(op.InputError) as error:
        build(panda)
    assert all(word in str(error.value) for word in words), str(error.value)


def random_programs(count, n=7, m=6):
    rng = np.random.default_rng(0)
    for _ in range(count):
        A = rng.normal(size=(n, n))
        C, x = rng.normal(size=(m, n)), rng.uniform(-0.5, 0.5, n)
        low = np.where(rng.random(m) < 0.5, -np.inf, C @ x - rng.random(m))
        box = np.minimum(x, -rng.random(n)), np.maximum(x, rng.random(n))
        yield Program(A.T @ A + 1e-3 * np.eye(n), 5 * rng.normal(size=n), C, low, C @ x + rng.random(m), box, *NONE), x


NONE = np.zeros((0, 7)), np.zeros(0)


def test_solvers_agree():
    """proxsuite, whatever else there is through qpsolvers, and the guess of active limits: one solution."""
    prox, others = ProxQp(), [QpSolvers(name) for name in ("proxqp", "piqp")]
    guessed = 0
    for program, _ in random_programs(60):
        x = prox.solve(program)
        assert program.infeasibility(x) < 1e-6
        for other in others:
            assert program.value(other.solve(program)) == pytest.approx(program.value(x), abs=1e-3)
        found = solve_from(program, active_at(program, x, 1e-6))
        if found is not None:
            guessed += 1
            assert found[0] == pytest.approx(x, abs=1e-6)
    assert guessed > 30


@pytest.mark.parametrize("solver", ["proxqp", "piqp"])
def test_answers_do_not_depend_on_the_solver(panda, solver):
    ends = []
    for choice in ("native", solver):
        tool = reach(panda, position=(0.5, 0.3, 0.4), rpy=(3.14, 0, 0))
        controller = op.Controller(panda, [tool, op.PostureTask("ready")], solver=choice)
        state = op.State(panda.configurations["ready"])
        for _ in range(100):
            state = controller.step(state, 0.004).state
        ends.append(state.q)
    assert ends[0] == pytest.approx(ends[1], abs=1e-5)


@pytest.mark.parametrize(("solver", "found"), [("native", {"active set", "unconstrained"}), ("proxqp", {"proxqp"})])
def test_the_solver_that_is_named_answers(panda, solver, found):
    tool = reach(panda, position=(0.5, 0.3, 0.4), rpy=(3.14, 0, 0))
    controller, state = op.Controller(panda, [tool], solver=solver), op.State(panda.configurations["ready"])
    told = set()
    for _ in range(30):
        step = controller.step(state, 0.004)
        state = step.state
        told.add(step.solver)
    assert told <= found


def test_a_guess_is_deprecated(panda):
    with pytest.warns(DeprecationWarning, match="guess is deprecated"):
        op.Controller(panda, [], guess=True)


def test_where_no_way_leads_out_the_step_says_what_stands_in_the_way_and_what_was_tried(panda):
    """A thin wall through the hand: whichever way it goes, another body comes nearer."""
    ready = panda.configurations["ready"]
    hand = op.Controller(panda, []).configuration(op.State(ready)).pose(panda.frame_id("panda_hand")).translation
    wall = op.Box("wall", size=(0.002, 0.6, 0.6), position=tuple(hand))
    controller = op.Controller(panda, [op.PostureTask("ready")], scene=op.Scene([wall]))
    state = op.State(ready)
    for _ in range(20):
        step = controller.step(state, DT)
        state = step.state
    assert step.status == "stopped"
    assert "'wall'" in step.reason
    assert "mm apart" in step.reason
    assert "straight away from all of these, from panda_" in step.reason


def test_from_a_ball_that_both_fingers_touch_it_leaves(panda):
    ready = panda.configurations["ready"]
    tool = op.Controller(panda, []).configuration(op.State(ready)).pose(panda.frame_id(panda.tool_frame)).translation
    scene = op.Scene([op.Sphere("ball", radius=0.0385, position=tuple(tool))])
    check, state = CollisionModel(panda, scene), op.State(ready)
    depth = check.clearance(ready).distance
    assert depth < -0.001
    controller = op.Controller(panda, [op.PostureTask("ready")], scene=scene)
    for _ in range(300):
        state = controller.step(state, DT).state
    assert check.clearance(state.q).distance > depth + 0.001
