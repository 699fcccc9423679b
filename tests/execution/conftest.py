"""Verified runs to execute, planned once, whatever the number of workers."""

from collections.abc import Callable
from functools import cache

import pytest

import optiplan as op
from tests.planned import made_once


def planned(name: str) -> op.Run:
    """Return the verified run of a shipped problem."""
    run = op.plan(op.load_problem(name), budget=3.0)
    assert run.verified, run
    return run


@pytest.fixture(scope="session")
def run_of(tmp_path_factory: pytest.TempPathFactory, example: Callable[[str], op.Run]) -> Callable[[str], op.Run]:
    """Return the verified run of a shipped problem; a task is looked at, not timed: its first motion is enough."""

    def run(name: str) -> op.Run:
        if op.load_problem(name).task:
            return example(name)
        return made_once(tmp_path_factory, f"executed-{name}", lambda: planned(name))

    return cache(run)


@pytest.fixture(scope="session")
def endless_run(tmp_path_factory: pytest.TempPathFactory) -> op.Run:
    """Return the verified run of one joint without limits of position, from 0.1 to 1.5 rad."""
    file = tmp_path_factory.mktemp("endless") / "robot.yaml"
    rows = "[{name: turn, joint: revolute, a: 0.3}]"
    limits = "{velocity: 2, acceleration: 8, jerk: 80}"
    dh = f"{{convention: standard, unit: rad, radius: 0.05, rows: {rows}}}"
    file.write_text(f"version: 1\nname: one\ndh: {dh}\nlimits: {limits}\n")
    run = op.plan(op.Problem(str(file), [0.1], [1.5]), budget=1.0)
    assert run.verified
    assert run.problem.robot.endless.all()
    return run
