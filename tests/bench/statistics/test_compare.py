"""Two results of the same problems, made up so that what changed is known."""

import json
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from optiplan.bench.results.database import Store
from optiplan.bench.statistics.compare import compare_results
from optiplan.bench.statistics.intervals_and_tests import ALPHA
from optiplan.cli.main import run

FAILED = ("budget", "no path")


def made(planners=("one", "two"), problems=20, seeds=1, longer=1.0, slower=1.0, without=()):
    """Runs whose times and durations are those of the problem, by so much longer for planner `one`."""
    rng = np.random.default_rng(0)
    noise = iter(rng.normal(1.0, 0.01, 10_000))
    runs = {}
    for p in range(problems):
        for label in planners:
            for seed in range(seeds):
                mine = label == "one"
                time, duration = (1.0 + p) * (slower if mine else 1.0), (2.0 + p) * (longer if mine else 1.0)
                good = not (mine and p in without)
                runs[f"s/{p}", label, seed] = (time * next(noise), duration) if good else FAILED
    return runs


@pytest.fixture
def compared(results):
    def run(old, new, **given):
        with Store(results(old, "old")) as before, Store(results(new, "new", **given)) as after:
            return compare_results(before, after)

    return run


def test_nothing_changed(compared):
    found = compared(made(), made())
    assert found.common == 40
    assert [change.verdict for change in found.changes] == 6 * ["no change"]
    assert found.changes[2].ratio.value == 1.0
    assert found.new_failures == found.fixed == ()


def test_longer_motions_are_a_regression_and_shorter_ones_not(compared):
    found = compared(made(), made(longer=1.05))
    (change,) = found.of("regression")
    assert (change.planner, change.quantity, change.better, change.worse) == ("one", "duration", 0, 20)
    assert change.ratio == pytest.approx((1.05, 1.05, 1.05))
    assert 6 * 2.0 / 2**20 < change.corrected < 1e-4  # 20 equal ratios: the normal approximation, not the exact share
    assert found.of("improvement") == []


def test_quicker_planning_is_an_improvement(compared):
    (change,) = compared(made(slower=1.0), made(slower=0.7)).of("improvement")
    assert (change.planner, change.quantity) == ("one", "planning time")
    assert change.ratio.value == pytest.approx(0.7, rel=0.02)


@pytest.mark.parametrize("given", [{"longer": 1.015}, {"slower": 1.15}])
def test_what_is_sure_but_small_does_not_matter(compared, given):
    found = compared(made(), made(**given))
    assert found.of("regression") == []
    assert min(change.corrected for change in found.changes) < ALPHA


@pytest.mark.parametrize(("work", "regressions"), [(1.1, 0), (1.9, 1)])
def test_a_busy_machine_is_no_regression(results, work, regressions):
    folders = [results(made(), "old"), results(made(slower=2.0), "new")]
    for folder, factor in zip(folders, (1.0, work), strict=True):
        with sqlite3.connect(folder / "results.sqlite") as db:
            db.execute("UPDATE runs SET plan_cpu = ?", (3.0 * factor,))
    with Store(folders[0]) as before, Store(folders[1]) as after:
        found = compare_results(before, after)
    assert len(found.of("regression")) == regressions
    told = [note for note in found.notes if "processor time 1.10 times: the machine was busier" in note]
    assert len(told) == 1 - regressions


def test_few_problems_prove_nothing_however_many_their_seeds(compared):
    found = compared(made(problems=3, seeds=12), made(problems=3, seeds=12, longer=1.5))
    assert found.of("regression") == []
    assert found.changes[2].worse == 3


@pytest.mark.parametrize(("others", "regressions"), [(1, 1), (30, 0)])
def test_correction_for_many_planners(compared, others, regressions):
    names = ("one", *(f"p{k}" for k in range(others)))
    found = compared(made(names, problems=9), made(names, problems=9, longer=1.5))
    assert len(found.of("regression")) == regressions
    assert found.changes[2].p == 2.0 / 2**9


@pytest.mark.parametrize(("longer", "code"), [(1.05, 1), (1.0, 0)])
def test_gate(results, capfd, longer, code):
    folders = [str(results(made(), "old")), str(results(made(longer=longer, without=(0,)), "new"))]
    assert run(["bench", "compare", *folders]) == 0
    out = capfd.readouterr().out
    assert ("regression: one: duration 1.050 times that of before" in out) == bool(code)
    assert "new failure: one on s/0, seed 0, repetition 0 (budget)" in out
    assert run(["bench", "compare", *folders, "--gate", "--json"]) == code
    data = json.loads(capfd.readouterr().out, parse_constant=pytest.fail)
    assert (data["exit_code"], len(data["regressions"])) == (code, code)
    assert data["new_failures"] == [{"problem": "s/0", "planner": "one", "seed": 0, "repetition": 0, "kind": "budget"}]


def test_lost_and_fixed_runs(compared):
    found = compared(made(without=(0,)), made(without=range(5, 17)))
    assert [(change.quantity, change.better, change.worse) for change in found.of("regression")] == [("success", 1, 12)]
    assert [key[0] for key, _ in found.new_failures] == sorted(f"s/{p}" for p in range(5, 17))
    assert found.new_failures[0] == (("s/10", "one", 0, 0), "budget")
    assert found.fixed == ((("s/0", "one", 0, 0), "budget"),)


def test_only_what_is_common_is_compared(compared):
    def other_content(problem):
        return replace(problem, hash="other") if problem.id == "s/3" else problem

    found = compared(made(), made(("one", "new"), problems=25), problem=other_content, cpu="two")
    assert found.common == 19
    assert {change.planner for change in found.changes} == {"one"}
    notes = "\n".join(found.notes)
    for text in (
        "the suites differ",
        "1 problems have another content and are left out: s/3",
        "planners only in A: two",
        "planners only in B: new",
        "problems only in B: s/20, s/21, s/22, s/23, s/24",
        "21 of 40 runs in A have no counterpart",
        "31 of 50 runs in B have no counterpart",
        "other machines (times may differ by that): cpu one before, cpu two now",
    ):
        assert text in notes
    assert "problems only in A" not in notes


def test_nothing_in_common(compared):
    found = compared(made(("one",)), made(("two",)))
    assert (found.common, found.changes) == (0, ())


@pytest.mark.parametrize(("unknown", "rest"), [("problem = 's/0'", 11.0), ("problem != 's/0'", 1.0)])
def test_a_run_without_a_time_leaves_the_medians_of_the_others(results, unknown, rest):
    with Store(results(made(), "old"), write=True) as before, Store(results(made(), "new")) as after:
        before._db.execute(f"UPDATE runs SET plan_time = NULL WHERE {unknown}")  # as imported ones may have none
        change = next(one for one in compare_results(before, after).changes if one.quantity == "planning time")
    assert (change.before, change.after) == pytest.approx((rest, rest), rel=0.1)
