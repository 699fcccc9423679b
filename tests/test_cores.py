"""The cores that a process is given: of a container with a share of the machine, that share."""

import os
import sys
import threading
from concurrent.futures import ProcessPoolExecutor

import pytest

from optiplan.cores import QUICK, THREADS, OneThreadContext, cores, keeping_time, take_turns

ALL = len(os.sched_getaffinity(0))


@pytest.mark.parametrize(
    ("text", "given"),
    [("max 100000", ALL), ("100000 100000", 1), ("150000 100000", 1), ("50000 100000", 1), ("9e9 100000", ALL)],
)
def test_a_share_of_the_machine_is_what_it_is_worth(tmp_path, text, given):
    (tmp_path / "cpu.max").write_text(text + "\n")
    assert cores(tmp_path) == given


@pytest.mark.parametrize(("quota", "given"), [("-1", ALL), ("100000", 1)])
def test_groups_of_the_first_version_say_it_in_two_files(tmp_path, quota, given):
    (tmp_path / "cpu").mkdir()
    (tmp_path / "cpu/cpu.cfs_quota_us").write_text(quota)
    (tmp_path / "cpu/cpu.cfs_period_us").write_text("100000")
    assert cores(tmp_path) == given


def test_without_a_group_all_cores_are_given(tmp_path):
    assert cores(tmp_path) == ALL


def test_processes_of_one_thread_inherit_that(monkeypatch):
    monkeypatch.delenv(THREADS, raising=False)
    with ProcessPoolExecutor(1, OneThreadContext()) as pool:
        assert pool.submit(os.getenv, THREADS).result() == "1"
    assert THREADS not in os.environ


def test_a_thread_that_keeps_time_runs_before_others_until_it_gives_way():
    with keeping_time():
        allowed, seen = os.sched_getscheduler(0) == os.SCHED_FIFO, []
        for work in (lambda: None, take_turns):
            thread = threading.Thread(target=lambda work=work: (work(), seen.append(os.sched_getscheduler(0))))
            thread.start()
            thread.join()
    assert seen == [os.SCHED_FIFO if allowed else os.SCHED_OTHER, os.SCHED_OTHER]
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_threads_of_python_take_turns_where_one_keeps_time():
    before = sys.getswitchinterval()
    with keeping_time():
        assert sys.getswitchinterval() == pytest.approx(min(before, QUICK))
        with keeping_time():
            assert sys.getswitchinterval() == pytest.approx(min(before, QUICK))
        assert sys.getswitchinterval() == pytest.approx(min(before, QUICK))
    assert sys.getswitchinterval() == pytest.approx(before)
