"""The program of a stretch: its derivatives, what it keeps, and what it gains."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.task.optimisation.line_part import LinePart, SpeedLimit
from optiplan.planners.task.optimisation.move_part import MovePart
from optiplan.planners.task.optimisation.stretch_optimiser import along
from optiplan.planners.task.optimisation.transcription import StretchTranscription
from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis, moving_breakpoints
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import derived
from optiplan.trajectory.trajectory import Trajectory

START = np.array([0.3, -0.6, 0.2, -2.0, 0.1, 1.6, 0.4])


def bent(names, begin, step, bend):
    """A path over [0, 1] with slope and curvature: begin + s step + s² bend."""
    return Trajectory(names, np.array([0.0, 1.0]), np.array([[begin, step, bend]]))


@pytest.fixture(scope="module")
def made():
    """Line, move, move, line of a Panda next to a box."""
    scene = op.Scene([op.Box("box", size=(0.2, 0.2, 0.2), position=(0.5, 0.1, 0.35))])
    problem = op.Problem("panda", start=START, goal=START + 0.3, scene=scene)
    tight = replace(problem.limits, torque=0.4 * problem.limits.torque)
    problem = derived(problem, limits=tight)
    rng = np.random.default_rng(2)
    names = problem.robot.joint_names
    first = bent(names, START, 0.1 * rng.standard_normal(7), 0.03 * rng.standard_normal(7))
    points = [first.end, START + 0.2 * rng.standard_normal(7), START + 0.3 * rng.standard_normal(7)]
    last = bent(names, points[2], 0.1 * rng.standard_normal(7), 0.03 * rng.standard_normal(7))
    model, options = planning_model(problem.robot, problem.scene), TrajOptOptions(spans=8)
    u = np.linspace(0.1, 0.9, 9)
    moves = [
        MovePart(
            Optimiser(problem, model, options, basis=SplineBasis(moving_breakpoints(8, 0.6, (False, False)))),
            np.array(points[k : k + 2]),
            u,
        )
        for k in (0, 1)
    ]
    lines = [
        LinePart(
            first,
            problem.robot,
            tight,
            (True, False),
            SpeedLimit(np.linspace(0.0, 1.0, 4), np.array([0.8, 0.5, 1.0, 2.0])),
        ),
        LinePart(last, problem.robot, tight, (False, True)),
    ]
    return StretchTranscription([lines[0], *moves, lines[1]])


@pytest.fixture(scope="module")
def y(made):
    """Some values of all variables, with laws that rise."""
    rng = np.random.default_rng(3)
    found = 0.02 * rng.standard_normal(made.size)
    found[:4] = 0.2, 0.3, 0.27, 0.23
    for part, place in zip(made.parts, made.places, strict=True):
        if isinstance(part, LinePart):
            rising = np.linspace(0.0, 1.0, part.basis.size)
            found[place] = rising[part.free] + 0.005 * rng.standard_normal(part.count)
    found[made.passing[1]] = 0.3 * rng.standard_normal(14)
    return found


def differences(value, y, which, step=1e-6):
    found = []
    for k in which:
        plus, minus = y.copy(), y.copy()
        plus[k] += step
        minus[k] -= step
        found.append((value(plus) - value(minus)) / (2.0 * step))
    return np.moveaxis(np.array(found), 0, -1)


def some(made):
    """Variables of every kind: shares, of each part, of the junction."""
    rng = np.random.default_rng(4)
    places = [slice(0, len(made.parts)), *made.places, *made.passing.values()]
    return np.unique(np.concatenate([rng.choice(np.arange(made.size)[place], 4) for place in places]))


def test_rates_have_their_derivatives(made, y):
    which = some(made)
    for k in range(len(made.parts)):
        found = made.spread(k, made.curve(y, 1.3).rate_rows(k).gradient)[:, which]
        expected = differences(lambda x, k=k: made.curve(x, 1.3).rates[k].value, y, which)
        assert found == pytest.approx(expected, abs=2e-6 * max(1.0, np.abs(expected).max()))


def test_terms_have_their_derivatives(made, y):
    which = some(made)
    seen = set()
    for term in made.terms:
        rows = term.rows(made.curve(y, 1.3))
        if not len(rows.value):
            continue
        seen.add((term.name, type(made.parts[term.k]).__name__))
        expected = differences(lambda x, term=term: term.rows(made.curve(x, 1.3)).value, y, which)
        assert rows.by_control[:, which] == pytest.approx(expected, abs=1e-5 * max(1.0, np.abs(expected).max()))
        longer, shorter = (term.rows(made.curve(y, 1.3 + step)).value for step in (1e-6, -1e-6))
        assert rows.by_duration == pytest.approx((longer - shorter) / 2e-6, abs=1e-4)
    assert {("torque", "MovePart"), ("torque", "LinePart"), ("clearance", "MovePart")} <= seen


def test_parts_meet_with_position_velocity_and_acceleration(made, y):
    curve = made.curve(y, 1.7)
    motions = []
    for k, part in enumerate(made.parts):
        names = ("s",) if isinstance(part, LinePart) else made.parts[0].path.joint_names
        motion = Trajectory.from_bspline(names, part.basis.knots * curve.seconds(k), curve.controls[k], DEGREE)
        motions.append(along(part.path, motion) if isinstance(part, LinePart) else motion)
    for before, after in pairwise(motions):
        a, b = before.state(before.duration), after.state(0.0)
        for x, z in ((a.q, b.q), (a.v, b.v), (a.a, b.a)):
            assert x == pytest.approx(z, abs=1e-9 * max(1.0, np.abs(x).max()))
    assert max(np.abs(motions[0](0.0, 1)).max(), np.abs(motions[-1](motions[-1].duration, 1)).max()) < 1e-12


def test_a_law_run_along_a_path_stays_on_it(made, y):
    line = made.parts[0]
    law = Trajectory.from_bspline(("s",), 0.4 * line.basis.knots, line.control(y[made.places[0]]), DEGREE)
    motion = along(line.path, law)
    t = np.linspace(0.0, 0.4, 777)
    assert motion(t) == pytest.approx(line.path(np.clip(law(t)[:, 0], 0.0, 1.0)), abs=1e-6)
    assert motion.coefficients.shape[1] == 6
