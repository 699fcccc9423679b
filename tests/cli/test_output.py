import json
import os
import signal

import pytest
from rich.console import Console

from optiplan.cli.output import interruptible, interrupts_held, print_json, report_error, stdout_is_ours
from optiplan.cli.printing.report import show_report
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.verify.report import Check, Report, VerifyPolicy

ISSUE = Issue("a.yaml", 3, "start.joints", "a list of 6 values", "7 values", ("start", "joints"))


def test_foreign_writes_to_stdout_go_to_stderr(capfd):
    with stdout_is_ours():
        os.write(1, b"noise of a library\n")
    os.write(1, b"result\n")
    out, err = capfd.readouterr()
    assert (out, err) == ("result\n", "noise of a library\n")


def test_stdout_comes_back_after_an_error(capfd):
    try:
        with stdout_is_ours():
            raise ValueError
    except ValueError:
        os.write(1, b"still here")
    assert capfd.readouterr().out == "still here"


def test_one_line_one_object(capsys):
    print_json({"a": [1, 2.5, None]})
    assert capsys.readouterr().out == '{"a": [1, 2.5, null]}\n'


def test_issues_in_words(capsys):
    report_error(InputError([ISSUE]), as_json=False)
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "a.yaml:3: start.joints: a list of 6 values; expected 7 values\n"


def test_issues_as_json(capsys):
    report_error(InputError([ISSUE]), as_json=True)
    out, err = capsys.readouterr()
    data = json.loads(out)
    assert err == ""
    assert data["exit_code"] == 2
    assert data["issues"] == [
        {
            "file": "a.yaml",
            "line": 3,
            "field": "start.joints",
            "found": "a list of 6 values",
            "expected": "7 values",
            "path": ["start", "joints"],
            "planner": None,
            "function": None,
        }
    ]


def test_other_errors_carry_their_choices(capsys):
    report_error(UnknownChoiceError("planner", "rrt", ["quintic", "trajopt"]), as_json=False)
    assert capsys.readouterr().err == "optiplan: unknown planner 'rrt'; choose from: quintic, trajopt\n"


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupts_wait(end):
    seen = []
    previous = signal.signal(end, lambda *_: seen.append("interrupt"))
    try:
        with interrupts_held():
            os.kill(os.getpid(), end)
            seen.append("saved")
        assert seen == ["saved", "interrupt"]
    finally:
        signal.signal(end, previous)


def test_lines_to_a_pipe_are_not_wrapped(optiplan, tmp_path, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    _, out, _ = optiplan("plan", "27_circle", "--out", tmp_path / "run")
    whole = [line for line in out.splitlines() if line.startswith("links without geometry")]
    assert len(whole[0]) > 120
    assert whole[0].endswith("grasp")
    monkeypatch.setenv("COLUMNS", "60")
    _, out, _ = optiplan("verify", "27_circle", tmp_path / "run")
    assert max(map(len, out.splitlines())) <= 60


def test_a_motion_that_ends_where_it_began_has_no_bound(optiplan, tmp_path):
    _, out, _ = optiplan("plan", "27_circle", "--out", tmp_path / "run")
    assert "no lower bound: it ends where it began" in out
    assert "bound, 0.000 s" not in out


@pytest.mark.parametrize(("passed", "worst"), [(False, "1.00005"), (True, "1")])
def test_a_failed_check_shows_that_it_is_beyond_the_limit(capsys, passed, worst):
    check = Check("velocity", "exact", passed, 1.0000476, 1.000001, "rad/s")
    show_report(Console(), Report(VerifyPolicy(), (check,), {}), full=True)
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("velocity")]
    assert row.split()[2:4] == [worst, "1"]


def test_interrupts_are_exceptions_meanwhile():
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), interruptible():
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, previous)
