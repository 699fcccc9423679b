"""Plans that end as soon as there is what a test wants, and things that one worker makes for all."""

import os
import pickle
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import pytest

import optiplan as op

PATIENCE = 120.0
"""s that a worker waits for what another one makes, before it makes the same."""
Made = TypeVar("Made")


class Until:
    """Progress that ends a search, which would improve its answer, once a motion is verified that a test wants."""

    def __init__(self, wanted: "Callable[[op.Trajectory], bool]" = lambda motion: True) -> None:
        self.wanted, self.met = wanted, threading.Event()

    def __call__(self, stage: str, fraction: float) -> None:
        """Nothing."""

    def proved(self, motion: "op.Trajectory", seconds: float) -> None:
        """It is verified."""
        if self.wanted(motion):
            self.met.set()


def planned_until(
    problem: "op.Problem",
    planner: str = "trajopt",
    seconds: float = 10.0,
    wanted: "Callable[[op.Trajectory], bool]" = lambda motion: True,
) -> "op.Run":
    """Return the run of a problem that ends with the first wanted motion, after so many seconds at the latest."""
    progress = Until(wanted)
    return op.plan(problem, planner, budget=op.Budget(seconds, cancel=progress.met), progress=progress)


def made_once(folders: pytest.TempPathFactory, name: str, make: Callable[[], Made]) -> Made:
    """Return what the first worker that asks by this name has made, and left in a folder for the others."""
    folder = folders.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder  # that of all workers
    file = folder / f"{name}.made"
    try:
        os.close(os.open(folder / f"{name}.begun", os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        until = time.monotonic() + PATIENCE
        while not file.exists() and time.monotonic() < until:
            time.sleep(0.05)
        return _read(file) if file.exists() else make()
    made = make()
    whole = folder / f"{name}.part"
    whole.write_bytes(pickle.dumps(made))
    whole.rename(file)
    return made


def _read(file: Path) -> Any:
    return pickle.loads(file.read_bytes())
