import io
import os
import signal
import sys
from types import SimpleNamespace

import pytest

from optiplan.cli import progress
from optiplan.cli.progress import KeptAnswer, ProgressLine
from tests.waiting import wait_until


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets."""
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(progress, "time", SimpleNamespace(perf_counter=lambda: now.seconds))
    return now


def test_short_work_says_nothing(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with ProgressLine() as line:
        clock.seconds += 1.9
        line("optimise", 0.5)
    assert sys.stderr.getvalue() == ""


def test_long_work_says_stage_and_fraction_and_cleans_up(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with ProgressLine() as line:
        clock.seconds += 2.1
        line("optimise", 0.5)
        clock.seconds += 0.01  # too soon for another change
        line("optimise", 0.6)
        clock.seconds += 1.0
        line("verify", 0.0)
    assert sys.stderr.getvalue() == "\r\x1b[K  2.1 s  optimise  50%\r\x1b[K  3.1 s  verify\r\x1b[K"


def test_a_stage_that_does_not_report_is_shown_all_the_same(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "QUIET", 0.0)
    monkeypatch.setattr(progress, "SILENT", 0.01)
    with ProgressLine() as line:
        line("writing", 0.0)  # at once, which is too soon for the line
        wait_until(lambda: "writing" in sys.stderr.getvalue())
    assert sys.stderr.getvalue().endswith("\r\x1b[K")


def test_the_line_tells_the_best_motion_its_time_and_its_gap_to_the_bound(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with ProgressLine() as line:
        clock.seconds += 0.5
        line.found(SimpleNamespace(duration=1.2), 1.0)
        clock.seconds += 2.0
        line("optimise", 0.5)
    told = "\r\x1b[K  2.5 s  optimise  50%  best 1.200 s (found after 0.50 s, 20.0% above the bound)"
    assert sys.stderr.getvalue() == told + "\r\x1b[K"


def test_no_line_into_a_file(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with ProgressLine() as line:
        clock.seconds += 9.0
        line("optimise", 0.5)
    assert sys.stderr.getvalue() == ""


def test_the_first_ctrl_c_keeps_a_motion_and_the_second_is_the_systems():
    before = signal.getsignal(signal.SIGINT)
    with KeptAnswer() as line:
        assert signal.getsignal(signal.SIGINT) is before  # nothing to keep
        line.found(SimpleNamespace(duration=1.2), 1.0)
        os.kill(os.getpid(), signal.SIGINT)
        assert line.cancel.wait(1.0)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
        line.found(SimpleNamespace(duration=1.1), 1.0)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) is before
