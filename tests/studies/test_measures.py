"""Measures of designs against closed forms of an arm of two links and of the SRRA's base."""

import numpy as np
import pytest

from optiplan.errors import InputError, OptiPlanError
from optiplan.studies.measures import MEASURES, DesignMeasures, check_measures, reached_volume
from optiplan.studies.study import read_study

BAR = {
    "version": 1,
    "name": "bar",
    "robot": {
        "dh": {
            "convention": "standard",
            "unit": "rad",
            "base": {"mass": 10, "centre": [0, 0, -0.5], "inertia": [1, 1, 1]},
            "rows": [
                {"joint": "revolute", "alpha": -1.5707963267948966, "mass": 0, "geometry": []},
                {"joint": "revolute", "a": 1, "mass": 2, "centre": [0, 0, 0], "inertia": [0.01, 0.01, 0.01]},
            ],
        },
        "limits": {"velocity": 2, "acceleration": 3, "torque": 50},
    },
    "parameters": {"length": {"range": [0.5, 2.0], "unit": "m"}, "load": {"range": [1, 5], "given": 2, "unit": "kg"}},
    "changes": {"dh.rows.1.a": "=length", "dh.rows.1.mass": "=load"},
    "support": {"height": -1, "corners": [[-1, -1], [1, -1], [1, 1], [-1, 1]]},
    "states": {"count": 4000, "motion": 0, "voxel": 0.1},
    "maximise": ["tip_over", "reach_volume"],
    "minimise": ["torque", "mass", "torque_share"],
}


def measured(length, load, **changes):
    study = read_study({**BAR, **changes}, MEASURES)
    check_measures(study)
    return DesignMeasures(study).of({"length": length, "load": load})


def test_a_point_mass_on_a_bar_at_rest():
    found = measured(1.5, 2.0)
    # the mass is at the end of the bar; level, it needs m g l, and the zero-moment point is at m l / (m + base)
    assert found["torque"] == pytest.approx(2.0 * 9.81 * 1.5, rel=1e-3)
    assert found["torque_share"] == pytest.approx(found["torque"] / 50.0)
    assert found["mass"] == pytest.approx(12.0)
    assert 0.0 < found["tip_over"] - (1.0 - 2.0 * 1.5 / 12.0) < 5e-3
    assert set(found) == {"reach_volume", "torque", "torque_share", "tip_over", "mass"}


def test_motion_makes_it_worse():
    resting, moving = measured(1.5, 2.0), measured(1.5, 2.0, states={"count": 4000, "motion": 1, "voxel": 0.1})
    assert moving["tip_over"] < resting["tip_over"]
    assert moving["torque"] > resting["torque"]


def test_the_volume_of_a_filled_sphere():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200_000, 3))
    points *= rng.random((len(points), 1)) ** (1 / 3) / np.linalg.norm(points, axis=1)[:, None]
    sphere = 4.0 / 3.0 * np.pi
    assert reached_volume(points, 0.1, 1.0) == pytest.approx(sphere, rel=0.03)
    assert reached_volume(points, 0.1, 1.0, ground=0.0) == pytest.approx(sphere / 2.0, rel=0.03)


def test_a_task_out_of_reach_takes_for_ever():
    tasks = [{"start": {"joints": [0, 0]}, "goal": {"joints": [1, 0]}, "limits": {"jerk": "none"}}]
    assert measured(1.0, 1.0, minimise=["cycle_time"], tasks=tasks)["cycle_time"] == pytest.approx(1.1547, abs=1e-3)
    far = [{"start": {"joints": [0, 0]}, "goal": {"pose": {"position": [9, 0, 0], "rpy": [0, 0, 0]}}}]
    assert np.isposinf(measured(1.0, 1.0, minimise=["cycle_time"], tasks=far)["cycle_time"])


def test_cubes_that_would_take_all_memory_are_refused():
    with pytest.raises(InputError, match=r"states.voxel: 0.005 m; expected at least 0.0202 m, for a reach of 2 m"):
        measured(1.0, 1.0, states={"count": 1000, "motion": 0, "voxel": 0.005})
    with pytest.raises(OptiPlanError, match="at most 100 along the reach"):
        reached_volume(np.zeros((1, 3)), 0.005, 1.0)
