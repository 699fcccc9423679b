"""Verified runs to execute, planned once, whatever the number of workers."""

import os
import pickle
import threading
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

import optiplan as op


class Enough:
    """Progress that says when the first motion is verified: tasks are looked at, not timed."""

    def __init__(self) -> None:
        self.reached = threading.Event()

    def __call__(self, stage: str, fraction: float) -> None:
        """Nothing."""

    def proved(self, motion: op.Trajectory, seconds: float) -> None:
        """It is."""
        self.reached.set()


def planned(name: str) -> op.Run:
    """Return the verified run of a shipped problem."""
    problem, enough = op.load_problem(name), Enough()
    run = op.plan(problem, budget=op.Budget(60.0, cancel=enough.reached) if problem.task else 3.0, progress=enough)
    assert run.verified, run
    return run


def planned_once(name: str, folder: Path) -> op.Run:
    """Return what the first worker that asks has planned, and left in a folder for the others."""
    file = folder / f"{name}.run"
    try:
        os.close(os.open(folder / f"{name}.begun", os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        until = time.monotonic() + 120.0
        while not file.exists() and time.monotonic() < until:
            time.sleep(0.05)
    else:
        whole = folder / f"{name}.part"
        whole.write_bytes(pickle.dumps(planned(name)))
        whole.rename(file)
    return pickle.loads(file.read_bytes()) if file.exists() else planned(name)


@pytest.fixture(scope="session")
def run_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], op.Run]:
    """Return the verified run of a shipped problem."""
    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder  # that of all workers
    return cache(lambda name: planned_once(name, folder))
