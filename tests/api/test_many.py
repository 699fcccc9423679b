"""`plan_many`: order, progress, failures that end no other, workers that die, a Dask client."""

import time
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing import active_children

import pytest

import optiplan as op
from optiplan.api import many
from tests.waiting import wait_until

HERE = "tests.api.unruly_planners"


@pytest.fixture(scope="module")
def problems():
    return [op.load_problem("12_planar", seed=seed) for seed in range(3)]


def test_runs_come_in_order_and_are_those_of_plan(problems):
    told = []
    mixed = [problems[0], op.load_problem("01_reach"), problems[2]]
    runs = list(op.plan_many(mixed, "quintic", workers=2, progress=lambda name, share: told.append((name, share))))
    assert [run.problem for run in runs] == mixed
    assert sorted(share for _, share in told) == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert {name for name, _ in told} == {"planar", "reach"}
    own = op.plan(mixed[1], "quintic")
    assert runs[1].verified == own.verified
    assert (runs[1].trajectory(0.1) == own.trajectory(0.1)).all()


def test_a_failure_ends_no_other(problems):
    runs = list(op.plan_many(problems, f"{HERE}:Broken", workers=1))
    assert [run.failure.kind for run in runs] == ["no-path", "bug", "no-path"]
    assert "one by zero" in runs[1].failure.detail


def test_options_that_do_not_go_with_one_problem_are_its_failure(problems):
    line = op.load_problem("25_line")
    runs = list(op.plan_many([line, problems[0]], "line", workers=1, budget=5.0))
    assert runs[0].verified
    assert runs[1].failure is not None


def test_a_worker_that_dies_ends_it_loudly(problems):
    with pytest.raises(op.OptiPlanError, match=r"^op.plan_many: a worker process died before 'planar' was planned"):
        list(op.plan_many(problems, f"{HERE}:Killed", workers=1))


def test_closed_before_the_first_run_the_work_ends(problems):
    others = set(active_children())
    runs = op.plan_many(problems, "quintic", workers=1)
    assert set(active_children()) - others
    runs.close()
    wait_until(lambda: not set(active_children()) - others)


def test_closed_by_its_progress_the_work_ends(problems):
    others = set(active_children())
    runs = op.plan_many(problems, "quintic", workers=1, progress=lambda *_: runs.close())
    with pytest.raises(ValueError, match="already executing"):
        list(runs)
    wait_until(lambda: not set(active_children()) - others)


def test_a_worker_that_dies_while_others_are_submitted_ends_it_loudly(problems, monkeypatch):
    class Broken(ProcessPoolExecutor):
        def submit(self, *_):
            raise BrokenProcessPool("it died")

    monkeypatch.setattr("optiplan.api.many.ProcessPoolExecutor", Broken)
    with pytest.raises(op.OptiPlanError, match=r"^op.plan_many: a worker process died before 'planar' was planned"):
        list(op.plan_many(problems, "quintic", workers=1))


def test_what_is_done_costs_the_same_however_many_wait(problems, monkeypatch):
    """Each arrival looked at all futures that were left."""
    requests = many._requests(problems[:1], None, None, 1.0) * 3000
    futures = [Future() for _ in requests]
    left = iter(futures)

    def progress(name, fraction):
        for future in islice(left, 1):
            future.set_result(None)

    monkeypatch.setattr(many, "replace", lambda run, **_: run)
    progress("", 0.0)
    began = time.process_time()
    assert sum(1 for _ in many._ordered(requests, futures, progress)) == 3000
    assert time.process_time() - began < 1.0


def test_none_are_no_runs():
    assert list(op.plan_many([], workers=2)) == []


def test_a_dask_client_in_place_of_a_number(problems):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        runs = list(op.plan_many(problems[:2], "quintic", workers=client))
        assert [run.problem for run in runs] == problems[:2]
        kinds = [run.failure.kind for run in op.plan_many(problems, f"{HERE}:Broken", workers=client)]
        assert kinds == ["no-path", "bug", "no-path"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"problems": "01_reach"}, "op.plan_many: problems: found the str '01_reach'"),
        ({"problems": [3]}, "op.plan_many: problems[0]: found the int 3"),
        ({"planner": "quintik"}, "op.plan_many: planner: found 'quintik'; expected one of: "),
        ({"planner": "quintic", "options": {"degre": 5}}, "op.plan_many: options: found 'degre'; expected one of: "),
        ({"budget": 0.0}, "op.plan_many: budget: found the float 0.0"),
        ({"workers": 0}, "op.plan_many: workers: found the int 0"),
        ({"workers": "tcp://here"}, "op.plan_many: workers: found the str 'tcp://here'"),
        ({"progress": 3}, "op.plan_many: progress: found the int 3"),
    ],
)
def test_wrong_arguments_are_told_at_the_call(problems, arguments, words):
    with pytest.raises(op.InputError) as caught:
        op.plan_many(**{"problems": problems, **arguments})
    assert str(caught.value).startswith(words)


def test_an_expression_that_no_process_can_load_is_named_before_anything_is_planned():
    problem = op.load_problem("12_planar")
    mine = problem.with_constraints(op.Expression("level", lambda state: state.q[0], upper=3.0))
    with pytest.raises(op.InputError, match=r"op.plan_many: problems\[1\]: found the expression 'level'.*no lambda"):
        op.plan_many([problem, mine])
