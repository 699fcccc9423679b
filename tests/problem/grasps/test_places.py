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


def test_a_region_without_a_bound_is_told_apart():
    assert unbounded(region([-np.inf, 0, -0.1, 0, 0, 0], [0.1, 0.1, 0.1, 1, 1, 1])) == "along x"
    assert unbounded(region([-0.1] * 6, [0.1] * 6)) == ""
