"""References: their rates are the derivatives of their poses and positions."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.planners.cartesian.tool_path import arc, circle, circle_through, line, screw
from optiplan.simulation.references.joints import StepReference, TrajectoryReference
from optiplan.simulation.references.tool import MovingTarget, PathReference, RecordedPath
from tests.simulation.conftest import swing

H = 1e-5
A = pin.SE3(pin.rpy.rpyToMatrix(0.2, -0.3, 0.4), np.array([0.4, 0.1, 0.5]))
B = pin.SE3(pin.rpy.rpyToMatrix(-0.5, 0.6, 1.4), np.array([0.1, 0.5, 0.7]))


def recorded():
    t = np.array([0.0, 0.7, 1.5, 2.0])
    poses = [pin.SE3.Interpolate(A, B, u) for u in (0.0, 0.3, 0.5, 1.0)]
    quaternions = np.array([pin.Quaternion(X.rotation).coeffs() for X in poses])
    return RecordedPath("tool", t, np.array([X.translation for X in poses]), quaternions)


REFERENCES = {
    "line": PathReference("tool", line(A, B), 2.0),
    "screw": PathReference("tool", screw(A, B), 2.0),
    "arc": PathReference(
        "tool", arc(A, B, *circle_through(A.translation, np.array([0.4, 0.4, 0.5]), B.translation)), 2.0
    ),
    "circle": PathReference(
        "tool", circle(A, np.array([0.3, 0.1, 0.5]), np.array([0.0, 0, 6.0]), np.array([0, 0, 6.0])), 2.0
    ),
    "moving": MovingTarget(
        "tool", A, np.array([0.1, 0.2, 0.05]), np.array([0.5, 1.0, 2.0]), 2.0, np.array([0, 1.0, 2.0])
    ),
    "recorded": recorded(),
}


@pytest.mark.parametrize("name", REFERENCES)
@pytest.mark.parametrize("t", [0.3, 0.7 + 1e-3, 1.2, 1.83])
def test_twist_and_acceleration_are_the_rates_of_the_pose(name, t):
    reference = REFERENCES[name]
    before, now, after = (reference.at(t + d) for d in (-H, 0.0, H))
    v = (after.X_WF.translation - before.X_WF.translation) / (2 * H)
    w = pin.log3(after.X_WF.rotation @ before.X_WF.rotation.T) / (2 * H)
    np.testing.assert_allclose(now.twist, np.concatenate([v, w]), atol=1e-6)
    rate = (after.twist - before.twist) / (2 * H)
    np.testing.assert_allclose(now.acceleration, rate, atol=2e-4 * max(1.0, np.abs(rate).max()))


@pytest.mark.parametrize("name", REFERENCES)
def test_it_begins_and_ends_at_rest(name):
    reference = REFERENCES[name]
    np.testing.assert_allclose(reference.at(0.0).X_WF.homogeneous, A.homogeneous, atol=1e-12)
    for t in (0.0, reference.duration, reference.duration + 1.0):
        np.testing.assert_allclose(reference.at(t).twist, 0.0, atol=1e-9)


def test_a_recorded_path_passes_its_samples():
    reference = recorded()
    for t, u in ((0.7, 0.3), (1.5, 0.5), (2.0, 1.0)):
        X = pin.SE3.Interpolate(A, B, u)
        np.testing.assert_allclose(reference.at(t).X_WF.homogeneous, X.homogeneous, atol=1e-9)


def test_a_trajectory_is_followed_and_then_stands():
    motion = swing("ab", [0.0, 1.0], [1.0, -1.0], 2.0)
    reference = TrajectoryReference(motion)
    found = reference.sample(np.array([0.5, 1.0, 2.5]))
    np.testing.assert_allclose(found.q[:2], motion(np.array([0.5, 1.0])))
    np.testing.assert_allclose(found.v[:2], motion(np.array([0.5, 1.0]), 1))
    np.testing.assert_allclose(found.q[2], [1.0, 0.0], atol=1e-12)
    assert not found.v[2].any()
    assert not found.a[2].any()


def test_a_step_is_one():
    step = StepReference(np.zeros(2), np.array([1.0, 0.0]), 0.5, 2.0)
    found = step.sample(np.array([0.0, 0.499, 0.5, 3.0]))
    assert found.q[:, 0].tolist() == [0.0, 0.0, 1.0, 1.0]
    assert not found.v.any()
