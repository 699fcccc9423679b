"""Chunks of set-points: what is sent is what the verifier accepts, and bad numbers end in a stop."""

import numpy as np
import pytest

import optiplan as op
from optiplan.execution.chunks.search import DISTANCES

DT = 0.02


@pytest.fixture(scope="module")
def problem():
    """A Panda between boxes."""
    boxes = [
        op.Box("left", size=(0.1, 0.1, 0.5), position=(0.29, 0.26, 0.4)),
        op.Box("right", size=(0.1, 0.1, 0.5), position=(0.29, -0.26, 0.4)),
        op.Sphere("ball", radius=0.08, position=(0.7, 0.0, 0.9)),
        op.Cylinder("post", radius=0.05, length=0.6, position=(-0.5, 0.2, 0.3)),
    ]
    return op.Problem("panda", "ready", "ready", boxes)


def reach(problem, by, count=25, dt=DT, start=None):
    """Set-points of a smooth motion from rest by these changes of joints, and their times."""
    s = np.arange(1, count + 1) / count
    first = problem.start if start is None else start
    return first + (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None] * np.array(by), dt * np.arange(1, count + 1)


def turn(angle):
    return [angle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def spin(angle):
    return [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, angle]


def is_verified(chunk):
    return op.verify(chunk.problem, chunk.trajectory).verified


def test_a_good_chunk_is_proved_as_it_is(problem):
    q, t = reach(problem, [0.2, 0.1, -0.1, 0.2, 0.1, 0.2, 0.3])
    found = op.certify(problem, q, t)
    assert found.outcome == "proved"
    assert found.is_proved
    assert found.reason == ""
    assert found.reached == len(q)
    assert found.until == t[-1]
    assert found.max_change == found.rms_change == 0.0
    np.testing.assert_allclose(found.trajectory(t), q, atol=1e-10)
    assert min(found.clearance) > 1e-3
    assert is_verified(found)
    assert "cubic spline" in found.scope[0]


def test_a_chunk_that_ends_in_motion_has_its_stop(problem):
    q, t = reach(problem, spin(0.4))
    found = op.certify(problem, q[:15], t[:15])
    assert found.outcome == "proved"
    assert found.trajectory.duration > found.until
    assert found.state(found.until).v[6] > 0.5
    np.testing.assert_allclose(found.state(99.0).v, 0.0, atol=1e-12)
    assert is_verified(found)


def test_the_next_chunk_begins_in_motion(problem):
    q, t = reach(problem, spin(0.4))
    first = op.certify(problem, q[:15], t[:15])
    now = first.state(0.2)
    second = op.certify(problem, q[10:], t[10:] - 0.2, start=now)
    assert second.outcome == "proved"
    begin = second.trajectory.state(0.0)
    np.testing.assert_allclose(begin.v, now.v, atol=1e-12)
    np.testing.assert_allclose(begin.a, now.a, atol=1e-9)
    assert is_verified(second)


def test_without_times_it_is_as_fast_as_the_limits_admit(problem):
    q, _ = reach(problem, spin(0.5))
    found = op.certify(problem, q)
    assert found.outcome == "proved"
    # 0.5 rad at 2.61 rad/s, and 0.13 s to speed up and to slow down
    assert 0.32 < found.trajectory.duration < 0.4
    np.testing.assert_allclose(found.trajectory(found.times), q, atol=1e-9)
    assert is_verified(found)
    twice = op.certify(problem, np.repeat(q, 2, axis=0))
    assert twice.trajectory.duration == found.trajectory.duration


def test_noise_is_taken_out_by_little(problem):
    rng = np.random.default_rng(1)
    q, t = reach(problem, turn(0.3))
    noisy = q + rng.normal(0.0, 2e-3, q.shape)
    found = op.certify(problem, noisy, t)
    assert found.outcome == "nearest"
    assert "rad/s" in found.reason
    assert 0.0 < found.rms_change <= found.max_change < 0.02
    np.testing.assert_allclose(found.change, np.linalg.norm(found.set_points - noisy, axis=1))
    np.testing.assert_allclose(found.trajectory(t), found.set_points, atol=1e-9)
    # the smooth motion is within the limits: none that is much farther away than it is nearest
    assert np.sum(found.change**2) <= 1.05 * np.sum((q - noisy) ** 2)
    assert is_verified(found)


def test_a_chunk_into_a_box_is_moved_out_of_it(problem):
    q, t = reach(problem, turn(0.4), 50)
    found = op.certify(problem, q, t)
    assert found.outcome == "nearest"
    assert "'panda_hand' and 'left' would touch" in found.reason
    assert found.max_change < 0.03
    assert is_verified(found)
    with_room = op.certify(problem, q, t, clearance=0.01)
    assert with_room.outcome == "nearest"
    assert 0.01 < with_room.clearance[1] < 0.01 + DISTANCES[-1]
    assert with_room.max_change > found.max_change
    assert is_verified(with_room)


def test_where_nothing_else_is_proved_the_robot_stops_on_the_chunk(problem):
    q, t = reach(problem, turn(0.2), 50)
    q[25:, 1] += 2.0  # a jump
    found = op.certify(problem, q, t)
    assert found.outcome == "stopped"
    assert 15 < found.reached < 25
    np.testing.assert_allclose(found.trajectory(t[: found.reached]), q[: found.reached], atol=1e-9)
    assert is_verified(found)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda q, t: q.__setitem__((3, 2), np.nan), "set-point 3 has nan for 'panda_joint3'"),
        (lambda q, t: q.__setitem__((3, 2), np.inf), "set-point 3 has inf"),
        (lambda q, t: t.__setitem__(4, np.nan), "set-point 4 is at time nan s, not from 0 to 100000 s"),
        (lambda q, t: t.__imul__(1e9), "set-point 0 is at time 20000000.0 s"),
        (lambda q, t: t.__setitem__(4, t[3]), "set-point 4 is at 0.08 s, not after set-point 3 at 0.08 s"),
        (lambda q, t: t.__setitem__(0, -1.0), "set-point 0 is at time -1.0 s"),
        (lambda q, t: q.__iadd__(2.0), "rad/s"),
        (lambda q, t: q.__imul__(1e200), "set-point 0 has"),
    ],
)
def test_wrong_numbers_end_in_a_stop(problem, change, reason):
    q, t = reach(problem, turn(0.3))
    change(q, t)
    found = op.certify(problem, q, t)
    assert found.outcome == "stopped"
    assert reason in found.reason
    assert is_verified(found)


def test_a_robot_in_motion_stops_at_once_or_goes_on(problem):
    q, t = reach(problem, spin(0.4))
    running = op.certify(problem, q[:15], t[:15])
    nothing = np.full((5, 7), np.nan)
    at_once = op.certify(problem, nothing, start=running.state(0.2))
    assert at_once.outcome == "stopped"
    assert 0.05 < at_once.trajectory.duration < 0.3
    assert is_verified(at_once)
    # A ball where the quick stop would end, but not where the motion that runs would.
    refused = op.certify(problem, nothing, start=op.State(problem.start, v=[0.0] * 6 + [3.0]))
    assert refused.outcome == "refused"
    assert refused.trajectory is None
    assert "no stop is proved" in refused.reason
    with pytest.raises(op.InputError, match=r"Chunk\.rest"):
        refused.rest(0.1)


def test_the_motion_that_runs_is_another_stop(problem):
    q, t = reach(problem, spin(0.4))
    running = op.certify(problem, q, t)
    rest = running.rest(0.2)
    assert rest.duration == pytest.approx(running.trajectory.duration - 0.2)
    # Limits that no stop at once keeps: the acceleration there is the limit of another robot.
    slow = problem.with_limits(acceleration=0.01)
    assert op.certify(slow, np.full((2, 7), np.nan), start=rest).outcome == "refused"
    after = op.certify(problem, q[12:], t[12:] - 0.2, start=rest)
    assert after.outcome == "proved"
    assert running.rest(99.0).duration < 1e-5


def test_a_set_point_at_time_zero_is_where_the_robot_is(problem):
    q, t = reach(problem, turn(0.3))
    q, t = np.vstack([problem.start, q]), np.append(0.0, t)
    assert op.certify(problem, q, t).outcome == "proved"
    q[0, 1] += 0.004
    found = op.certify(problem, q, t)
    assert found.outcome == "nearest"
    assert found.change[0] == pytest.approx(0.004)
    assert "set-point 0 is at time 0, but 'panda_joint2' is 0.004 rad away" in found.reason


def test_obstacles_stand_where_they_were_seen(problem):
    q, t = reach(problem, [0.0, 0.4, 0.0, 0.4, 0.0, 0.0, 0.0], 50)
    tool = problem.robot.fk(q[-1]).matrix[:3, 3]
    assert op.certify(problem, q, t).outcome == "proved"
    blocked = op.certify(problem, q, t, poses={"ball": op.Pose(tool)})
    assert blocked.outcome != "proved"
    assert "'ball'" in blocked.reason
    assert is_verified(blocked)
    assert op.certify(problem, q, t).outcome == "proved"  # back where the problem has it
    inside = op.certify(problem, q, t, poses={"ball": op.Pose((0.0, 0.0, 0.1))})
    assert inside.outcome == "refused"
    assert "'ball' stands in 'panda_link0'" in inside.reason


@pytest.mark.parametrize(
    ("arguments", "options", "what"),
    [
        (([[0.0, 1.0]],), {}, r"certify: q: .*\(1, 2\).*\(k, 7\)"),
        (([],), {}, "certify: q"),
        (("nonsense",), {}, "certify: q"),
        ((np.zeros((2, 7)), [0.1]), {}, r"certify: t: .*\(1,\).*\(2,\)"),
        ((np.zeros((2, 7)),), {"start": 3.0}, "certify: start"),
        ((np.zeros((2, 7)),), {"start": op.State([0.0, 0.0])}, "certify: start"),
        ((np.zeros((2, 7)),), {"poses": {"nobody": op.Pose((0, 0, 0))}}, "nobody.*left, right"),
        ((np.zeros((2, 7)),), {"poses": {"ball": 3}}, "certify: poses"),
        ((np.zeros((2, 7)),), {"clearance": -1.0}, "certify: clearance"),
    ],
)
def test_wrong_arguments_are_errors(problem, arguments, options, what):
    with pytest.raises(op.InputError, match=what):
        op.certify(problem, *arguments, **options)


def test_problems_that_the_proof_does_not_cover_are_errors():
    with pytest.raises(op.InputError, match="a problem with a task"):
        op.certify(op.load_problem("40_panda_sorts_cubes"), np.zeros((1, 7)))
    with pytest.raises(op.InputError, match="moves by the clock"):
        op.certify(op.load_problem("38_falling_ball"), np.zeros((1, 7)))
    with pytest.raises(op.InputError, match="path constraint"):
        op.certify(op.load_problem("39_cup_upright"), np.zeros((1, 7)))
    for parts, words in (({"tracking_error": 0.002}, "a `tracking_error`"), ({"clearance": 0.002}, "a `clearance`")):
        with pytest.raises(op.InputError, match=words):
            op.certify(op.load_problem("01_reach").with_parts(**parts), np.zeros((1, 7)))


def test_one_answer_does_not_depend_on_the_others(problem):
    rng = np.random.default_rng(4)
    q, t = reach(problem, turn(0.4), 50)
    first = op.certify(problem, q, t)
    assert first.outcome == "nearest"
    for _ in range(5):
        op.certify(problem, q + rng.normal(0.0, 0.05, q.shape), t, poses={"ball": op.Pose((0.6, 0.0, 0.5))})
    again = op.certify(problem, q, t)
    np.testing.assert_array_equal(first.trajectory.coefficients, again.trajectory.coefficients)
    assert first.clearance == again.clearance


def test_numbers_of_any_size_end_in_an_answer(problem):
    rng, running = np.random.default_rng(7), None
    for k in range(120):
        count = int(rng.integers(1, 8))
        q = problem.start + rng.normal(size=(count, 7)) * 10.0 ** rng.uniform(-9.0, 5.0)
        steps = 10.0 ** rng.uniform(-10.0, 3.0, count)
        t = (None, np.cumsum(steps), rng.uniform(-1.0, 3.0, count), steps[0] * np.arange(count))[k % 4]
        start = op.State(problem.start, *(rng.normal(size=7) * 10.0 ** rng.uniform(-12.0, 1.0) for _ in range(2)))
        if k % 3 == 0 and running is not None:
            start = running.rest(0.5 * running.trajectory.duration)
        found = op.certify(problem, q, t, start=start)
        if found.is_proved:
            running = found
            if k % 5 == 0:
                assert is_verified(found), found
