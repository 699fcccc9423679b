"""Every limit by simulation: what its rows say holds of the motion that comes out."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.control.limits.clearance import SAMPLES
from optiplan.control.limits.row_limit import LimitRows, RowLimit
from optiplan.kinematics.mecanum import wheel_matrix

DT = 0.002


def chase(robot, limits, seconds=2.0, seed=0, form="velocity", hold=0.4, dt=DT):
    """States of a robot after far targets that change before they are reached."""
    rng = np.random.default_rng(seed)
    tool = op.PoseTask(robot.tool_frame, gain=20.0)
    controller = op.Controller(robot, [tool, op.PostureTask(cost=1e-3)], limits=limits, form=form)
    state = op.State(next(iter(robot.configurations.values())))
    states, steps = [state], []
    for k in range(round(seconds / dt)):
        if k % round(hold / dt) == 0:
            tool.set_target(op.Pose(position=rng.uniform(-1.0, 1.0, 3), rpy=rng.uniform(-3.0, 3.0, 3)))
        steps.append(controller.step(state, dt))
        state = steps[-1].state
        states.append(state)
    return states, steps


def joints(*more):
    return [op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit(), *more]


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
@pytest.mark.parametrize("which", ["panda", "baxter", "delbot"])
def test_joint_limits_hold_exactly(which, form, request):
    robot = request.getfixturevalue(which)
    states, steps = chase(robot, joints(), form=form)
    q, v, a = (np.array([getattr(state, name) for state in states]) for name in "qva")
    limits = robot.limits
    assert (q >= limits.lower - 1e-8).all()
    assert (q <= limits.upper + 1e-8).all()
    assert (np.abs(v) <= limits.velocity + 1e-9).all()
    assert (np.abs(np.diff(v, axis=0)) / DT <= limits.acceleration + 1e-8).all()
    assert (np.abs(np.diff(a, axis=0)) / DT <= limits.jerk + 1e-6).all()
    assert (np.abs(v).max(axis=0) > 0.1 * limits.velocity).any(), "the limits were worth testing"
    assert not any(step.slack for step in steps)


def test_a_joint_stops_before_its_end_and_uses_its_room(panda):
    """Straight at the end of joint 1: it comes to rest there, having braked at its limit."""
    controller = op.Controller(panda, [op.PostureTask(panda.configurations["ready"] + [9, 0, 0, 0, 0, 0, 0], cost=1.0)])
    state, lowest = op.State(panda.configurations["ready"]), 0.0
    for _ in range(2500):
        state = controller.step(state, DT).state
        lowest = min(lowest, state.a[0])
        assert state.q[0] <= panda.limits.upper[0] + 1e-9
    assert state.q[0] == pytest.approx(panda.limits.upper[0], abs=1e-6)
    assert lowest < -0.95 * panda.limits.acceleration[0]


def test_tool_speed(panda):
    tool = panda.frame_id(panda.tool_frame)
    limit = op.ToolSpeedLimit(linear=0.25, angular=0.8)
    states, _ = chase(panda, joints(limit))
    c = op.Controller(panda, [])
    twists = np.array([c.configuration(state).jacobian(tool) @ state.v for state in states])
    linear, angular = np.linalg.norm(twists[:, :3], axis=1), np.linalg.norm(twists[:, 3:], axis=1)
    assert linear.max() < 0.25 * (1.0 + 1e-3)
    assert angular.max() < 0.8 * (1.0 + 1e-3)
    assert linear.max() > 0.22
    free, _ = chase(panda, joints())
    assert max(np.linalg.norm(c.configuration(s).jacobian(tool)[:3] @ s.v) for s in free) > 0.5


def test_wheel_speeds(delbot):
    rate = 12.0
    states, steps = chase(delbot, joints(op.WheelSpeedLimit(rate)), seconds=4.0, hold=2.0)
    rates = np.array([np.abs(wheel_matrix(delbot, state.q) @ state.v).max() for state in states[1:]])
    assert rates.max() <= rate + 1e-6
    assert rates.max() > 0.95 * rate
    assert sum(step.solver == "braking" for step in steps) < 60, "rows foresee nearly everything"


def test_torque(panda):
    """The torques of the motion itself, by inverse dynamics at the beginning of each step."""
    free, _ = chase(panda, joints(), form="acceleration")
    torque = np.maximum(0.8 * torques(panda, free).max(axis=0), 1.0)
    states, steps = chase(panda, joints(op.TorqueLimit(torque)), form="acceleration")
    held = np.array([not step.slack and step.solver != "braking" for step in steps])
    assert held.mean() > 0.9
    assert (torques(panda, states)[held] <= torque + 1e-5).all()


def torques(robot, states):
    c, found = op.Controller(robot, []), []
    for before, after in pairwise(states):
        M, h = c.configuration(before).dynamics()
        found.append(np.abs(M @ ((after.v - before.v) / DT) + h))
    return np.array(found)


WITHOUT_ACCELERATION = [op.PositionLimit(), op.VelocityLimit(), op.JerkLimit()]


@pytest.mark.parametrize(
    ("limits", "form"),
    [(joints(), "velocity"), (joints(), "acceleration"), (WITHOUT_ACCELERATION, "velocity")],
    ids=["velocity", "acceleration", "without a limit of acceleration"],
)
def test_half_space(panda, limits, form):
    """A wall at x = 0.45 m that the tool is sent through: it comes to it and never passes, however joints brake."""
    wall = op.HalfSpaceLimit(panda.tool_frame, normal=(-1, 0, 0), offset=-0.45)
    tool = op.PoseTask(panda.tool_frame, op.Pose(position=(0.7, 0.2, 0.5), rpy=(3.1, 0, 0)))
    controller = op.Controller(panda, [tool, op.PostureTask()], limits=[*limits, wall], form=form)
    state = op.State([0.0, -1.2, 0.0, -2.6, 0.0, 1.571, 0.785])
    c, x = op.Controller(panda, []), []
    for _ in range(900):
        state = controller.step(state, DT).state
        x.append(c.configuration(state).pose(panda.frame_id(panda.tool_frame)).translation[0])
    assert max(x) <= 0.45 + 1e-9
    assert x[-1] > 0.45 - 2e-3


POST = op.Box("post", size=(0.1, 0.1, 0.8), position=(0.45, 0.3, 0.4))


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_clearance_of_scene_and_self(panda, form):
    scene = op.Scene([POST])
    tool = op.PoseTask(panda.tool_frame)
    controller = op.Controller(panda, [tool, op.PostureTask("ready")], scene=scene, form=form)
    check, state = CollisionModel(panda, scene), op.State(panda.configurations["ready"])
    near = []
    for k in range(1200):
        if k % 300 == 0:
            y = 0.5 if (k // 300) % 2 == 0 else -0.1
            tool.set_target(op.Pose(position=(0.45, y, 0.4), rpy=(3.14, 0, 0)))
        step = controller.step(state, DT)
        state = step.state
        near.append(check.clearance(state.q).distance)
    assert min(near) >= 0.005 - 1e-6
    assert min(near) < 0.012, "it came near"
    assert step.nearest is not None


def test_the_nearest_bodies_are_told_whatever_they_are_called(panda):
    held = op.Box("nut and bolt", size=(0.04, 0.04, 0.1), position=(0, 0, 0.16)).attached_to("panda_hand", touch=HAND)
    scene = op.Scene([op.Box("salt and pepper", size=(0.05, 0.05, 0.1), position=(0.365, 0.0, 0.47))], attached=[held])
    state = op.State(panda.configurations["ready"])
    nearest = op.Controller(panda, [op.PostureTask("ready")], scene=scene).step(state, DT).nearest
    assert (nearest.a, nearest.b) == ("nut and bolt", "salt and pepper")
    assert nearest.distance == pytest.approx(CollisionModel(panda, scene).clearance(state.q).distance, abs=1e-9)


def test_clearance_of_what_is_held(panda):
    """A bar in the hand reaches the post long before the hand would."""
    bar = op.Box("bar", size=(0.04, 0.4, 0.04), position=(0, 0.15, 0.1)).attached_to("panda_hand", touch=HAND)
    scene = op.Scene([POST], attached=[bar])
    tool = op.PoseTask(panda.tool_frame, op.Pose(position=(0.45, 0.25, 0.4), rpy=(3.14, 0, 0)))
    controller = op.Controller(panda, [tool, op.PostureTask("ready")], scene=scene)
    check, state = CollisionModel(panda, scene), op.State(panda.configurations["ready"])
    near = []
    for _ in range(800):
        state = controller.step(state, DT).state
        near.append(check.clearance(state.q).distance)
    assert min(near) >= 0.005 - 1e-6
    assert min(near) < 0.01


HAND = ("panda_leftfinger", "panda_rightfinger", "panda_link7", "panda_link6")


def test_nothing_vibrates_at_an_obstacle(panda):
    """Pressed against the post for good, the arm comes to rest: no limit cycle of the rows."""
    scene = op.Scene([op.Box("block", size=(0.2, 0.2, 0.6), position=(0.45, 0.25, 0.3))])
    tool = op.PoseTask(panda.tool_frame, op.Pose(position=(0.45, 0.25, 0.3), rpy=(3.14, 0, 0)))
    controller = op.Controller(panda, [tool, op.PostureTask("ready")], scene=scene)
    state = op.State(panda.configurations["ready"])
    late = []
    for k in range(2500):
        step = controller.step(state, DT)
        state = step.state
        if k > 2000:
            late.append(np.abs(state.a).max())
    assert np.median(late) < 0.5
    assert step.solver != "braking"


def test_gradients_of_distances(panda, baxter):
    for robot in (panda, baxter):
        limit = op.ClearanceLimit(op.Scene([POST]), influence=0.3)
        limit.bind(robot)
        c = op.Controller(robot, [])
        q = next(iter(robot.configurations.values()))
        here = c.configuration(op.State(q))
        view = limit.view(here, None, 0.0)
        assert len(view.near) > 3
        h = 1e-6
        for j in range(robot.n):
            e = h * np.eye(robot.n)[j]
            up = limit.distances(c.configuration(op.State(q + e)), view.near)
            down = limit.distances(c.configuration(op.State(q - e)), view.near)
            right = np.abs((up - down) / (2 * h) - view.gradient[:, j]) < 1e-4
            assert right.mean() > 0.85, "but for parallel faces, where the distance has a kink"


def test_bounds_of_distances_are_bounds(panda):
    """What is not asked again is at least what the view says."""
    limit, rng = op.ClearanceLimit(op.Scene([POST])), np.random.default_rng(0)
    limit.bind(panda)
    c, q, view = op.Controller(panda, []), panda.configurations["ready"], None
    everything = np.arange(len(limit.labels))
    for _ in range(40):
        q = np.clip(q + rng.normal(0.0, 0.03, 7), panda.limits.lower, panda.limits.upper)
        view = limit.view(c.configuration(op.State(q)), view, 0.0)
        assert (limit.distances(c.configuration(op.State(q)), everything) >= view.bound - 1e-6).all()


@pytest.fixture
def near_neighbours(tmp_path):
    """A turning post on a base with a gap of 0.3 mm, an arm on the post, and a knob that turns off its middle."""

    def link(name, shape, at):
        return f'<link name="{name}"><collision><origin xyz="{at}"/><geometry>{shape}</geometry></collision></link>'

    def joint(name, parent, child, at, axis):
        limit = '<limit lower="-3" upper="3" velocity="2" effort="50"/>'
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/><axis xyz="{axis}"/>'
        return f'<joint name="{name}" type="revolute">{ends}{limit}</joint>'

    (tmp_path / "post.urdf").write_text(
        '<robot name="post">'
        + link("base", '<cylinder radius="0.1" length="0.1"/>', "0 0 0.05")
        + link("post", '<cylinder radius="0.06" length="0.3"/>', "0 0 0.15")
        + link("arm", '<box size="0.4 0.05 0.05"/>', "0.2 0 0")
        + joint("turn", "base", "post", "0 0 0.1003", "0 0 1")
        + joint("lift", "post", "arm", "0.1 0 0.25", "0 1 0")
        + "</robot>"
    )
    (tmp_path / "post.srdf").write_text('<robot name="post"/>')  # which excuses no pair
    (tmp_path / "robot.yaml").write_text(
        "version: 1\nname: post\nurdf: post.urdf\nsrdf: post.srdf\ngroup: [turn, lift]\ntool_frame: arm\n"
        "limits: {acceleration: 5, jerk: 100}\n"
    )
    return str(tmp_path / "robot.yaml")


def test_neighbours_that_are_nearer_than_asked_hold_nothing_up(near_neighbours):
    robot, limit = op.load_robot(near_neighbours), op.ClearanceLimit(op.Scene(), at_least=0.005)
    task = op.PostureTask([1.0, 0.3], cost=1.0, gain=4.0)
    controller = op.Controller(robot, [task], limits=joints(limit))
    assert limit.structure == {"base and post": pytest.approx(0.5 * 0.0003, rel=0.02)}
    state, statuses = op.State([0.0, 0.0]), set()
    for _ in range(1500):
        step = controller.step(state, DT)
        state = step.state
        statuses.add(step.status)
    assert "recovering" not in statuses
    np.testing.assert_allclose(state.q, [1.0, 0.3], atol=1e-3)


@pytest.fixture
def cam(tmp_path):
    """A disc that turns 0.3 mm beside where a wall begins; a bump of 0.35 mm stands where no sample looks."""
    samples = np.sort((0.5 * (5.0**0.5 - 1.0) * np.arange(1, SAMPLES + 1)) % 1.0)
    k = int(np.argmax(np.diff(samples)))
    bump = -3.0 + 6.0 * 0.5 * (samples[k] + samples[k + 1])
    angles = np.append(np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False), -bump)
    radii = np.append(np.full(720, 0.1), 0.10035)
    rim = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    points = np.concatenate([np.c_[rim, np.full(len(rim), z)] for z in (-0.01, 0.01)])
    trimesh.convex.convex_hull(points).export(tmp_path / "cam.stl")
    (tmp_path / "cam.urdf").write_text(
        '<robot name="cam"><link name="base"/><link name="cam"><collision><geometry><mesh filename="cam.stl"/>'
        '</geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="cam"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="50"/></joint></robot>'
    )
    (tmp_path / "robot.yaml").write_text(
        "version: 1\nname: cam\nurdf: cam.urdf\ngroup: [turn]\ntool_frame: cam\ncollision: mesh\n"
        "limits: {acceleration: 5, jerk: 100}\n"
    )
    return op.load_robot(str(tmp_path / "robot.yaml")), bump


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_a_pair_that_is_the_same_in_all_samples_by_chance_is_kept_apart(cam, form):
    robot, bump = cam
    scene = op.Scene([op.Box("wall", size=(0.1, 0.2, 0.2), position=(0.1503, 0, 0))])
    limit = op.ClearanceLimit(scene)
    controller = op.Controller(robot, [op.PostureTask([bump], cost=1.0)], limits=joints(limit), form=form)
    check, state, least = CollisionModel(robot, scene), op.State([bump - 0.3]), np.inf
    assert check.clearance(np.array([bump])).distance < 0.0, "there is something to run into"
    for k in range(1000):
        state = controller.step(state, DT).state
        if k % 4 == 0:
            least = min(least, check.clearance(state.q).distance)
    assert least >= 0.5 * 0.0003 - 1e-6
    assert abs(state.q[0] - bump) < 0.2, "it goes as far as it may"
    assert limit.structure == {"cam and wall": pytest.approx(0.5 * 0.0003, rel=0.02)}


def test_what_is_asked_of_a_pair_whose_distance_varies_is_what_it_can_keep(near_neighbours):
    limit = op.ClearanceLimit(op.Scene(), at_least=0.3)
    limit.bind(op.load_robot(near_neighbours))
    assert 0.0 < limit.structure["post and arm"] < 0.3
    assert limit.least.min() < 0.001


def test_a_pair_that_always_touches_is_an_error(panda):
    held = op.Box("block", size=(0.3, 0.3, 0.3), position=(0, 0, 0)).attached_to("panda_link4")
    with pytest.raises(op.InputError) as error:
        op.Controller(panda, [], scene=op.Scene(attached=[held]))
    assert "touch in every configuration" in str(error.value)
    assert "block" in str(error.value)


class SlowBase(RowLimit):
    """The first joint no faster than 0.05 rad/s."""

    name = "slow base"

    def rows(self, c, state, dt):
        G = np.zeros((1, len(state.v)))
        G[0, 0] = 1.0
        return LimitRows.normalised(G, np.array([-0.05]), np.array([0.05]), ("first joint",))


def test_a_limit_of_ones_own_is_kept_beside_those_of_the_core(panda):
    states, steps = chase(panda, [op.VelocityLimit(), SlowBase(), op.TorqueLimit(), op.ToolSpeedLimit(linear=1.0)], 0.6)
    speeds = np.abs([state.v[0] for state in states])
    assert 0.049 < speeds.max() < 0.05 + 1e-6
    assert any("slow base: first joint" in step.active for step in steps)
