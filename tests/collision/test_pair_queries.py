"""Single pairs, asked of coal itself, answer as pinocchio's solvers of all pairs do, which they do not need."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision import pair_queries
from optiplan.collision.kept_models import collision_model
from optiplan.collision.model import CollisionModel
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.verify.verify import verify
from tests.planned import planned_until


@pytest.fixture(params=["02_shelf", "13_mesh"])
def problem(request: pytest.FixtureRequest, problems: Path) -> Problem:
    return load_problem(problems / f"{request.param}.yaml")


def test_many_pairs_answer_as_few(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = CollisionModel(problem.robot, problem.scene)
    whole.place(problem.start)  # made before there are many
    monkeypatch.setattr(pair_queries, "MANY", 0)
    asked = CollisionModel(problem.robot, problem.scene)
    rng, limits = np.random.default_rng(4), problem.limits
    Q = np.clip(problem.start + rng.normal(0.0, 0.5, (40, problem.robot.n)), limits.lower, limits.upper)
    found = [model.near(Q, 0.1) for model in (whole, asked)]
    assert len(found[0].rows) > 10
    for name in ("rows", "pairs", "distance", "points", "normals"):
        assert np.array_equal(getattr(found[0], name), getattr(found[1], name))
    touching = [whole.collides(q) for q in Q]
    assert 0 < sum(touching) < len(Q)
    assert touching == [asked.collides(q) for q in Q]
    for q in Q[:10]:
        nearest = [model.clearance(q) for model in (whole, asked)]
        assert nearest[0] is not None
        assert nearest[1] is not None
        assert nearest[0].distance == pytest.approx(nearest[1].distance, abs=1e-12)
        assert whole.contained(q) == asked.contained(q)
    assert asked._queries.many
    assert "_solvers" not in vars(asked._queries)


def test_a_pair_answers_as_its_solver_does(problem: Problem) -> None:
    """To the last bit, points and normals too."""
    model = CollisionModel(problem.robot, problem.scene)
    rng = np.random.default_rng(2)
    for q in problem.start + rng.normal(0.0, 0.4, (6, problem.robot.n)):
        model.place(q)
        queries = model._queries
        own = [queries.distance(pair) for pair in range(len(model.pairs))]
        touching = [queries.touches(pair) for pair in range(len(model.pairs))]
        data = model.model.createData()
        nearest, _ = queries.nearest(data, q)  # asks every solver
        assert own[nearest].min_distance == min(result.min_distance for result in own)
        for pair, found in enumerate(own):
            expected = queries._solvers.distanceResults[pair]
            assert found.min_distance == expected.min_distance
            assert np.array_equal(found.getNearestPoint1(), expected.getNearestPoint1())
            assert np.array_equal(found.getNearestPoint2(), expected.getNearestPoint2())
            assert np.array_equal(found.normal, expected.normal, equal_nan=True)
            assert touching[pair] == pin.computeCollision(model.geometry, queries._solvers, pair)


def test_what_touches_is_found_by_either_question(problem: Problem) -> None:
    """Deepest contacts as of `contacts`, whether any as `touches` has it; the nearest pair where only that says so."""
    model = CollisionModel(problem.robot, problem.scene)
    rng = np.random.default_rng(5)
    deep = 0
    for q in problem.start + rng.normal(0.0, 0.6, (40, problem.robot.n)):
        found = model.touching(q, 1e-12)
        deeper = model.contacts(q, 1e-12)
        assert [(one.pair, one.distance) for one in found[: len(deeper)]] == [(o.pair, o.distance) for o in deeper]
        assert bool(found) == (bool(deeper) or model.touches(q))
        deep += bool(deeper)
    assert 0 < deep < 40


def test_loading_a_problem_makes_no_solvers(problem: Problem) -> None:
    again = problem.with_scene(problem.scene)
    model = collision_model(again.robot, again.scene)
    queries = [found for found in (vars(model).get("_queries"), vars(model.outline).get("_queries")) if found]
    assert queries
    assert not any("_solvers" in vars(found) for found in queries)


def test_a_proof_is_the_same_with_pairs_on_demand(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    done = planned_until(problem, seconds=30.0)
    assert done.verified
    monkeypatch.setattr(pair_queries, "MANY", 0)
    again = verify(problem.with_scene(problem.scene), done.trajectory)
    assert again.verified
    reports = [
        [(check.name, check.passed, check.witness) for check in report.checks] for report in (done.report, again)
    ]
    assert reports[0] == reports[1]
