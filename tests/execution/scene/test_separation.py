"""People beside a robot: the separation is kept at an outside check of what is commanded; without data it stops."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.collision.kept_models import collision_model
from optiplan.errors import InputError

DT, PERIOD, DELAY = 1e-3, 33, 50  # s; ticks between measurements, and until they arrive
RULE = op.Separation("person", reaction=0.1, intrusion=0.1, sensor_uncertainty=0.03, robot_uncertainty=0.005)
FAR = op.Pose((6.0, 0.0, 0.9))


@pytest.fixture(scope="module")
def run():
    """A reach of the Panda; the person is a cylinder far away."""
    reach = op.load_problem("01_reach")
    person = op.Cylinder("person", radius=0.3, length=1.8, position=(6.0, 0.0, 0.9))
    found = op.plan(reach.with_scene([*reach.scene.obstacles, person]), budget=3.0)
    assert found.verified
    return found


class Judge:
    """Distances of the robot's moving bodies from the person, by coal."""

    def __init__(self, run):
        self.model = collision_model(run.problem.robot, op.Scene([]))
        self.data, self.geometry = self.model.model.createData(), self.model.geometry
        self.placed = pin.GeometryData(self.geometry)
        self.bodies = [k for k, one in enumerate(self.geometry.geometryObjects) if one.parentJoint > 0]
        self.person = coal.Cylinder(0.3, 1.8)

    def distance(self, q, position):
        pin.updateGeometryPlacements(self.model.model, self.data, self.geometry, self.placed, q)
        there = coal.Transform3s(np.eye(3), np.asarray(position, float))
        found = []
        for k in self.bodies:
            X, shape = self.placed.oMg[k], self.geometry.geometryObjects[k].geometry
            here = coal.Transform3s(X.rotation, X.translation)
            found.append(coal.distance(shape, here, self.person, there, coal.DistanceRequest(), coal.DistanceResult()))
        return min(found)


def committed(executor, step=0.02):
    """Times from now, s, and configurations of what is commanded, until the robot stands still."""
    times, q = [], []
    while True:
        state = executor.state_in(step * len(times))
        if not state.v.any():
            return np.array(times), q
        times.append(step * len(times))
        q.append(state.q)


def drive(run, where, judge, ticks=4000, rule=RULE, noise=0.03, every=7):
    """Execute beside a person at `where(t)`; the least slack of v_h t + C at any time, and the executor."""
    executor, rng, least = op.Executor(run, separation=rule), np.random.default_rng(1), np.inf
    measured = {}
    for k in range(ticks):
        if k % PERIOD == 0:
            off = rng.normal(size=3)
            measured[k + DELAY] = where(k * DT) + noise * rng.uniform() * off / np.linalg.norm(off)
        if k in measured:
            executor.update_scene({"person": op.Pose(tuple(measured[k]))}, age=DELAY * DT)
        if k % every == 0:
            there = where(k * DT)
            for t, q in zip(*committed(executor), strict=True):
                least = min(least, judge.distance(q, there) - rule.human_speed * t - rule.intrusion)
        if executor.tick(DT).status.phase == "done":
            break
    return least, executor


def course(start, velocity):
    return lambda t: np.array(start) + t * np.array(velocity)


@pytest.mark.parametrize(
    ("start", "velocity"),
    [
        ((1.7, 0.0, 0.9), (-1.6, 0.0, 0.0)),
        ((1.1, 1.6, 0.9), (0.0, -1.6, 0.0)),
        ((1.15, 0.2, 0.9), (0.0, 0.0, 0.0)),
    ],
    ids=["towards", "past", "stands"],
)
def test_the_separation_is_kept_at_all_times(run, start, velocity):
    least, executor = drive(run, course(start, velocity), Judge(run))
    assert 0.0 <= least < 0.3  # kept, and made use of
    assert executor.time > run.duration + 0.1  # it was slowed down
    if any(velocity):
        assert executor.status.phase == "done"


def test_a_person_far_away_changes_nothing(run):
    executor = op.Executor(run, separation=RULE)
    assert executor.tick(DT).status.phase == "waiting"
    assert executor.status.reason == "no data about 'person' yet"
    while executor.status.phase != "done":
        if round(executor.time / DT) % PERIOD == 1:
            executor.update_scene({"person": FAR}, age=0.05)
            assert executor.status.reason == ""
        executor.tick(DT)
    assert executor.time < run.duration + 3 * DT


def test_without_data_the_robot_stops_by_itself(run):
    executor = op.Executor(run, separation=RULE)
    executor.update_scene({"person": FAR}, age=0.02)
    moved = []
    for _ in range(600):
        tick = executor.tick(DT)
        moved.append(tick.v.any())
    assert moved[70]
    assert not moved[-1]
    assert tick.status.phase == "waiting"
    assert "old" in tick.status.reason
    assert tick.status.place < run.duration
    executor.update_scene({"person": FAR}, age=0.2)  # too old to move
    assert not any(executor.tick(DT).v.any() for _ in range(50))
    executor.update_scene({"person": FAR})
    executor.tick(DT)
    assert executor.tick(DT).v.any()


def test_the_status_tells_what_is_asked_and_kept(run):
    executor, judge = op.Executor(run, separation=RULE), Judge(run)
    for k in range(300):
        if k % PERIOD == 0:
            executor.update_scene({"person": op.Pose((1.6, 0.0, 0.9))})
            kept = executor.status.separation
            assert kept.pair[0] == "person"
            assert kept.distance == 0.0 or kept.separation >= kept.distance >= RULE.margin
            true = judge.distance(executor.state_in(0.0).q, (1.6, 0.0, 0.9))
            assert true - 0.01 <= kept.separation <= true + 1e-6
        executor.tick(DT)
    assert kept.allowed > 0.0


def test_a_person_too_near_is_a_stop_and_who_leaves_lets_it_go_on(run):
    executor = op.Executor(run, separation=RULE)
    for k in range(250):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        executor.tick(DT)
    near = op.Pose((0.75, 0.0, 0.9))
    for k in range(400):
        if k % PERIOD == 0:
            executor.update_scene({"person": near})
            if k == 0:
                assert "too late" in executor.status.reason
        executor.tick(DT)
    assert executor.status.phase == "waiting"
    assert executor.status.separation.distance == 0.0
    assert "'person' is" in executor.status.reason
    for k in range(1500):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        executor.tick(DT)
    assert executor.status.phase == "done"


def test_pause_and_the_way_back_hold_beside_people(run):
    executor = op.Executor(run, separation=RULE)
    phases = set()
    for k in range(2500):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        if k == 200:
            executor.pause()
        if k == 500:
            assert executor.status.phase == "paused"
            executor.reverse()
        phases.add(executor.tick(DT).status.phase)
    assert executor.status.place == 0.0
    assert executor.status.phase in ("paused", "waiting")
    executor.resume()
    for k in range(1200):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        executor.tick(DT)
    assert executor.status.phase == "done"


def test_another_motion_takes_over_at_rest_only(run):
    executor = op.Executor(run, separation=RULE)
    executor.update_scene({"person": FAR})
    for _ in range(50):
        executor.tick(DT)
    executor.state_in(0.0)
    assert not executor.splice(run)
    assert "stands still" in executor.status.reason


def test_a_robot_that_stands_still_goes_on_with_another_motion(run):
    back = run.problem.with_start(run.trajectory.end).with_goal(op.JointGoal(run.trajectory.start))
    second = op.plan(back, budget=2.0)
    executor = op.Executor(run, separation=RULE)
    for k in range(900):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        executor.tick(DT)
    assert executor.status.phase == "done"
    executor.state_in(0.0)
    assert executor.splice(second)
    executor.tick(DT)  # it is told where people are already
    assert executor.status.separation.allowed == 1.0
    for k in range(1200):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        tick = executor.tick(DT)
    assert tick.status.phase == "done"
    np.testing.assert_allclose(tick.q, second.trajectory.end, atol=1e-12)


@pytest.mark.parametrize(
    ("update", "words"),
    [
        (({"person": FAR}, {"person": (1.0, 0.0, 0.0)}), "course of people"),
        (({"person": FAR}, None, 0.0, -1.0), "age"),
        (({"person": FAR}, None, 0.0, np.nan), "age"),
    ],
)
def test_updates_that_cannot_be_used_end_in_a_stop(run, update, words):
    executor = op.Executor(run, separation=RULE)
    executor.update_scene({"person": FAR})
    for _ in range(50):
        executor.tick(DT)
    executor.update_scene(*update)
    assert words in executor.status.reason
    assert executor.status.phase == "stopping"


def test_older_data_do_not_replace_newer_ones(run):
    executor = op.Executor(run, separation=RULE)
    executor.update_scene({"person": FAR}, age=0.01)
    executor.update_scene({"person": op.Pose((0.7, 0.0, 0.9))}, age=0.05)
    assert executor.status.separation.separation > 2.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"people": ()}, "names"),
        ({"people": 3}, "names"),
        ({"reaction": 0.0}, "reaction"),
        ({"intrusion": -0.1}, "intrusion"),
        ({"human_speed": np.nan}, "human_speed"),
    ],
)
def test_rules_that_cannot_be_are_errors(change, words):
    values = {"people": "person", "reaction": 0.1, "intrusion": 0.1, "sensor_uncertainty": 0.0}
    with pytest.raises(InputError, match=words):
        op.Separation(**{**values, "robot_uncertainty": 0.0, **change})


def test_people_that_nobody_knew_come_and_go(run):
    executor = op.Executor(run, separation=op.Separation(("one", "other"), 0.1, 0.1, 0.0, 0.0))
    executor.update_scene({"one": op.Capsule("one", radius=0.2, length=1.2, position=(0.7, 0.0, 0.8))})
    assert executor.tick(DT).status.reason == "no data about 'other' yet"
    executor.update_scene({"other": None})
    kept = executor.status.separation
    assert (kept.pair[0], kept.distance, kept.allowed) == ("one", 0.0, 0.0)
    assert executor.status.phase == "waiting"
    executor.update_scene({"one": None})
    assert executor.status.separation is None
    moved = [executor.tick(DT).v.any() for _ in range(500)]
    assert any(moved)
    assert not moved[-1]  # who is not there may come
    assert "the last data about" in executor.status.reason
    executor.update_scene({"one": op.Pose((0.7, 0.0, 0.8)), "other": None})  # its shape is known by now
    assert executor.status.separation.pair[0] == "one"


def test_an_executor_takes_what_can_be_kept(run):
    with pytest.raises(InputError, match=r"op\.Separation"):
        op.Executor(run, separation=0.5)
    with pytest.raises(InputError, match="replan"):
        op.Executor(run, separation=RULE, policy="replan")


def test_carts_are_waited_for_beside_people(run):
    executor = op.Executor(run, separation=RULE, clearance=0.01)
    ahead = run.problem.robot.fk(run.trajectory(0.7 * run.duration)).matrix[:3, 3]
    cart = op.Sphere("cart", radius=0.06, position=tuple(ahead))
    for k in range(800):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR, "cart": cart})
        executor.tick(DT)
    assert executor.status.phase == "waiting"
    assert "'cart'" in executor.status.reason
    executor.update_scene({"cart": None})
    for k in range(1500):
        if k % PERIOD == 0:
            executor.update_scene({"person": FAR})
        executor.tick(DT)
    assert executor.status.phase == "done"
