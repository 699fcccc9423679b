"""Poses drawn from a region, at which a line may end."""

import numpy as np
import pinocchio as pin

from optiplan.problem.grasps.places import PLACES, places, unbounded
from optiplan.problem.regions.region import RegionGoal


def region(low, high):
    X_WR = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.4, 0.1, 0.2]))
    X_RF = pin.SE3(pin.exp3(np.array([0.1, 0.0, 0.0])), np.array([0.0, 0.0, 0.05]))
    return RegionGoal("tool", X_WR, X_RF, np.array(low), np.array(high))


def test_places_are_in_the_region_with_their_tolerance_and_fill_it():
    off = np.array([0.1, 0.05, 1e-4, 1e-3, 1e-3, np.inf])
    found = places(region(-off, off))
    assert len(found) == PLACES
    whole = region(-off, off)
    at = np.array([whole.coordinates(end.X_WG) for end in found])
    bounded = np.isfinite(off)
    room = np.array([end.position for end in found])
    assert (np.abs(at[:, :3]) + room[:, None] <= off[:3] + 1e-12).all()
    assert (np.abs(at[:, bounded]) <= off[bounded]).all()
    turns = np.sort(at[:, 5])
    assert np.diff(np.append(turns, turns[0] + 2.0 * np.pi)).max() < 0.6  # no gap of more than 34 degrees
    for k in range(2):
        assert np.ptp(at[:, k]) > 1.5 * off[k]


def test_the_tolerance_of_rotation_moves_what_is_far_away_no_farther_than_the_region():
    X_RF = pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0]))
    off = np.array([0.1, 0.1, 2.5e-4, 0.25, 0.25, 0.25])
    far = RegionGoal("tool", pin.SE3.Identity(), X_RF, -off, off)
    for end in places(far):
        for turn in np.vstack([np.eye(3), -np.eye(3)]) * end.orientation:
            at = end.X_WG.translation + end.position * np.eye(3)[2]
            X_WF = pin.SE3(end.X_WG.rotation @ pin.exp3(turn), at)
            assert far.contains(X_WF)


def test_a_region_without_a_bound_is_told_apart():
    assert unbounded(region([-np.inf, 0, -0.1, 0, 0, 0], [0.1, 0.1, 0.1, 1, 1, 1])) == "along x"
    assert unbounded(region([-0.1] * 6, [0.1] * 6)) == ""
