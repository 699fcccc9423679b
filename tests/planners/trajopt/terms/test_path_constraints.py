"""Path constraints as terms: exact derivatives, and motions of `trajopt` that hold them, proved."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.kinematics.symbolic.state import BatchedExpression
from optiplan.planners.path_constraints.inequalities import inequalities
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.terms.path_constraints import ConstraintTerms
from optiplan.planners.trajopt.terms.term import Curve, Instants
from optiplan.problem.constraints.measures import measures
from optiplan.problem.constraints.statements import KINDS
from optiplan.trajectory.trajectory import Trajectory
from tests.planners.constraint_cases import CONSTRAINTS, GOAL, assert_held_and_proved, key_of, stated

BASIS = SplineBasis(bunched_breakpoints(10, 0.6))


@pytest.fixture(scope="module")
def problem():
    return op.Problem("panda", start="ready", goal=GOAL)


def test_every_kind_of_constraint_is_here():
    assert {key_of(name) for name in CONSTRAINTS} == set(KINDS)


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_trajopt_holds_it_and_the_verifier_proves_it(name):
    assert_held_and_proved(name, "trajopt")


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_a_motion_that_violates_it_is_refused_with_time_and_place(name):
    """Through waypoints far away from it, fast."""
    problem, rng = stated(name), np.random.default_rng(1)
    n, limits = problem.robot.n, problem.limits
    detour = problem.start + 0.6 * rng.normal(size=n)
    way = np.clip(np.array([problem.start, detour, problem.start]), limits.lower, limits.upper)
    control = along_path(BASIS, way, limits.velocity)
    motion = Trajectory.from_bspline(problem.robot.joint_names, BASIS.knots * 0.2, control, DEGREE)
    report = op.verify(problem, motion)
    refused = [check for check in report.failures if check.name.endswith("constraint")]
    if key_of(name) == "relative_pose":  # of two frames on one link: nothing can violate it
        assert not refused
        return
    assert refused
    assert all(0.0 <= check.time <= 0.2 and check.place and check.worst is not None for check in refused)


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_rows_equal_differences(name):
    """By the control points and by the duration, at once, of a curve away from the constraint."""
    problem, rng = stated(name), np.random.default_rng(0)
    made = ConstraintTerms(PathConstraints(problem)).begin()
    goal = problem.start + 0.3 * rng.normal(size=problem.robot.n)
    control = along_path(BASIS, np.array([problem.start, goal]), problem.limits.velocity)
    control = BASIS.moved(control, 0.1 * rng.normal(size=BASIS.moving(control).shape))
    instants, T = Instants.of(BASIS, np.linspace(0.05, 0.95, 12)), 1.3
    change, dT = 1e-6 * rng.normal(size=BASIS.moving(control).shape), 1e-6
    for term in made:
        term.begin(instants)
        here = term.rows(Curve(control, T, instants))
        after = term.rows(Curve(BASIS.moved(control, change), T + dT, instants))
        before = term.rows(Curve(BASIS.moved(control, -change), T - dT, instants))
        assert len(here.value) == len(after.value) == len(before.value) > 0
        expected = 0.5 * (after.value - before.value)
        predicted = here.by_control @ change.ravel() + here.by_duration * dT
        np.testing.assert_allclose(predicted, expected, atol=1e-6 if key_of(name) == "clearance" else 3e-9)
        assert np.abs(expected).max() > 1e-8 or key_of(name) == "relative_pose"


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_files_and_python_say_the_same(name, tmp_path):
    problem = stated(name)
    (one,) = problem.path_constraints
    (same,) = problem.with_constraints(one).path_constraints
    problem.save(tmp_path / "p.yaml")
    again = op.load_problem(tmp_path / "p.yaml")
    assert again.hash == problem.hash
    X = np.array([pin.SE3.Random().homogeneous for _ in range(3)])
    for measure, other in zip(measures(one), measures(same), strict=True):
        assert measure.value(X) == pytest.approx(other.value(X), abs=1e-12)
        assert measure.limit == pytest.approx(other.limit)


def test_a_constraint_holds_for_its_part_of_the_motion_only(problem):
    """A plane below both ends: the tool goes down to it in the middle."""
    part = {"plane": {"normal": [0, 0, 1], "offset": 0.4, "within": 0.002, "during": [0.45, 0.55]}}
    run = op.plan(problem.with_constraints(part), budget=10.0)
    assert run.verified, run.failure


def test_contradictory_constraints_are_a_failure_that_names_one(problem):
    high = {"plane": {"normal": [0, 0, 1], "offset": 0.8, "within": 0.01, "during": [0.4, 0.6]}}
    low = {"position": {"box": {"size": [2.0, 2.0, 1.2], "pose": {"position": [0, 0, 0.1]}}}}
    run = op.plan(problem.with_constraints(high, low), budget=1.5)
    assert not run.verified
    assert run.failure.kind == "constraint"
    assert run.failure.witness["constraint"] in ("plane", "position")
    assert len(run.failure.witness["q"]) == 7


def test_goals_that_all_violate_a_constraint_are_a_failure(problem):
    tilted = {"orientation": {"frame": "panda_link4", "axis": [0, 0, 1], "toward": [0, 0, 1], "within": 0.05}}
    run = op.plan(
        problem.with_constraints({"orientation": {**tilted["orientation"], "during": [0.5, 1.0]}}), budget=3.0
    )
    assert run.failure.kind == "constraint"


def test_machine_code_and_virtual_machine_give_the_same_bits(problem, monkeypatch, tmp_path):
    """Otherwise the first motion of a new constraint would differ from the next."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (one,) = problem.with_constraints({"orientation": CONSTRAINTS["orientation"]}).path_constraints
    (stated,) = inequalities(one)
    states = [np.random.default_rng(k).normal(size=(20, 7)) for k in range(3)]
    found = []
    for compiler in ("cc", "no-compiler"):
        monkeypatch.setenv("CC", compiler)
        values, slopes = BatchedExpression(problem.robot, "inequality", stated.build)(states)
        found.append((values.tobytes(), *(slope.tobytes() for slope in slopes)))
    assert found[0] == found[1]


def test_legs_between_vias_hold_a_constraint_of_the_whole_motion_and_of_no_part(problem):
    upright = {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.1}
    past = problem.with_vias(op.Pose((0.45, 0.2, 0.4), rpy=(np.pi, 0.0, 0.0)))
    run = op.plan(past.with_constraints({"orientation": upright}), budget=10.0)
    assert run.verified, run.failure
    run = op.plan(past.with_constraints({"orientation": {**upright, "during": [0.2, 0.8]}}), budget=10.0)
    assert run.failure.kind == "unsupported"


@pytest.mark.parametrize(
    ("constraint", "values"),
    [
        ({"orientation": {"axis": [1, 0, 0], "toward": [0, 0, -1], "within": 0.1}}, ("tilted by 1.571", "0.1 rad")),
        ({"clearance": {"pairs": [["panda_hand", "panda_link0"]], "at_least": 0.5}}, ("near by 0.45", "0.5 m")),
        ({"coupling": {"joints": {"panda_joint6": 1.0}, "within": 0.1}}, ("uncoupled by 1.571", "0.1 allowed")),
    ],
)
def test_a_start_that_violates_one_is_bad_input_with_both_values(problem, constraint, values):
    with pytest.raises(op.InputError) as found:
        problem.with_constraints(constraint)
    assert all(value in str(found.value) for value in values)
