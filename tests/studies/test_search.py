"""NSGA-II against a front in closed form; the same seed, the same designs; what a budget leaves."""

import numpy as np
import pytest

from optiplan.planners.base import Budget
from optiplan.studies.measures import MEASURES
from optiplan.studies.search import DesignJudge, nondominated, search_designs
from optiplan.studies.study import read_study

TWO = {
    "version": 1,
    "name": "two",
    "robot": "two_links",
    "parameters": {"upper": {"range": [0.2, 0.8]}, "rest": {"range": [0.2, 0.8]}},
    "changes": {"dh.rows.0.a": "=upper", "dh.rows.1.a": "=rest"},
    "states": {"count": 50},
    "maximise": ["reach_volume"],
    "minimise": ["rest"],
    "require": {"manipulability": {"least": 0.01}},
    "search": {"population": 8, "generations": 5},
}


def test_the_front_is_what_no_other_design_dominates():
    study = read_study(TWO, MEASURES)
    found = search_designs(study, None)
    judge = DesignJudge(study)
    F = np.array([judge.objectives(design) for design in found.designs])
    assert len(found.designs) == 40
    assert np.allclose(found.designs[0].x, [0.5, 0.5])
    for k, design in enumerate(found.designs):
        beaten = any((F[j] <= F[k]).all() and (F[j] < F[k]).any() for j in found.front)
        assert (k in found.front) or beaten or design.violation > 0.0 or (F[k] == F[list(found.front)]).all(1).any()
    again = search_designs(study, None)
    assert all(np.array_equal(a.x, b.x) for a, b in zip(found.designs, again.designs, strict=True))


def test_the_search_comes_closer_to_the_best():
    """The mean of |sin q2| a b is largest for a = b of equal sum."""
    alone = {**TWO, "changes": {"dh.rows.0.a": "=upper", "dh.rows.1.a": "=1 - upper"}, "minimise": []}
    alone |= {"parameters": {"upper": {"range": [0.2, 0.8], "given": 0.25}}, "maximise": ["manipulability"]}
    found = search_designs(read_study({**alone, "search": {"population": 8, "generations": 8}}, MEASURES), None)
    (best,) = (found.designs[k] for k in found.front)
    assert best.x[0] == pytest.approx(0.5, abs=0.02)


def test_a_budget_and_an_interrupt_keep_what_there_is():
    study = read_study(TWO, MEASURES)
    short = search_designs(study, Budget(0.0))
    assert (short.ended, len(short.designs), len(short.front)) == ("budget", 1, 1)
    seen = []

    def stop(design):
        seen.append(design)
        if len(seen) == 5:
            raise KeyboardInterrupt

    cut = search_designs(study, None, keep=stop)
    assert (cut.ended, len(cut.designs)) == ("interrupted", 5)


def test_equal_rows_are_one_and_dominated_ones_none():
    F = np.array([[1.0, 2.0], [2.0, 1.0], [1.0, 2.0], [2.0, 2.0], [0.5, 3.0]])
    assert nondominated(F).tolist() == [4, 0, 1]


def test_an_interrupt_before_the_first_design_is_passed_on(monkeypatch):
    def pressed(self, x):
        raise KeyboardInterrupt

    monkeypatch.setattr(DesignJudge, "design", pressed)
    with pytest.raises(KeyboardInterrupt):
        search_designs(read_study(TWO, MEASURES), None)
