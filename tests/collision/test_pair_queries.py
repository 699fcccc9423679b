"""Pairs asked on demand answer as all pairs made at once, and take memory for those asked alone."""

from pathlib import Path

import numpy as np
import pytest

from optiplan.collision import pair_queries
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import run
from optiplan.verify.verify import verify


@pytest.fixture(params=["02_shelf", "13_mesh"])
def problem(request: pytest.FixtureRequest, problems: Path) -> Problem:
    return load_problem(problems / f"{request.param}.yaml")


def on_demand(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> CollisionModel:
    """Return a model that counts every number of pairs as many."""
    monkeypatch.setattr(pair_queries, "MANY", 0)
    return CollisionModel(problem.robot, problem.scene)


def test_pairs_on_demand_answer_as_all_of_them(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = CollisionModel(problem.robot, problem.scene)
    whole.place(problem.start)  # made before there are many
    asked = on_demand(problem, monkeypatch)
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
    queries = asked._queries
    assert queries.many
    assert 0 < len(queries._places) < len(asked.pairs)
    assert len(queries.ready(np.array([0])).geometry.collisionPairs) == len(queries._places)


def test_a_proof_is_the_same_with_pairs_on_demand(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    done = run(problem, "trajopt", {"seeds": 1}, Budget(30.0), lambda stage, share: None)
    assert done.trajectory is not None
    monkeypatch.setattr(pair_queries, "MANY", 0)
    again = verify(problem.with_scene(problem.scene), done.trajectory)
    assert again.verified
    reports = [
        [(check.name, check.passed, check.witness) for check in report.checks] for report in (done.report, again)
    ]
    assert reports[0] == reports[1]
