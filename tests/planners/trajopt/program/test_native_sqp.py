"""The native rows and descent against the reference: the same rows, durations as good, the same answer to stop."""

import gc
import weakref
from dataclasses import replace
from importlib import import_module

import numpy as np
import pinocchio as pin
import pytest

from optiplan._core import core, variants
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.geometry.scene import Box, Obstacle, Scene, Sphere
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.program import native_sqp, native_step, sqp
from optiplan.planners.trajopt.program.native_sqp import NativeSqp
from optiplan.planners.trajopt.program.qp import Subproblem
from optiplan.planners.trajopt.program.sqp import DescentOptions
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import Margins
from optiplan.problem.problem import JointGoal, Objective, Problem
from optiplan.robot.robot import Robot, load_robot
from tests.planners import cases
from tests.robot.test_mimic_joints import PARTS, write_robot
from tests.unchecked_problem import unchecked_problem

pytestmark = pytest.mark.skipif(core is None, reason="the native core is not built")

SAMPLES = np.linspace(0.0, 1.0, 66)[1:-1]


def transcription(problem: Problem, model: CollisionModel, way: np.ndarray) -> tuple[Transcription, np.ndarray]:
    basis = SplineBasis(bunched_breakpoints(22, 0.6))
    control = along_path(basis, way, problem.limits.velocity)
    made = Transcription(problem, model, basis, Margins.between(model, control[[0, -1]], 0.005))
    made.set_samples(SAMPLES)
    return made, control


def past_a_ball(robot: Robot) -> tuple[Problem, np.ndarray]:
    """Weak motors, a ball beside the way, and waypoints of a detour."""
    rng = np.random.default_rng(3)
    low, high = np.maximum(robot.limits.lower, -1.5), np.minimum(robot.limits.upper, 1.5)
    start, goal = low + rng.random((2, len(low))) * (high - low)
    limits = replace(
        robot.limits, torque=np.where(np.isfinite(robot.limits.torque), 0.05 * robot.limits.torque, np.inf)
    )
    ball = Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.array([0.45, 0.25, 0.62])))
    board = Obstacle("board", Box((0.6, 0.6, 0.02)), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.1])))
    problem = unchecked_problem(
        name="past a ball",
        robot=robot,
        scene=Scene((ball, board)),
        start=start,
        goal=(JointGoal(goal),),
        limits=limits,
        objective=Objective(1.0, 1e-6),
    )
    return problem, np.array([start, 0.5 * (start + goal) + 0.1, goal])


@pytest.fixture(scope="module")
def geared(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A robot with sliding joints and joints that follow others."""
    return str(write_robot(tmp_path_factory.mktemp("geared"), PARTS, "group: [lift, elbow]\ntool_frame: f\n"))


@pytest.mark.parametrize("name", ["panda", "ur5", "baxter", "geared"])
@pytest.mark.parametrize("native_contacts", [True, False])
def test_rows_are_the_references(name: str, native_contacts: bool, request: pytest.FixtureRequest) -> None:
    """Contacts and torques with their derivatives, exactly as the Python path lays them out.

    Distances of cylinders are asked for to 1e-8 m, and normals are then as good as the root of that.
    """
    rounded = native_contacts and name == "baxter"
    problem, way = past_a_ball(load_robot(request.getfixturevalue(name) if name == "geared" else name))
    model = (NativeCollisionModel if native_contacts else CollisionModel)(problem.robot, problem.scene)
    made, control = transcription(problem, model, way)
    native = NativeSqp(made)
    native.set_samples(SAMPLES)
    point = sqp.evaluate(made, control, 0.0)
    duration, merit, contacts, torques = native._sqp.evaluate(control, 0.0)
    assert duration == pytest.approx(point.duration, rel=1e-12)
    assert merit == pytest.approx(point.merit, rel=1e-9)
    for rows, (sample, value, by_control, by_duration) in ((point.rows[0], contacts), (point.rows[1], torques)):
        np.testing.assert_array_equal(sample, rows.sample)
        np.testing.assert_allclose(value, rows.value, atol=2e-8 if rounded else 1e-9)
        np.testing.assert_allclose(by_control, rows.by_control, rtol=1e-7, atol=1e-3 if rounded else 1e-7)
        np.testing.assert_allclose(by_duration, rows.by_duration, rtol=1e-9, atol=1e-9)
    assert len(torques[0]), "the motors are weak"


def walled() -> tuple[Problem, np.ndarray]:
    problem = cases.wall()
    goal = problem.goal[0].q
    return problem, np.array([problem.start, 0.5 * (problem.start + goal) + 0.2, goal])


def test_a_descent_is_as_good_as_the_references() -> None:
    problem, way = walled()
    made, control = transcription(problem, NativeCollisionModel(problem.robot, problem.scene), way)
    native = NativeSqp(made)
    native.set_samples(SAMPLES)
    expected = sqp.Sqp(Subproblem(made, "piqp")).optimise(control, DescentOptions(60, lambda: False))
    found = native.optimise(control, DescentOptions(60, lambda: False))
    assert expected.missing < 1e-4
    assert found.missing < 1e-4
    assert found.duration < 1.02 * expected.duration
    again = sqp.evaluate(made, found.control, found.duration)
    assert again.duration == pytest.approx(found.duration)
    assert again.missing == pytest.approx(found.missing, abs=1e-9)
    assert again.nearest == pytest.approx(found.nearest, abs=1e-9)


def test_a_descent_asks_whether_to_stop() -> None:
    problem, way = walled()
    made, control = transcription(problem, NativeCollisionModel(problem.robot, problem.scene), way)
    native = NativeSqp(made)
    native.set_samples(SAMPLES)
    assert native.optimise(control, DescentOptions(60, lambda: True)).steps == 0
    asked: list[None] = []
    assert 0 < native.optimise(control, DescentOptions(60, lambda: asked.append(None) or len(asked) > 2)).steps <= 4
    with pytest.raises(KeyboardInterrupt):
        native.optimise(control, DescentOptions(60, interrupted))


@pytest.mark.parametrize("native", [True, False])
def test_a_descent_keeps_a_log_and_says_why_it_ended(native: bool) -> None:
    problem, way = walled()
    made, control = transcription(problem, NativeCollisionModel(problem.robot, problem.scene), way)
    descender = NativeSqp(made) if native else sqp.Sqp(Subproblem(made, "piqp"))
    descender.set_samples(SAMPLES)
    found, first = descender.optimise(control, DescentOptions(60, lambda: False)), sqp.evaluate(made, control, 0.0)
    duration, merit, violation, radius, accepted = found.log.rows.T
    assert (duration[0], merit[0], violation[0], radius[0]) == pytest.approx(
        (first.duration, first.merit, first.missing, sqp.FIRST_RADIUS)
    )
    assert len(accepted) <= found.steps <= 2 * len(accepted) + 1
    assert (np.diff(merit)[accepted[:-1] > 0] < 0).all()
    undone = np.flatnonzero(accepted[:-1] == sqp.REFUSED)
    np.testing.assert_allclose(radius[undone + 1], sqp.SHRINK * radius[undone])
    assert duration[-1] >= found.duration
    assert found.log.ended == "converged"
    assert descender.optimise(control, DescentOptions(2, lambda: False)).log.ended == "step limit"
    told = found.log.then(descender.optimise(control, DescentOptions(60, lambda: True)).log).to_dict()
    assert told["ended"] == "stopped"
    assert len(told["log"]["duration"]) == len(duration)


@pytest.mark.parametrize("native", [True, False])
def test_a_descent_asks_once_whether_to_go_on_from_the_first_curve_that_keeps_clear(native: bool) -> None:
    problem, way = walled()
    made, control = transcription(problem, NativeCollisionModel(problem.robot, problem.scene), way)
    descender = NativeSqp(made) if native else sqp.Sqp(Subproblem(made, "piqp"))
    descender.set_samples(SAMPLES)
    asked: list[tuple[np.ndarray, float]] = []

    def ask(control: np.ndarray, duration: float) -> bool:
        asked.append((control, duration))
        return len(asked) > 1

    assert not sqp.evaluate(made, control, 0.0).feasible
    ended = descender.optimise(control, DescentOptions(60, lambda: False, go_on=ask))
    assert ended.log.ended == "contact between samples"
    assert len(asked) == 1
    assert np.array_equal(ended.control, asked[0][0])
    assert sqp.evaluate(made, *asked[0]).feasible
    further = descender.optimise(control, DescentOptions(60, lambda: False, go_on=ask))
    assert further.log.ended == "converged"
    assert len(asked) == 2
    assert further.steps > ended.steps
    assert further.duration <= ended.duration


def interrupted() -> bool:
    raise KeyboardInterrupt


def test_all_builds_give_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """With contacts of the reference model, which is the same object in all of them."""
    problem, way = past_a_ball(load_robot("panda"))
    made, control = transcription(problem, CollisionModel(problem.robot, problem.scene), way)
    found = set()
    for name in variants()[:-1]:
        build = import_module(f"optiplan._core._core_{name}")
        for module in (native_sqp, native_step, import_module("optiplan.robot.native_tree")):
            monkeypatch.setattr(module, "core", build)
        native = NativeSqp(made)
        native.set_samples(SAMPLES)
        _, merit, contacts, torques = native._sqp.evaluate(control, 0.0)
        found.add((merit, *(part.tobytes() for part in (*contacts, *torques))))
    assert len(found) == 1


def test_a_descent_without_a_world_is_let_go() -> None:
    """The core asks the transcription for contacts; that must not keep either of them alive."""
    problem, way = walled()
    made, _ = transcription(problem, CollisionModel(problem.robot, problem.scene), way)
    native = NativeSqp(made)
    gone = weakref.ref(native)
    del native
    gc.collect()
    assert gone() is None
