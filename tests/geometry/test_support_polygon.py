"""The support polygon: hull, margins by hand, rows that agree with the margins."""

import numpy as np
import pytest

from optiplan.geometry.support_polygon import SupportPolygon, zero_moment_points

SQUARE = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [1.0, 0.5]]


def test_the_hull_is_counter_clockwise_and_without_inner_points():
    polygon = SupportPolygon.of(SQUARE, -1.0)
    assert len(polygon.corners) == 4
    assert polygon.area == pytest.approx(2.0)
    inside = polygon.normals @ np.array([1.0, 0.5]) - polygon.offsets
    assert sorted(inside) == pytest.approx([0.5, 0.5, 1.0, 1.0])
    with pytest.raises(ValueError, match="on one line"):
        SupportPolygon.of([[0, 0], [1, 1], [2, 2]], 0.0)


def test_a_weight_above_a_point_has_that_zero_moment_point_and_a_push_above_the_ground_moves_it():
    weight = np.concatenate([[0.0, 0.0, 100.0], np.cross([1.5, 0.25, 3.0], [0.0, 0.0, 100.0])])
    push = np.concatenate([[10.0, 0.0, 0.0], np.cross([0.0, 0.0, 1.0], [10.0, 0.0, 0.0])])
    wrench = np.array([weight, weight + push])
    polygon = SupportPolygon.of(SQUARE, -1.0)
    # 10 N at 2 m above the ground is 20 N·m, 0.2 m of 100 N; the ground pushes along x, the point goes to -x
    assert np.allclose(zero_moment_points(wrench, -1.0), [[1.5, 0.25], [1.3, 0.25]])
    assert np.allclose(polygon.margins(wrench), [0.25, 0.25])
    assert polygon.margins(np.array([weight * -1.0]))[0] == -np.inf


def test_the_rows_are_the_margin_times_the_normal_force():
    rng = np.random.default_rng(0)
    polygon = SupportPolygon.of(rng.uniform(-1.0, 1.0, (9, 2)), 0.3)
    wrench = rng.normal([0.0, 0.0, 20.0, 0.0, 0.0, 0.0], size=(50, 6))
    left = (wrench @ polygon.rows(0.05).T).min(axis=1)
    assert np.allclose(left, (polygon.margins(wrench) - 0.05) * wrench[:, 2])
