"""Laws along a motion: the composed motion keeps every limit, by exact extrema and by the verifier's torques."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.execution.paths.path_laws import Load, PathLaws, PathPlace, _curvature, reversed_motion
from optiplan.problem.problem import derived
from optiplan.trajectory import polynomial
from optiplan.trajectory.timing.compose import compose
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.torque import bounds_of, torque
from optiplan.verify.report import VerifyPolicy


def laws_of(run):
    return PathLaws(run.trajectory, run.problem.limits, [Load(0.0, run.duration, run.problem.robot)])


def composed(run, law):
    """The exact motion of a law until it is steady or the path ends."""
    rows = law.pieces()
    end = law.settled
    if law.at(end)[0] >= run.duration:  # rounding must not lead beyond the path
        end -= 1e-7
    inside = rows[:, 0] < end
    breakpoints = np.append(rows[inside, 0], end) - rows[0, 0]
    coefficients = rows[inside, 1:] / np.array([1.0, 1.0, 2.0, 6.0])
    return compose(run.trajectory, Trajectory(("s",), breakpoints, coefficients[:, :, None]))


@pytest.mark.parametrize("name", ["01_reach", "09_ur5", "12_planar", "15_srra", "22_via_spline"])
def test_the_motion_of_every_law_keeps_the_limits(run_of, name):
    run = run_of(name)
    laws, rng = laws_of(run), np.random.default_rng(3)
    problem = derived(run.problem, task=(), path_constraints=())
    for place in rng.uniform(0.0, 0.9 * run.duration, 12):
        first = laws.change(PathPlace(place, 1.0, 0.0), 0.0, float(rng.choice([0.0, 0.2, 0.6])))
        assert first is not None
        between = float(rng.uniform(0.0, first.settled))
        then = laws.change(PathPlace(*first.at(between)), between, float(rng.choice([0.0, 1.0])))
        for law in (first, then):
            if law is None or law.settled <= law.pieces()[0, 0]:
                continue
            motion = composed(run, law)
            for order, limit in zip((1, 2, 3), run.problem.limits.rates, strict=True):
                low, high = motion.extrema(order)
                assert (np.maximum(-low, high) <= limit * (1.0 + 2e-6)).all(), (place, order)
            loose = replace(VerifyPolicy(), limit_tolerance=2e-6)
            assert torque(problem, motion, loose).passed


def test_a_law_leads_to_its_speed_or_to_the_end(run_of):
    run = run_of("01_reach")
    laws = laws_of(run)
    for target in (0.0, 0.25, 0.7):
        law = laws.change(PathPlace(0.1, 1.0, 0.0), 5.0, target)
        s, speed, acceleration = law.at(law.settled)
        assert s < run.duration
        assert (speed, acceleration) == (target, 0.0)
        assert law.pieces()[0].tolist()[:4] == [5.0, 0.1, 1.0, 0.0]
    late = laws.change(PathPlace(0.97 * run.duration, 1.0, 0.0), 0.0, 0.0)  # it stops at the end anyway
    assert late is None or late.at(late.settled)[0] <= run.duration


@pytest.mark.parametrize("name", ["01_reach", "09_ur5"])
def test_a_law_for_a_while_and_then_the_stop_is_one_law_within_the_limits(run_of, name):
    run = run_of(name)
    laws, rng = laws_of(run), np.random.default_rng(5)
    for place in rng.uniform(0.05, 0.8 * run.duration, 8):
        law = laws.change(PathPlace(place, 1.0, 0.0), 3.0, float(rng.uniform()))
        t = 3.0 + float(rng.uniform(0.0, 0.1))
        both = laws.then_stop(law, t)
        for before in np.linspace(3.0, t, 5):
            assert both.at(before) == law.at(before)
        assert both.target == 0.0 or both.at(both.settled)[0] >= run.duration
        rows = both.pieces()
        assert (np.diff(rows[:, 0]) > 0.0).all()
        if law.settled == 3.0:
            continue
        motion = composed(run, both)
        for order, limit in zip((1, 2, 3), run.problem.limits.rates, strict=True):
            low, high = motion.extrema(order)
            assert (np.maximum(-low, high) <= limit * (1.0 + 2e-6)).all()
        problem = derived(run.problem, task=(), path_constraints=())
        assert torque(problem, motion, replace(VerifyPolicy(), limit_tolerance=2e-6)).passed


def test_who_has_arrived_stands_still_without_a_stop(run_of):
    run = run_of("01_reach")
    laws = laws_of(run)
    law = laws.steady(0.99 * run.duration, 1.0, 0.0)
    assert laws.then_stop(law, run.duration) is law


def test_set_points_are_on_the_path(run_of):
    run = run_of("01_reach")
    laws = laws_of(run)
    law = laws.change(PathPlace(0.2, 1.0, 0.0), 0.0, 0.3)
    for t in np.linspace(0.0, law.settled, 7):
        point = laws.set_point(law, float(t))
        s, speed, acceleration = point.place
        p = [run.trajectory(s, order) for order in range(3)]
        np.testing.assert_allclose(point.q, p[0], atol=1e-12)
        np.testing.assert_allclose(point.v, p[1] * speed, atol=1e-12)
        np.testing.assert_allclose(point.a, p[2] * speed**2 + p[1] * acceleration, atol=1e-10)
        model = run.problem.robot.model
        expected = pin.rnea(model, model.createData(), point.q, point.v, point.a)
        np.testing.assert_allclose(point.torque, expected, atol=1e-9)


def test_the_way_back_is_the_same_path(run_of):
    motion = run_of("09_ur5").trajectory
    laws, T = laws_of(run_of("09_ur5")), motion.duration
    back = laws.mirrored().until(0.9 * T)
    for s in np.linspace(0.0, 0.85 * T, 20):
        point = back.set_point(back.steady(s, 0.5, 0.0), 0.0)
        for found, order, factor in ((point.q, 0, 1.0), (point.v, 1, -0.5), (point.a, 2, 0.25)):
            np.testing.assert_allclose(found, factor * motion(T - s, order), atol=1e-8)
    assert (back.length, back.set_point(back.steady(0.95 * T, 0.5, 0.0), 0.0).place) == (0.9 * T, (0.9 * T, 0.0, 0.0))


@pytest.mark.parametrize("name", ["01_reach", "15_srra"])
def test_laws_of_the_way_back_are_those_of_the_reversed_motion(run_of, name):
    run = run_of(name)
    c = polynomial.shifted(run.trajectory.coefficients[::-1], run.trajectory.widths[::-1])
    c *= (-1.0) ** np.arange(c.shape[1])[:, None]
    breakpoints = np.append(0.0, run.duration - run.trajectory.breakpoints[-2::-1])
    reversed_run = replace(run, trajectory=replace(run.trajectory, breakpoints=breakpoints, coefficients=c))
    back, again = laws_of(run).mirrored(), laws_of(reversed_run)
    for place in np.linspace(0.1, 0.8 * run.duration, 7):
        laws = [one.change(PathPlace(float(place), 1.0, 0.0), 0.0, 0.0) for one in (back, again)]
        assert laws[0].settled == pytest.approx(laws[1].settled, rel=0.1)
        motion = composed(reversed_run, laws[0])
        for order, limit in zip((1, 2, 3), run.problem.limits.rates, strict=True):
            low, high = motion.extrema(order)
            assert (np.maximum(-low, high) <= limit * (1.0 + 2e-6)).all()
        loose = replace(VerifyPolicy(), limit_tolerance=2e-6)
        assert torque(derived(run.problem, task=(), path_constraints=()), motion, loose).passed


def test_where_gravity_takes_more_than_allowed(run_of):
    run = run_of("01_reach")
    weak = replace(run.problem.limits, torque=0.3 * run.problem.limits.torque)
    s = PathLaws(run.trajectory, weak, [Load(0.0, run.duration, run.problem.robot)]).overloaded
    assert s is not None
    robot, still = run.problem.robot, np.zeros(run.trajectory.n)

    def gravity(at):
        model = robot.model
        return np.abs(pin.rnea(model, model.createData(), run.trajectory(at), still, still))

    assert all((gravity(at) <= weak.torque).all() for at in np.linspace(0.0, s, 50)[:-1])
    assert any((gravity(at) > 0.999 * weak.torque).any() for at in np.linspace(s, min(s + 0.01, run.duration), 50))
    assert laws_of(run).overloaded is None


def test_the_curvature_of_torques_adds_up_from_its_factors(run_of):
    motion, robot = run_of("01_reach").trajectory, run_of("01_reach").problem.robot
    sizes = np.random.default_rng(5).uniform(0.1, 3.0, (5, 1, motion.n))
    factors = _curvature(sizes, 1.0, [Load(0.0, 1.0, robot)])[0]
    for c2, c3 in ((0.0, 0.0), (3.0, 50.0), (17.0, 2000.0)):
        q, first, second, third, fourth = sizes
        rates = [q, first, second + first * c2, third + 3.0 * second * c2 + first * c3]
        rates.append(fourth + 6.0 * third * c2 + 3.0 * second * c2**2 + 4.0 * second * c3)
        expected = bounds_of(robot).over(np.array(rates))[1][0]
        np.testing.assert_allclose(np.array([1.0, c2, c2**2, c3]) @ factors, expected, rtol=1e-7)


def test_a_change_begins_as_soon_as_limits_leave_room(run_of):
    run = run_of("09_ur5")
    laws, waited = laws_of(run), 0
    for place in np.linspace(0.0, 0.7 * run.duration, 30):
        first = laws.change(PathPlace(float(place), 1.0, 0.0), 0.0, 0.3)
        for t in np.linspace(0.0, first.settled, 30)[:-1]:
            if laws.change(PathPlace(*first.at(t)), float(t), 0.0) is None:
                law, waited = laws.change_along(first, float(t), 0.0), waited + 1
                assert law.at(t) == pytest.approx(first.at(t), abs=1e-12)
                assert law.target == 0.0 or law.at(law.settled)[0] >= run.duration
                assert law.pieces()[0].tolist() in first.pieces().tolist()
                assert law.pieces()[1:, 0].tolist() == sorted(law.pieces()[1:, 0])
    assert waited > 0


def test_a_motion_whose_first_piece_is_shorter_than_rounding_is_reversed(run_of):
    """T - 1e-17 is T: of such a piece nothing is left."""
    motion = run_of("01_reach").trajectory
    cut = Trajectory(
        motion.joint_names,
        np.insert(motion.breakpoints, 1, 1e-17),
        np.insert(motion.coefficients, 0, motion.coefficients[0], axis=0),
    )
    back = reversed_motion(cut)
    t = np.linspace(0.0, motion.duration, 50)
    np.testing.assert_allclose(back(motion.duration - t), motion(t), atol=1e-9)
