"""Shared by all tests: reproducible hypothesis runs, data sets that lie beside the checkout where there are any."""

import gc
import os
import time
from collections.abc import Callable, Generator, Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import settings

import optiplan as op  # which loads nothing until it is used
from optiplan import libraries
from tests.planned import Until, made_once
from tests.viewer.browsing import browser  # noqa: F401  # one for all: a process runs playwright's loop once

LONGEST = (
    "test_examples.py",
    "service/behaviour/test_faults.py",
    "service/behaviour/test_outages.py",
    "service/behaviour/test_studio.py",
    "service/test_pages.py",
    "test_python_examples.py",
    "bench/execution/test_runner.py",
    "planners/behaviour/test_contract.py",
    "api/behaviour/test_package.py",
    "core/test_cpp.py",
    "test_docs.py",
    "cli/behaviour/test_process.py",
    "cli/commands/bench/test_report.py",
    "service/behaviour/test_shell.py",
    "service/behaviour/test_hindrances.py",
    "bench/dask/test_cluster.py",
    "viewer/behaviour/test_instrument.py",
    "execution/behaviour/test_attacks.py",
    "workspace/behaviour/test_workspace.py",
    "planners/sampling/constrained/test_planner.py",
    "viewer/behaviour/test_browser.py",
    "planners/task/test_planner.py",
    "test_contributing.py",
    "bench/execution/behaviour/test_same_bits.py",
    "verify/bounds/test_bound.py",
    "reference/test_page.py",
    "planners/sampling/behaviour/test_sampling_planners.py",
    "bench/report/behaviour/test_report_browser.py",
    "planners/trajopt/behaviour/test_search.py",
    "planners/behaviour/test_determinism.py",
    "service/behaviour/test_stranger.py",
    "reference/test_sclerp_motion.py",
    "cli/commands/studies/test_design.py",
    "simulation/test_closed_loop.py",
    "planners/sclerp/test_planner.py",
    "viewer/test_run_data.py",
    "reference/test_problems.py",
    "service/routes/test_runs.py",
    "runs/test_wished_clearance.py",
    "bench/test_bench.py",
    "control/test_limits.py",
    "service/behaviour/test_load.py",
    "bench/execution/behaviour/test_faults.py",
    "planners/test_sampling.py",
    "service/routes/test_executions.py",
    "cli/commands/robots/test_init.py",
    "robot/test_robot.py",
    "cli/commands/test_view.py",
    "test_from_the_lecture.py",
    "simulation/plants/test_mujoco_tasks.py",
    "viewer/test_plots.py",
    "planners/task/test_via_moves.py",
    "runs/test_export.py",
)
"""Files that take longest, longest first: begun first, none of them is left for one worker alone at the end."""

TO_THE_END = ("49_hand_over",)
"""A task of two arms whose steps are joined and optimised together as well. It takes what it needs."""
LONG = 120.0
"""Seconds, ten times what the slowest example needs: a mere limit, as each run ends with its first verified answer."""

settings.register_profile("suite", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("suite")

ROOT = Path(__file__).parent.parent
TESTS = ROOT / "tests"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first, in the order that workers take them in, which is one for all of them.

    Behind the very longest come the files that need a server, all of them: a worker keeps one until they are done.
    """
    ranks = {TESTS / name: rank for rank, name in enumerate(LONGEST)}

    @cache  # nine thousand tests are in six hundred files
    def place(file: Path) -> tuple[bool, int, Path]:
        rank = ranks.get(file, len(ranks))
        return rank > 0 and TESTS / "service" not in file.parents, rank, file

    items.sort(key=lambda item: place(item.path))


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Look for garbage neither while 8,000 tests are collected, of which nothing is garbage, nor among them later.

    Each worker begins with other files: what one of them has compiled is on disk when the others come to it.
    """
    worker = getattr(session.config, "workerinput", None)
    if worker is not None and [Path(one).resolve() for one in session.config.args] == [TESTS]:
        files = sorted(str(file) for file in TESTS.rglob("test_*.py"))
        first = len(files) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
        session.config.args[:] = files[first:] + files[:first]
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of optional test data: $OPTIPLAN_SHARED, by default `../shared` beside the checkout."""
    folder = Path(os.environ.get("OPTIPLAN_SHARED", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip(f"no test data in {folder}")
    return folder


@pytest.fixture(scope="module")
def processor_clock() -> Iterator[None]:
    """Budgets and timings of a module's tests count this process's own work, so that a busy machine changes nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(libraries, "time", SimpleNamespace(perf_counter=time.process_time))
        yield


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, s, that budgets and timings of a test count, which the test sets."""
    now = [100.0]
    monkeypatch.setattr(libraries, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    return now


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a test's own cache, which is empty at first."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache/optiplan"


@pytest.fixture
def urgent() -> Iterator[None]:
    """A test's loops in real time, and the processes that it starts, come before other tests where that is allowed."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        os.setpriority(os.PRIO_PROCESS, 0, -15)
    except OSError:  # not ours to say
        yield
        return
    yield
    os.setpriority(os.PRIO_PROCESS, 0, before)


@pytest.fixture(scope="session")
def problems() -> Path:
    """Folder of the numbered examples."""
    return ROOT / "problems"


@pytest.fixture(scope="session")
def example(problems: Path, tmp_path_factory: pytest.TempPathFactory) -> "Callable[[str], op.Run]":
    """The verified run of a numbered example by its own planner, which ends with its first verified answer."""

    def planned(name: str) -> "op.Run":
        from optiplan.runs.pipeline import run

        problem, progress = op.load_problem(problems / f"{name}.yaml"), Until()
        budget = op.Budget(LONG) if name in TO_THE_END else op.Budget(LONG, progress.met)
        found = run(problem, problem.planner, problem.options, budget, progress)
        assert found.failure is None, found.failure
        assert found.verified, [check for check in found.report.failures]
        return found

    return cache(lambda name: made_once(tmp_path_factory, f"example-{name}", lambda: planned(name)))
