"""Laws along a motion: the composed motion keeps every limit, by exact extrema and by the verifier's torques."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.execution.path_laws import Load, PathLaws, PathPlace, reversed_motion
from optiplan.problem.problem import derived
from optiplan.trajectory.timing.compose import compose
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.torque import torque
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
    back = reversed_motion(motion)
    t = np.linspace(0.0, motion.duration, 50)
    for order, sign in ((0, 1.0), (1, -1.0), (2, 1.0)):
        np.testing.assert_allclose(back(t, order), sign * motion(motion.duration - t, order)[:], atol=1e-8)


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
