"""References of an executor: its set-points, its speeds, and what cannot be executed."""

import numpy as np
import pytest

import optiplan as op
from optiplan.simulation.references.executed import ExecutedReference

DT = 1e-3


@pytest.fixture(scope="module")
def run():
    return op.plan(op.load_problem("01_reach"), budget=3.0)


def test_at_full_speed_it_is_the_plan(run):
    reference = ExecutedReference(run, [(0.0, 1.0)], DT)
    t = np.arange(0.0, run.duration, 7 * DT)
    found = reference.sample(t)
    np.testing.assert_allclose(found.q, run.trajectory(t), atol=1e-9)
    np.testing.assert_allclose(found.v, run.trajectory(t, 1), atol=1e-9)
    np.testing.assert_allclose(reference.places(t), t, atol=1e-9)
    assert reference.duration == pytest.approx(run.duration, abs=2 * DT)


def test_pairs_of_times_and_speeds_are_the_overrides_from_then_on(run):
    reference = ExecutedReference(run, [(0.2, 0.5), (0.0, 1.0)], DT)
    ticks = np.arange(len(reference.override)) * DT
    np.testing.assert_array_equal(reference.override, np.where(ticks < 0.2 + 0.5 * DT, 1.0, 0.5))
    assert reference.duration > 1.3 * run.duration
    end = reference.sample(np.array([reference.duration + 5.0]))
    np.testing.assert_allclose(end.q[0], run.trajectory.end, atol=1e-12)
    assert not end.v.any()
    assert (np.diff(reference.place) >= 0.0).all()


def test_between_two_ticks_is_their_mean(run):
    reference = ExecutedReference(run, [(0.0, 1.0)], DT)
    a, b, middle = (reference.sample(np.array([t])).torque[0] for t in (0.1, 0.1 + DT, 0.1 + 0.5 * DT))
    np.testing.assert_allclose(middle, 0.5 * (a + b), atol=1e-9)


def test_a_function_may_pause_and_reverse(run):
    asked = {200: "pause", 600: "resume", 700: "reverse", 900: "resume"}

    def change(executor):
        what = asked.pop(round(executor.time / DT), None)
        if what is not None:
            getattr(executor, what)()

    reference = ExecutedReference(run, change, DT)
    assert not asked
    assert (np.diff(reference.place) < 0.0).any()
    assert (np.diff(reference.place)[500:590] == 0.0).all()
    assert reference.place[-1] == run.duration


@pytest.mark.parametrize(
    ("speeds", "found"),
    [([(0.0, 1.0), (0.1, 0.0)], "paused"), (lambda executor: executor.stop("because"), "because")],
)
def test_what_never_ends_is_an_error(run, speeds, found, monkeypatch):
    monkeypatch.setattr("optiplan.simulation.references.executed.LONGEST", 2.0)
    with pytest.raises(op.InputError, match=f"execute.*speeds.*{found}"):
        ExecutedReference(run, speeds, DT)
