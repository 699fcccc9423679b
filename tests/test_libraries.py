"""Libraries are loaded on nobody's budget."""

import subprocess
import sys
import threading
import time

import pytest

from optiplan.libraries import clock, loading, time_loading
from optiplan.planners.base import Budget


def test_the_clock_stands_still_while_libraries_are_loaded(by_hand):
    budget, began, before = Budget(2.0), clock(), time_loading()
    by_hand[0] += 0.5
    with loading():
        by_hand[0] += 7.0
        assert clock() - began == pytest.approx(0.5)
        with loading():  # a library that loads another one
            by_hand[0] += 1.0
        assert budget.remaining == pytest.approx(1.5)
        assert time_loading() - before == pytest.approx(8.0)
    by_hand[0] += 1.0
    assert budget.remaining == pytest.approx(0.5)
    assert budget.share(0.5).remaining == pytest.approx(0.25)
    assert time_loading() - before == pytest.approx(8.0)


def test_an_import_that_fails_starts_the_clock_again(by_hand):
    began = clock()

    def load():
        with loading():
            by_hand[0] += 3.0
            raise ImportError

    with pytest.raises(ImportError):
        load()
    by_hand[0] += 1.0
    assert clock() - began == pytest.approx(1.0)


def test_two_threads_that_load_at_once_stop_it_once():
    before, began = time_loading(), time.perf_counter()
    both = threading.Barrier(2)

    def load():
        with loading():
            both.wait()
            time.sleep(0.05)

    threads = [threading.Thread(target=load) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert 0.04 < time_loading() - before <= time.perf_counter() - began


def test_a_planner_that_needs_libraries_has_its_whole_budget():
    """In a fresh process: the import of OMPL is told apart, and the budget is far shorter than that takes."""
    code = """
import sys, time
from types import SimpleNamespace
import optiplan as op
from optiplan import libraries

late = [0.0]
libraries.time = SimpleNamespace(perf_counter=lambda: time.process_time() + late[0])

class Disk:  # from which OMPL takes 1000 s to read
    def find_spec(name, *rest):
        late[0] += 1000.0 * (name == "ompl")

sys.meta_path.insert(0, Disk)
problem = op.load_problem("02_shelf")
run = op.plan(problem, "rrtstar", budget=0.25)
quiet = False  # a slow machine may import one more library in a later run, but each only once
while not quiet:
    quiet = "libraries" not in op.plan(problem, "rrtstar", budget=0.25).timings
print(run.timings["libraries"] > 1000.0, run.timings["plan"] < 500.0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True True"
