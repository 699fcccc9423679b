"""Assemblies: schedules beside enumeration, and jobs that begin where others leave things."""

from itertools import permutations, product
from types import SimpleNamespace

import numpy as np
import pytest

import optiplan as op
from optiplan.planners import base
from optiplan.planners.base import Budget
from optiplan.studies.assembly.measuring import measure_jobs
from optiplan.studies.assembly.schedule import Durations, ScheduleSearch
from optiplan.studies.assembly.statement import read_assembly

ARMS = {"a": {"use": "planar2r"}, "b": {"use": "planar2r", "base": {"position": [0, 3, 0]}}}
FILE = {"version": 1, "robots": ARMS, "start": {"configuration": "ready"}, "planner": "quintic"}
BALL = {"name": "ball", "shape": {"sphere": 0.02}, "pose": {"position": [0.3, 0.3, 1.0]}}
BRING = [
    {"move": {"joints": [0.3, 0.4]}},
    {"attach": {"object": "ball", "link": "{arm}/tip"}},
    {"move": {"joints": [1.0, 0.2]}},
    {"detach": {"object": "ball"}},
]


def random_durations(seed, jobs=5, arms=2):
    rng = np.random.default_rng(seed)
    work, travel = rng.uniform(0.5, 3.0, (arms, jobs)), rng.uniform(0.1, 1.0, (arms, jobs + 1, jobs))
    for _ in range(1 + seed % 3):  # jobs for one arm alone
        work[rng.integers(arms), rng.integers(jobs)] = np.inf
    work[0, np.isinf(work).all(axis=0)] = 1.0
    after = tuple(tuple(i for i in range(k) if rng.random() < 0.25) for k in range(jobs))
    return Durations(work, travel, after)


def least_by_enumeration(durations):
    """Over all assignments and all orders of which each is carried out as soon as it can be."""
    arms, jobs = durations.work.shape
    best = np.inf
    for order in permutations(range(jobs)):
        if any(order.index(i) > order.index(k) for k in range(jobs) for i in durations.after[k]):
            continue
        for given in product(range(arms), repeat=jobs):
            free, last, ends = [0.0] * arms, [-1] * arms, {}
            for k in order:
                a = given[k]
                begin = max([free[a], *(ends[i] for i in durations.after[k])])
                free[a] = ends[k] = begin + durations.travel[a, last[a], k] + durations.work[a, k]
                last[a] = k
            best = min(best, max(free))
    return best


@pytest.mark.parametrize("seed", range(8))
def test_the_best_schedule_is_that_of_enumeration(seed):
    durations = random_durations(seed)
    search = ScheduleSearch(durations, 3, Budget(30.0))
    assert search.exact
    assert search.found[0].makespan == pytest.approx(least_by_enumeration(durations))
    assert [one.makespan for one in search.found] == sorted(one.makespan for one in search.found)
    assert durations.bound <= search.found[0].makespan + 1e-9


def test_many_jobs_have_a_schedule_at_once():
    search = ScheduleSearch(random_durations(1, jobs=20, arms=3), 1, Budget(0.0))
    assert not search.exact
    ends = {one.job: one.end for one in search.found[0].jobs}
    assert sorted(ends) == list(range(20))
    assert all(one.begin >= ends[k] for one in search.found[0].jobs for k in search.durations.after[one.job])
    assert search.found[0].makespan < 1.7 * search.durations.bound


def test_a_long_job_of_an_arm_of_its_own_is_begun_in_time():
    """Twelve jobs are for the first arm alone, one for the other: once the first has begun two, it has no turn."""
    work = np.full((2, 13), np.inf)
    work[0, :12], work[1, 12] = 2.0, 30.0
    search = ScheduleSearch(Durations(work, np.zeros((2, 14, 13)), ((),) * 13), 4, Budget(0.0))
    assert search.found[0].makespan == 30.0


@pytest.fixture(scope="module")
def passed_on():
    """The first arm alone brings the ball to where it is let go; the other looks on, then it is brought further."""
    away = [{"move": {"joints": [-0.5, 0.2]}}, {"dwell": 0.2}]
    jobs = [
        {"name": "bring", "steps": BRING, "arms": ["a"]},
        {"name": "again", "steps": BRING, "arms": ["a"], "after": ["bring"]},
        {"name": "look", "steps": away, "after": ["bring"], "arms": ["b"]},
        {"name": "at once", "steps": away, "arms": ["b"]},
    ]
    return op.assign({**FILE, "scene": {"obstacles": [BALL]}, "jobs": jobs}, budget=30.0)


def test_jobs_wait_for_those_of_other_arms(passed_on):
    assert passed_on.run.verified
    times = {one.job: one for one in passed_on.jobs}
    assert times["look"].begin >= times["bring"].end > 0.0
    assert times["again"].begin >= times["bring"].end
    assert times["at once"].begin == 0.0
    assert any(step.waits for step in passed_on.run.problem.task)
    assert passed_on.one_arm is None
    assert passed_on.ended == "done"


def test_a_job_alone_begins_with_what_others_left(passed_on):
    left = {name: passed_on.measured.alone["a", k].left for k, name in enumerate(("bring", "again"))}
    places = [bodies[0].X_WO.translation for bodies in left.values()]
    assert np.linalg.norm(places[0] - [0.3, 0.3, 1.0]) > 0.1
    assert np.linalg.norm(places[1] - places[0]) > 0.1


def test_the_problem_as_it_is_given_is_read_again(passed_on, tmp_path):
    passed_on.save(tmp_path)
    assert op.load_problem(tmp_path / "problem.yaml").hash == passed_on.run.problem.hash
    assert op.load_run(tmp_path / "run").verified
    assert op.verify(op.load_problem(tmp_path / "problem.yaml"), passed_on.run.trajectory).verified


def test_ctrl_c_keeps_the_best_motion():
    def interrupt(stage, fraction):
        if stage == "planning the best schedules" and fraction > 0.0:
            raise KeyboardInterrupt

    steps = [{"move": {"joints": [1.0, 0.5]}}]
    found = op.assign(
        {**FILE, "jobs": [{"name": name, "steps": steps} for name in ("x", "y")]}, budget=30.0, progress=interrupt
    )
    assert found.ended == "interrupted"
    assert found.run.verified
    assert found.makespan < found.one_arm.makespan


def test_a_job_that_only_some_arms_can_do_says_why():
    robots = {**ARMS, "b": {"use": "two_links", "base": {"position": [0, 3, 0]}}}
    file = {**FILE, "robots": robots, "start": {"joints": [0.3] * 4}, "scene": {"obstacles": [BALL]}}
    jobs = [
        {"name": "of a", "steps": BRING},
        {"name": "any", "steps": [{"move": {"joints": [0.4, 0.2]}}]},
    ]
    found = op.assign({**file, "jobs": jobs}, budget=30.0)
    assert {one.job: one.arm for one in found.jobs} == {"of a": "a", "any": "b"}
    assert list(found.measured.unable) == [("b", 0)]
    assert "jobs[0].steps[1].attach.link" in found.measured.unable["b", 0]
    with pytest.raises(op.InputError, match="b/tip"):
        op.assign({**file, "jobs": [{**jobs[0], "arms": ["b"]}]})


def test_why_a_schedule_makes_no_problem_is_said():
    """Alone, each arm could do it: what hangs at the other one's tip is where it was."""
    steps = [{**step, "attach": {"object": "ball", "link": "a/tip"}} if "attach" in step else step for step in BRING]
    jobs = [
        {"name": "of a", "steps": [{"move": {"joints": [1.0, 0.5]}}], "arms": ["a"]},
        {"name": "of b", "steps": steps, "arms": ["b"]},
    ]
    found = op.assign({**FILE, "scene": {"obstacles": [BALL]}, "jobs": jobs}, budget=30.0)
    assert found.best is None
    assert "'a/tip', a link of a" in found.words
    assert found.data["refused"]


def test_jobs_that_take_all_that_they_may_leave_time_to_the_last(monkeypatch):
    """Each of ten jobs gets half of an even share at least, and the first ones get more."""
    now, given = [0.0], []
    monkeypatch.setattr(base, "clock", lambda: now[0])

    def plan(_problem, budget):
        given.append(budget.remaining)
        now[0] += budget.remaining
        return SimpleNamespace(verified=False, why_not="budget")

    jobs = [{"name": str(k), "steps": [{"move": {"joints": [1.0, 0.1 * k]}}]} for k in range(5)]
    measure_jobs(read_assembly({**FILE, "jobs": jobs}), plan, Budget(60.0), lambda stage, fraction: None)
    assert len(given) == 10
    assert min(given) == pytest.approx(3.0)
    assert given[0] == pytest.approx(18.0)
