"""Users' own constraints: held and checked at samples, said to be; wrong ones are told with the place."""

import casadi
import numpy as np
import pytest

import optiplan as op
from tests.checks import named
from tests.planned import planned_until

GOAL = op.Pose((0.4, 0.4, 0.5), rpy=(np.pi, 0.0, 0.0))


@pytest.fixture(scope="module")
def problem():
    return op.Problem("panda", start="ready", goal=GOAL)


def test_level_is_held_and_said_to_be_sampled(problem):
    level = op.Expression("level", lambda k: -k.pose("tool").R[2, 2], lower=0.999)
    problem = problem.with_goal(op.Pose((0.3, 0.5, 0.5), rpy=(np.pi, 0.0, 0.0)))
    free = op.plan(problem, budget=3.0)  # the first motion would happen to be level
    (before,) = [c for c in op.verify(problem.with_constraint(level), free.trajectory).checks if "level" in c.name]
    assert not before.passed
    assert before.worst < 0.999 == before.limit
    run = planned_until(problem.with_constraint(level))
    assert run.verified, run.failure
    check = named(run.report, "level constraint")
    assert check.kind == "sampled"
    assert "samples" in check.detail


def test_vectors_rates_torques_and_intervals(problem):
    own = (
        op.Expression("slow hand", lambda k: k.twist("panda_hand").linear, lower=-0.6, upper=0.6),
        op.Expression("easy", lambda k: k.torque()[1], lower=-60.0, upper=60.0, during=(0.2, 0.8)),
        op.Expression("elbow", lambda k: k.joint("panda_joint4") + k.q[1], upper=-2.0),
    )
    run = planned_until(problem.with_constraints(*own, {"tool_speed": {"linear": 0.8}}))
    assert run.verified, run.failure
    names = [check.name for check in run.report.checks if check.name.endswith("constraint")]
    assert names == ["tool speed constraint", "slow hand constraint", "easy constraint", "elbow constraint"]


def test_a_problem_with_one_has_a_hash_of_its_own_and_no_file(problem, tmp_path):
    one, same, other = (
        problem.with_constraint(op.Expression("level", lambda k: k.pose("tool").R[2, 2], upper=limit))
        for limit in (-0.98, -0.98, -0.97)
    )
    assert one.hash == same.hash != other.hash != problem.hash
    assert one.with_seed(3).hash == one.hash
    assert len(one.with_start("ready").path_constraints) == 1
    assert not one.with_constraints().path_constraints
    built = op.Problem("panda", start="ready", goal=GOAL, path_constraints=one.path_constraints)
    assert built.hash == one.hash
    with pytest.raises(op.InputError, match="level"):
        one.save(tmp_path / "p.yaml")


@pytest.mark.parametrize(
    ("build", "bounds", "words"),
    [
        (lambda k: k.pose("tool").R[2, 2], {"lower": 0.5}, "-1 at the start"),
        (lambda k: k.pose("nowhere").p, {"lower": 0.0}, "nowhere"),
        (lambda k: 1.0 / k.v[0], {"lower": 0.0}, "not finite at the start"),
        (lambda k: k.norm(k.v), {"upper": 1.0}, "derivative that is not finite at the start"),
        (lambda k: casadi.remainder(k.q[0], 1.0), {"lower": 0.0}, "not smooth: it uses remainder"),
        (lambda k: casadi.fmod(k.q[0], 1.0), {"lower": 0.0}, "not smooth: it uses fmod"),
        (lambda k: casadi.copysign(1.0, k.q[0]), {"lower": 0.0}, "not smooth: it uses copysign"),
        (lambda k: casadi.if_else(k.q[0], 1.0, 2.0), {"lower": 0.0}, "not smooth: it uses if_else, not"),
        (lambda k: casadi.logic_or(k.q[0], k.q[1]), {"lower": 0.0}, "not smooth: it uses or"),
        (lambda k: k.q[0] < 1.0, {"lower": 0.0}, "not smooth: it uses <"),
        (lambda k: "level", {"lower": 0.0}, "it returns the str 'level', which is no CasADi expression"),
        (lambda k: None, {"lower": 0.0}, "it returns None"),
        (lambda k: 1.0 if k.q[0] > 1.0 else 0.0, {"lower": 0.0}, "it compares, so that it is not smooth"),
        (lambda k: casadi.SX.sym("x"), {"lower": 0.0}, "symbols that are none of the state's"),
        (lambda k: casadi.SX.zeros(0, 1), {"lower": 0.0}, "without values"),
    ],
)
def test_wrong_ones_are_told_with_their_name_and_place(problem, build, bounds, words):
    with pytest.raises(op.InputError, match="own") as found:
        problem.with_constraint(op.Expression("own", build, **bounds))
    assert words in str(found.value)
    assert ".cpp" not in str(found.value)


def test_a_goal_and_a_moving_start_that_violate_it_are_refused(problem):
    turned = op.Expression("turned", lambda k: k.q[0], upper=0.5)
    goal = [1.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
    with pytest.raises(op.InputError, match="turned: found 1 at the goal"):
        problem.with_goal(goal).with_constraint(turned)
    assert problem.with_goal(goal, "ready").with_constraint(turned).path_constraints
    moving = op.State(problem.start, [1.0, *[0.0] * 6])
    with pytest.raises(op.InputError, match="calm: found 1 at the start"):
        problem.with_start(moving).with_constraint(op.Expression("calm", lambda k: k.v[0], upper=0.5))


@pytest.mark.parametrize("planner", ["rrtconnect", "trajopt"])
def test_a_motion_that_is_too_fast_for_it_is_slowed_down(problem, planner):
    def energy(k):
        return k.twist("tool").linear.T @ k.twist("tool").linear

    calm = problem.with_constraint(op.Expression("calm", energy, upper=0.04))
    run = planned_until(calm, planner)
    assert run.verified, run.failure
    check = named(run.report, "calm constraint")
    assert 0.02 < check.worst <= 0.04


def test_what_is_not_finite_on_the_way_is_told_with_the_sample(problem):
    """The root of a number that becomes negative where the arm turns."""
    root = op.Expression("root", lambda k: (0.1 - k.q[0]) ** 0.5, upper=10.0)
    with pytest.raises(op.InputError, match=r"not finite at a sample, q = \("):
        op.plan(problem.with_constraint(root), budget=3.0)


def test_bounds_are_checked():
    with pytest.raises(op.InputError, match="lower <= upper"):
        op.Expression("own", lambda k: k.q, lower=1.0, upper=0.0)
    with pytest.raises(op.InputError, match="finite"):
        op.Expression("own", lambda k: k.q)
